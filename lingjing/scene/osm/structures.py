"""Open-air structures that are no buildings: piers, walls, hedges, pipelines, and the decks under raised roads.

A deck follows its lanes. So it continues under a ramp that the map does not tag as a bridge, down to the ground.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from itertools import pairwise
from math import ceil, hypot
from typing import Any

import msgspec

from lingjing.mission.geometry2d import Extent, Polygon
from lingjing.mission.instance import Vector
from lingjing.scene.city import Bridge, Junction, Lane, Pipe, Road, Solid
from lingjing.scene.cutting import polygons, rings
from lingjing.scene.lines import line_length
from lingjing.scene.osm.features import Features
from lingjing.scene.osm.tags import is_below, is_set, layer, metres
from lingjing.sums import total

DECK_M = 0.9
"""Height over the ground from which a raised way gets a deck, metres (chosen). A lower one is drawn on the ground."""

BURIED_M = -1.0
"""Elevation below which a road is invisible, metres (chosen)."""

LAP_M = 0.012
"""Overlap of neighbouring lanes, metres (chosen); half of it narrows the line between them on each side."""

GAP_M = 0.06
"""Widest gap between lanes that is closed, metres (chosen): a wider one is no rounding error."""

FACING_M = 0.045
"""Widening of the lane beside the opposite direction, metres: netconvert rounds bends separately, up to 4 cm
apart."""

PIER_TOP_M = 0.3
"""Elevation of the top of piers, metres (chosen)."""
PILES_M = 12.0
"""Distance between piles, metres (chosen)."""
PLATFORM_M = 1.5
"""Width of the deck around a building over water, metres (chosen)."""
OVERGROUND = ("overground", "overhead", "surface", "aboveground", "bridge", "outdoor")
"""Values of `location` of a pipeline in the open."""
PIPE_M = 0.3
"""Radius of a pipeline without a tagged diameter, metres (chosen)."""
RACK_M = 0.9
"""Elevation of the axis of a pipeline on its supports, metres (chosen)."""
GANTRY_TOP_M = 5.5
"""Elevation of its axis over streets, metres (chosen: clear of vehicles of 4.5 m)."""
GANTRY_M = 2.0
"""Distance from a street at which a pipeline rises, metres (chosen)."""
WALLS = {"wall": (0.3, 2.2), "city_wall": (1.5, 6.0), "retaining_wall": (0.4, 1.0), "hedge": (0.9, 1.2)}
"""`barrier` → usual thickness and height, metres (chosen)."""


def is_visible(road: Road) -> bool:
    """True if a road is visible: no tunnel, and not wholly under the ground."""
    return not road.tunnel and any(point[2] > BURIED_M for lane in road.lanes for point in lane.shape)


def overlap_lanes(road: Road) -> Road:
    """Widen the driving lanes of a road a little, so that no ground shows between them.

    netconvert places each lane separately and rounds its points to the centimetre.
    """
    wider = [0.0] * len(road.lanes)
    for k, (right, left) in enumerate(pairwise(road.lanes)):
        if "foot" not in (right.kind, left.kind):
            lap = min(max(0.0, _gap(right, left)), GAP_M) + LAP_M
            wider[k], wider[k + 1] = max(wider[k], lap), max(wider[k + 1], lap)
    if road.lanes and road.lanes[-1].kind != "foot":
        wider[-1] = max(wider[-1], FACING_M)
    lanes = (
        msgspec.structs.replace(lane, width_m=round(lane.width_m + by, 3)) if by else lane
        for lane, by in zip(road.lanes, wider, strict=True)
    )
    return msgspec.structs.replace(road, lanes=tuple(lanes))


def clip_road(road: Road, bounds: Extent) -> Road | None:
    """Clip a road to the frame: of each lane its longest section there. None if nothing is left.

    A network keeps whole edges that touch the frame; one of a bridge or an expressway may extend a kilometre beyond it.
    """
    if all(_holds(bounds, point) for lane in road.lanes for point in lane.shape):
        return road
    lanes = [msgspec.structs.replace(lane, shape=_longest_within(lane.shape, bounds)) for lane in road.lanes]
    lanes = [lane for lane in lanes if len(lane.shape) > 1]
    return msgspec.structs.replace(road, lanes=tuple(lanes)) if lanes else None


def is_open(junction: Junction) -> bool:
    """True if a junction is above the ground."""
    return junction.elevation_m > BURIED_M


def is_inside(junction: Junction, bounds: Extent) -> bool:
    """True if a junction touches the frame."""
    return any(_holds(bounds, (x, y, 0.0)) for x, y in junction.polygon)


def decks(roads: Iterable[Road]) -> Iterator[Bridge]:
    """Yield the structures under roads: all bridges, including level ones over water, and every raised section."""
    for road in roads:
        if road.lanes:
            path, width = middle(road)
            for number, stretch in enumerate([path] if road.bridge else raised_sections(path)):
                name = f"deck-{road.id}" + (f"-{number}" if number else "")
                yield Bridge(id=name, path=stretch, width_m=round(width + 1.0, 2), name=road.name)


def middle(road: Road) -> tuple[tuple[Vector, ...], float]:
    """The centre line of all lanes of a road, and their total width in metres."""
    width = total(lane.width_m for lane in road.lanes)
    first, last = road.lanes[0], road.lanes[-1]
    if len(first.shape) == len(last.shape):
        # Uses the outer edges, not the lane centres, because lanes may differ in width (sidewalks do).
        share = (width - first.width_m / 2.0 - last.width_m / 2.0) or 1.0
        across = (width / 2.0 - first.width_m / 2.0) / share
        path = tuple(_mix(a, b, across) for a, b in zip(first.shape, last.shape, strict=True))
        return path, width
    return road.lanes[len(road.lanes) // 2].shape, width


def raised_sections(path: tuple[Vector, ...]) -> list[tuple[Vector, ...]]:
    """The sections of a path that are higher than `DECK_M`, cut where it crosses that height."""
    sections: list[list[Vector]] = []
    for a, b in pairwise(path):
        low, high = sorted((a[2], b[2]))
        if high <= DECK_M:
            continue
        start, end = a, b
        if low < DECK_M:
            crossing = _mix(a, b, (DECK_M - a[2]) / (b[2] - a[2]))
            start, end = (crossing, b) if a[2] < DECK_M else (a, crossing)
        if sections and sections[-1][-1] == start:
            sections[-1].append(end)
        else:
            sections.append([start, end])
    return [tuple(stretch) for stretch in sections]


def piers(features: Features, level_m: float) -> Iterator[Solid]:
    """Yield the decks of piers and jetties, and their piles, over water at `level_m`."""
    for feature in (*features.areas, *features.lines):
        if feature.tags.get("man_made") not in ("pier", "breakwater", "groyne") or is_set(feature.tags, "building"):
            continue
        shape = feature.shape
        if shape.geom_type.endswith("LineString"):
            shape = shape.buffer((metres(feature.tags, "width") or 3.0) / 2.0, cap_style="flat", quad_segs=1)
        solid = feature.tags["man_made"] != "pier"
        base = level_m - 2.0 if solid else PIER_TOP_M - 0.4
        for number, part in enumerate(polygons(shape.intersection(features.box).simplify(0.1))):
            outline = (rings(part) or ((),))[0]
            name = f"pier-{feature.ref}-{number}"
            if outline:
                yield Solid(id=name, polygon=outline, base_m=base, top_m=PIER_TOP_M, material="concrete")
                yield from () if solid else _piles(name, outline, level_m)


def platforms(outlines: Iterable[Any], level_m: float) -> Iterator[Solid]:
    """Yield the decks and piles under buildings over water at `level_m`. `outlines`: shapely polygons."""
    for number, outline in enumerate(outlines):
        deck = outline.buffer(PLATFORM_M, join_style="mitre")
        for part, ring in ((part, ring) for part, shape in enumerate(polygons(deck)) for ring in rings(shape)[:1]):
            name = f"platform-{number}-{part}"
            yield Solid(id=name, polygon=ring, base_m=-0.4, top_m=PIER_TOP_M, material="wood")
            yield from _piles(name, ring, level_m)


def pipelines(features: Features, free: Any, blocked: Any) -> Iterator[Pipe]:
    """Yield the pipelines that lie in the open, raised over streets (`free`) and cut at buildings (`blocked`).

    Both are prepared shapely geometries.
    """
    for line in features.lines:
        if line.tags.get("man_made") != "pipeline" or not _is_overground(line.tags):
            continue
        radius = min(max(_diameter_m(line.tags) / 2.0, PIPE_M), 1.5)
        for number, piece in enumerate(features.pieces(line)):
            parts = [part for part in _line_parts(piece.simplify(0.1).difference(blocked)) if part.length > 4.0]
            for k, part in enumerate(parts):
                name = f"pipe-{line.ref}-{number}" + (f"-{k}" if k else "")
                yield Pipe(id=name, path=_over(part, free), radius_m=round(radius, 2))


def walls(features: Features, free: Any) -> Iterator[Solid]:
    """Yield walls and hedges, one solid for each straight piece. `free`: prepared geometry that none may cross
    (roads)."""
    for line in features.lines:
        kind = line.tags.get("barrier", "")
        if kind not in WALLS or is_below(line.tags) or layer(line.tags) != 0:
            continue
        thick, usual = WALLS[kind]
        height = metres(line.tags, "height") or usual
        material = "hedge" if kind == "hedge" else "concrete"
        for part in features.pieces(line):
            for number, (a, b) in enumerate(pairwise(part.simplify(0.2).coords)):
                outline = _strip(a, b, thick)
                if outline and not _crosses(outline, free):
                    yield Solid(id=f"{kind}-{line.ref}-{number}", polygon=outline, base_m=0.0,
                                top_m=round(min(max(height, 0.3), 12.0), 2), material=material)  # fmt: skip


# -- private


def _is_overground(tags: Mapping[str, str]) -> bool:
    """True if a pipeline can be seen; one without a location is taken as visible."""
    return not is_below(tags) and tags.get("location", "overground") in OVERGROUND


def _diameter_m(tags: Mapping[str, str]) -> float:
    """The tagged diameter; 0 without one. A number above 10 is in millimetres, as OpenStreetMap's convention says."""
    stated = metres(tags, "diameter") or 0.0
    return stated / 1000.0 if stated > 10.0 else stated


