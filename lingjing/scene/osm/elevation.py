"""Elevation of each street node, from bridges, tunnels and the things that they cross.

A map states the order of layers, but hardly ever elevations. So the ground is level at 0. A bridge that crosses a
street or a railway lies `LAYER_M` above it; its ramps fall at `GRADE` along the streets that lead to it. A bridge over
water alone stays level. A tunnel falls at the same grade from its portals; no street outside a tunnel is below ground.
"""

from __future__ import annotations

import heapq
from itertools import pairwise
from math import dist
from typing import Any

from lingjing.mission.frames import from_geodetic
from lingjing.scene.network import LAYER_M
from lingjing.scene.osm.features import Feature, Features
from lingjing.scene.osm.map_data import MapData, Way
from lingjing.scene.osm.tags import VEHICLES, layer

GRADE = 0.07
"""Rise over run of ramps (chosen)."""

Links = dict[int, list[tuple[int, float]]]
"""Node → its neighbours and the distances to them, metres."""


def heights(data: MapData, features: Features, ways: list[Way]) -> dict[int, float]:
    """Elevation of every node of `ways` that the map has, metres."""
    refs = sorted({ref for way in ways for ref in way.nodes if ref in data.nodes})
    places = {ref: from_geodetic(*data.nodes[ref], features.frame.origin) for ref in refs}
    open_air = _links([way for way in ways if not _is_tunnel(way.tags)], places)
    raised = _raised(features, ways, places)
    elevations = dict.fromkeys(refs, 0.0) | _falling(raised, open_air)
    return {ref: round(z, 2) for ref, z in (elevations | _sunken(ways, places, set(open_air))).items()}


def bridge_heights(features: Features) -> dict[str, float]:
    """Elevation of every bridge for vehicles by its `ref`, metres: above what it crosses, 0 over water alone."""
    import shapely

    lines = [f for f in features.lines if is_surface_way(f.tags)]
    tree = shapely.STRtree([f.shape for f in lines])
    bridges = sorted((f for f in lines if _is_bridge(f.tags)), key=lambda f: (layer(f.tags), f.ref))
    elevations: dict[str, float] = {}
    for bridge in bridges:  # from the lowest layer up, so that the elevations of crossed bridges are known
        below = _below(bridge, lines, tree)
        elevations[bridge.ref] = max((elevations.get(other.ref, 0.0) + LAYER_M for other in below), default=0.0)
    return elevations


def is_surface_way(tags: dict[str, str]) -> bool:
    """True if a line is a street or a railway in the open, above which a bridge needs clearance."""
    moving = tags.get("highway") in VEHICLES or tags.get("railway") in ("rail", "light_rail", "tram", "monorail")
    return moving and not _is_tunnel(tags)


# -- private


def _is_bridge(tags: dict[str, str]) -> bool:
    """True for a way on a layer above the ground, even without the tag `bridge`."""
    return "highway" in tags and layer(tags) > 0


def _is_tunnel(tags: dict[str, str]) -> bool:
    return tags.get("tunnel", "no") not in ("no", "building_passage", "passage")


def _below(bridge: Feature, lines: list[Feature], tree: Any) -> list[Feature]:
    """The crossing lines of a lower layer, which a bridge passes over."""
    crossed = (lines[int(k)] for k in tree.query(bridge.shape, predicate="crosses"))
    return [other for other in crossed if layer(other.tags) < layer(bridge.tags)]


def _raised(features: Features, ways: list[Way], places: dict[int, tuple[float, float]]) -> dict[int, float]:
    """Elevations of the nodes of bridges that lie above something, metres."""
    known = bridge_heights(features)
    elevations: dict[int, float] = {}
    for way in ways:
        height = known.get(f"w{way.id}", 0.0)
        for ref in way.nodes if height > 0.0 else ():
            if ref in places:
                elevations[ref] = max(height, elevations.get(ref, 0.0))
    return elevations


def _links(ways: list[Way], places: dict[int, tuple[float, float]]) -> Links:
    links: Links = {}
    for way in ways:
        refs = [ref for ref in way.nodes if ref in places]
        for a, b in pairwise(refs):
            length = dist(places[a], places[b])
            links.setdefault(a, []).append((b, length))
            links.setdefault(b, []).append((a, length))
    return links


def _falling(raised: dict[int, float], links: Links) -> dict[int, float]:
    """Elevations along the links, falling from the raised nodes at `GRADE` until they reach the ground, metres."""
    elevations: dict[int, float] = {}
    queue = [(-height, ref) for ref, height in sorted(raised.items())]
    heapq.heapify(queue)
    while queue:
        negative, ref = heapq.heappop(queue)
        if ref in elevations:
            continue
        elevations[ref] = -negative
        for other, length in links.get(ref, ()):
            height = -negative - GRADE * length
            if other not in elevations and height > 0.0:
                heapq.heappush(queue, (-height, other))
    return elevations


def _sunken(ways: list[Way], places: dict[int, tuple[float, float]], open_air: set[int]) -> dict[int, float]:
    """Depths of the nodes inside tunnels, falling from the portals. Near portals deeper layers are not
    distinguished."""
    tunnels = [way for way in ways if _is_tunnel(way.tags)]
    links = _links(tunnels, places)
    deepest = {ref: LAYER_M * max(1, -layer(way.tags)) for way in tunnels for ref in way.nodes}
    most = max(deepest.values(), default=0.0)
    above = _falling({ref: most for ref in links if ref in open_air}, links)
    return {ref: -min(deepest[ref], most - above.get(ref, 0.0)) for ref in links if ref not in open_air}
