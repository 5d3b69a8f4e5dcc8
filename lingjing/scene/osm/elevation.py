"""How high each node of the streets lies, from bridges, tunnels and what they cross.

A map says what is above what, and hardly ever how high. So the ground is level at 0, a bridge that crosses a street or
a railway lies `LAYER_M` above it, its ramps fall at `GRADE` along the streets that lead to it, and a bridge over water
alone stays level. A tunnel falls at the same grade from its portals; no street outside of one sinks.
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
"""Rise over run of ramps."""

Links = dict[int, list[tuple[int, float]]]
"""Node → neighbours and metres to them."""


def heights(data: MapData, features: Features, ways: list[Way]) -> dict[int, float]:
    """Elevation in metres of every node of `ways` that the map has."""
    refs = sorted({ref for way in ways for ref in way.nodes if ref in data.nodes})
    places = {ref: from_geodetic(*data.nodes[ref], features.frame.origin) for ref in refs}
    open_air = _links([way for way in ways if not _is_tunnel(way.tags)], places)
    raised = _raised(features, ways, places)
    found = dict.fromkeys(refs, 0.0) | _falling(raised, open_air)
    return {ref: round(z, 2) for ref, z in (found | _sunken(ways, places, set(open_air))).items()}


def bridge_heights(features: Features) -> dict[str, float]:
    """The height of every bridge for vehicles by its `ref`: above what it crosses, 0 where that is water alone."""
    import shapely

    lines = [f for f in features.lines if is_surface_way(f.tags)]
    tree = shapely.STRtree([f.shape for f in lines])
    bridges = sorted((f for f in lines if _is_bridge(f.tags)), key=lambda f: (layer(f.tags), f.ref))
    found: dict[str, float] = {}
    for bridge in bridges:  # from the lowest layer up: what they cross is known by then
        below = _below(bridge, lines, tree)
        found[bridge.ref] = max((found.get(other.ref, 0.0) + LAYER_M for other in below), default=0.0)
    return found


def is_surface_way(tags: dict[str, str]) -> bool:
    """Whether a line is a street or a railway in the open, which a bridge needs room above."""
    moving = tags.get("highway") in VEHICLES or tags.get("railway") in ("rail", "light_rail", "tram", "monorail")
    return moving and not _is_tunnel(tags)


# -- private


def _is_bridge(tags: dict[str, str]) -> bool:
    """Also a street on a layer above the ground that nobody called a bridge."""
    return "highway" in tags and layer(tags) > 0


def _is_tunnel(tags: dict[str, str]) -> bool:
    return tags.get("tunnel", "no") not in ("no", "building_passage", "passage")


def _below(bridge: Feature, lines: list[Feature], tree: Any) -> list[Feature]:
    """What a bridge passes over: crossing lines of a lower layer."""
    crossed = (lines[int(k)] for k in tree.query(bridge.shape, predicate="crosses"))
    return [other for other in crossed if layer(other.tags) < layer(bridge.tags)]


def _raised(features: Features, ways: list[Way], places: dict[int, tuple[float, float]]) -> dict[int, float]:
    """The nodes of bridges that lie above something."""
    known = bridge_heights(features)
    found: dict[int, float] = {}
    for way in ways:
        height = known.get(f"w{way.id}", 0.0)
        for ref in way.nodes if height > 0.0 else ():
            if ref in places:
                found[ref] = max(height, found.get(ref, 0.0))
    return found


def _links(ways: list[Way], places: dict[int, tuple[float, float]]) -> Links:
    found: Links = {}
    for way in ways:
        refs = [ref for ref in way.nodes if ref in places]
        for a, b in pairwise(refs):
            length = dist(places[a], places[b])
            found.setdefault(a, []).append((b, length))
            found.setdefault(b, []).append((a, length))
    return found


def _falling(raised: dict[int, float], links: Links) -> dict[int, float]:
    """Heights along the links, falling from the raised nodes at the grade until they reach the ground."""
    found: dict[int, float] = {}
    queue = [(-height, ref) for ref, height in sorted(raised.items())]
    heapq.heapify(queue)
    while queue:
        negative, ref = heapq.heappop(queue)
        if ref in found:
            continue
        found[ref] = -negative
        for other, length in links.get(ref, ()):
            height = -negative - GRADE * length
            if other not in found and height > 0.0:
                heapq.heappush(queue, (-height, other))
    return found


def _sunken(ways: list[Way], places: dict[int, tuple[float, float]], open_air: set[int]) -> dict[int, float]:
    """Depths of the nodes inside tunnels, falling from the portals; deeper layers are not told apart near them."""
    tunnels = [way for way in ways if _is_tunnel(way.tags)]
    links = _links(tunnels, places)
    deepest = {ref: LAYER_M * max(1, -layer(way.tags)) for way in tunnels for ref in way.nodes}
    most = max(deepest.values(), default=0.0)
    above = _falling({ref: most for ref in links if ref in open_air}, links)
    return {ref: -min(deepest[ref], most - above.get(ref, 0.0)) for ref in links if ref not in open_air}