def _line_parts(shape: Any) -> list[Any]:
    import shapely

    return [part for part in shapely.get_parts(shape) if part.geom_type == "LineString"]


def _over(line: Any, free: Any) -> tuple[Vector, ...]:
    """The path of a pipe along a line: at rack height, on a gantry over streets."""
    import shapely

    crossed = shapely.intersection(line, free)
    gantry = crossed.buffer(GANTRY_M, cap_style="flat") if not crossed.is_empty else crossed
    ends = {line.project(shapely.Point(point)) for part in _line_parts(crossed) for point in part.coords}
    bends = {line.project(shapely.Point(point)) for point in line.coords}
    edges = {min(max(end + step, 0.0), line.length) for end in ends for step in (-GANTRY_M, -GANTRY_M + 0.4, 0.0)} | {
        min(max(end + step, 0.0), line.length) for end in ends for step in (GANTRY_M, GANTRY_M - 0.4)
    }
    path = []
    for at in sorted(bends | edges):
        spot = line.interpolate(at)
        high = not gantry.is_empty and gantry.distance(spot) < 0.01 and crossed.distance(spot) < GANTRY_M - 0.2
        path.append((round(spot.x, 3), round(spot.y, 3), GANTRY_TOP_M if high else RACK_M))
    return tuple(path)


