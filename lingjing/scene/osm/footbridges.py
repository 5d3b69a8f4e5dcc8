"""Bridges for pedestrians and cyclists, which the road network leaves out, with the stairs and ramps up to them.

Pieces of bridge that meet form one bridge. Its elevation is the highest that any street, railway or bridge below
requires. A bridge over water or grass alone lies at ground level. Stairs and paths that begin at its ends rise to it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import pairwise
from math import dist
from typing import Any

from lingjing.mission.instance import Vector
from lingjing.scene.city import Bridge, Road
from lingjing.scene.network import LAYER_M
from lingjing.scene.osm.elevation import bridge_heights, is_surface_way
from lingjing.scene.osm.features import Feature, Features
from lingjing.scene.osm.tags import is_below, is_set, layer, metres
from lingjing.sums import total

WIDTHS_M = {"footway": 3.5, "path": 2.5, "cycleway": 3.5, "pedestrian": 6.0}
"""Usual widths of decks, metres (chosen)."""
GRADES = {"steps": 0.5, "footway": 0.1, "path": 0.1, "cycleway": 0.06, "pedestrian": 0.1}
"""Rise over run of ways that lead up to a deck (chosen)."""
LEVEL_M = 0.15
"""Elevation of a deck at ground level, metres (chosen)."""
THICKNESS_M = 0.6
"""Thickness of a deck, metres (chosen)."""
MOST_M = 30.0
"""Greatest width of a path, metres (chosen)."""


def footbridges(features: Features, roads: Iterable[Road]) -> Iterator[Bridge]:
    """The decks and the ways up to them. A way among `roads` already has its deck."""
    known = {road.id.lstrip("-").split("#")[0] for road in roads}
    bridges = [f for f in features.lines if _is_footbridge(f.tags) and f.ref[1:] not in known]
    heights = _heights(bridges, features)
    ends: dict[tuple[float, float], float] = {}
    for bridge, height in zip(bridges, heights, strict=True):
        for number, path in enumerate(map(_corners, features.pieces(bridge))):
            yield _deck(f"foot-{bridge.ref}", number, bridge, tuple((x, y, height) for x, y in path))
            for end in (path[0], path[-1]):
                ends[end] = max(height, ends.get(end, 0.0))
    for way in features.lines:
        grade = GRADES.get(way.tags.get("highway", ""))
        if grade is not None and not _is_footbridge(way.tags) and not is_below(way.tags):
            yield from _ramps(way, grade, ends, features)


# -- private


def _is_footbridge(tags: dict[str, str]) -> bool:
    return tags.get("highway") in WIDTHS_M and is_set(tags, "bridge") and not is_below(tags)


def _heights(bridges: list[Feature], features: Features) -> list[float]:
    """Elevation of each bridge, metres: over what it crosses, then the highest of all bridges that it is joined to."""
    import shapely

    if not bridges:
        return []
    streets = [f for f in features.lines if is_surface_way(f.tags)]
    raised = bridge_heights(features)
    tree = shapely.STRtree([f.shape for f in streets])
    elevations = []
    for bridge in bridges:
        crossed = (streets[int(k)] for k in tree.query(bridge.shape, predicate="crosses"))
        under = (raised.get(f.ref, 0.0) + LAYER_M for f in crossed if layer(f.tags) < layer(bridge.tags))
        elevations.append(max(under, default=LEVEL_M))
    joints = shapely.STRtree([f.shape for f in bridges])
    pairs = [(int(a), int(b)) for a, b in joints.query([f.shape for f in bridges], predicate="touches").T]
    for _ in bridges:  # at most as many rounds as the longest chain has members
        before = list(elevations)
        for a, b in pairs:
            elevations[a] = elevations[b] = max(elevations[a], elevations[b])
        if elevations == before:
            break
    return elevations


def _ramps(way: Feature, grade: float, ends: dict[tuple[float, float], float], features: Features) -> Iterator[Bridge]:
    """The part of a way from a raised deck down to the ground, if the way begins or ends at one."""
    for number, path in enumerate(map(_corners, features.pieces(way))):
        for side, points in enumerate((path, path[::-1])):
            height = ends.get(points[0], 0.0)
            if height > LEVEL_M:
                yield _deck(f"ramp-{way.ref}-{side}", number, way, _descent(points, height, grade))


def _descent(points: list[tuple[float, float]], height: float, grade: float) -> tuple[Vector, ...]:
    """The line descending from its beginning; steeper than `grade` if the line is too short."""
    lengths = [dist(a, b) for a, b in pairwise(points)]
    grade = max(grade, height / total(lengths))
    path: list[Vector] = [(*points[0], height)]
    for (a, b), length in zip(pairwise(points), lengths, strict=True):
        top = path[-1][2]
        share = min(1.0, top / (grade * length)) if length > 0.0 else 1.0
        low = max(0.0, round(top - grade * length * share, 3))
        path.append((round(a[0] + share * (b[0] - a[0]), 3), round(a[1] + share * (b[1] - a[1]), 3), low))
        if low == 0.0:
            break
    return tuple(path)


def _deck(name: str, number: int, way: Feature, path: tuple[Vector, ...]) -> Bridge:
    usual = WIDTHS_M.get(way.tags["highway"], 2.5)
    width = min(max(metres(way.tags, "width") or usual, 1.0), MOST_M)
    return Bridge(id=f"{name}-{number}" if number else name, path=path, width_m=width, thickness_m=THICKNESS_M,
                  pier_spacing_m=24.0 if path[0][2] > LEVEL_M else 0.0,
                  name=way.tags.get("name:en", way.tags.get("name", "")))  # fmt: skip


def _corners(part: Any) -> list[tuple[float, float]]:
    return [(x, y) for x, y, *_ in part.coords]