def _gap(right: Lane, left: Lane) -> float:
    """The widest gap between two lanes at the points of their centre lines, metres; negative if they overlap."""
    import shapely

    lines = [shapely.LineString([point[:2] for point in lane.shape]) for lane in (right, left)]
    apart = max(
        float(shapely.distance(shapely.points(line.coords), other).max()) for line, other in (lines, lines[::-1])
    )
    return apart - (right.width_m + left.width_m) / 2.0


def _holds(bounds: Extent, point: Vector) -> bool:
    west, south, east, north = bounds
    return west <= point[0] <= east and south <= point[1] <= north


def _longest_within(path: tuple[Vector, ...], bounds: Extent) -> tuple[Vector, ...]:
    runs: list[list[Vector]] = []
    for a, b in pairwise(path):
        shares = _within(a, b, bounds)
        if shares is None:
            continue
        start, end = (
            (a if shares[0] == 0.0 else _mix(a, b, shares[0])),
            (b if shares[1] == 1.0 else _mix(a, b, shares[1])),
        )
        if runs and runs[-1][-1] == start:
            runs[-1].append(end)
        else:
            runs.append([start, end])
    return tuple(max(runs, key=line_length)) if runs else ()


def _within(a: Vector, b: Vector, bounds: Extent) -> tuple[float, float] | None:
    """The shares of a segment between which it is inside a box (Liang and Barsky); None if it is outside."""
    west, south, east, north = bounds
    first, last = 0.0, 1.0
    for start, step, low, high in ((a[0], b[0] - a[0], west, east), (a[1], b[1] - a[1], south, north)):
        if step == 0.0:
            if not low <= start <= high:
                return None
            continue
        near, far = sorted(((low - start) / step, (high - start) / step))
        first, last = max(first, near), min(last, far)
    return (first, last) if first < last else None


def _mix(a: Vector, b: Vector, share: float) -> Vector:
    x, y, z = (round(p + share * (q - p), 3) for p, q in zip(a, b, strict=True))
    return x, y, z


def _piles(name: str, outline: Polygon, level_m: float) -> Iterator[Solid]:
    number = 0
    for (ax, ay), (bx, by) in zip(outline, (*outline[1:], outline[0]), strict=True):
        length = hypot(bx - ax, by - ay)
        for k in range(ceil(length / PILES_M) if length > 2.0 else 0):
            share = (k + 0.5) / ceil(length / PILES_M)
            # a little inside the edge: the interior of an anticlockwise outline is on its left
            x = ax + share * (bx - ax) - 0.5 * (by - ay) / length
            y = ay + share * (by - ay) + 0.5 * (bx - ax) / length
            pile = ((x - 0.25, y - 0.25), (x + 0.25, y - 0.25), (x + 0.25, y + 0.25), (x - 0.25, y + 0.25))
            yield Solid(id=f"{name}-pile-{number}", base_m=level_m - 3.0, top_m=PIER_TOP_M - 0.4,
                        polygon=tuple((round(px, 2), round(py, 2)) for px, py in pile))  # fmt: skip
            number += 1


def _strip(a: tuple[float, ...], b: tuple[float, ...], thick: float) -> Polygon:
    """The rectangle around a straight piece, anticlockwise; empty for a piece that is too short."""
    length = hypot(b[0] - a[0], b[1] - a[1])
    if length < 0.2:
        return ()
    east, north = (b[1] - a[1]) / length * thick / 2.0, -(b[0] - a[0]) / length * thick / 2.0
    corners = ((a[0] + east, a[1] + north), (b[0] + east, b[1] + north),
               (b[0] - east, b[1] - north), (a[0] - east, a[1] - north))  # fmt: skip
    return tuple((round(x, 3), round(y, 3)) for x, y in corners)


def _crosses(outline: Polygon, free: Any) -> bool:
    import shapely

    return bool(shapely.intersects(free, shapely.Polygon(outline)))
