"""A city as flat shapes in painting order: what a map shows behind an episode, on paper and in a terminal alike."""

from __future__ import annotations

import hashlib
import math
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import msgspec

from lingjing.errors import LingjingError
from lingjing.plugins.host import PluginHost
from lingjing.scene.city import City, Pieces, Polygon
from lingjing.scene.tiles import Bounds, Tiles
from lingjing.trace.reader import Trace

Kind = Literal["water", "land", "sand", "slab", "green", "paved", "path", "road", "solid", "bridge", "building", "pipe"]
"""What is drawn alike; the order is that of painting."""

Point = tuple[float, float]

SLAB_M = 0.6
"""A solid no thicker than this is ground to stand on: a kerbed block, a deck."""

_SURFACES: dict[str, Kind] = {
    "sand": "sand", "park": "green", "grass": "green", "forest": "green", "pitch": "green", "plaza": "paved",
    "sidewalk": "paved", "parking": "paved", "asphalt": "paved", "concrete": "paved",
}  # fmt: skip
_KINDS: tuple[Kind, ...] = get_args(Kind)


@dataclass(frozen=True, slots=True)
class Shape:
    """A polygon with its holes, or (`width_m` > 0) a line of that width; east and north in metres."""

    kind: Kind
    points: tuple[Point, ...]
    holes: tuple[Polygon, ...] = ()
    width_m: float = 0.0


def ground_plan(city: City, bounds: Bounds) -> tuple[Shape, ...]:
    """The shapes of a city in and around `bounds`, in the order in which they cover each other.

    What nobody paints (land on land, surfaces of a district) is left out. Raises `UsageError` if the city's folder
    is gone.
    """
    west, south, east, north = bounds
    middle, radius = ((west + east) / 2, (south + north) / 2), math.hypot(east - west, north - south) / 2
    shapes: dict[Kind, list[Shape]] = defaultdict(list)
    for shape in _everywhere(city):
        shapes[shape.kind].append(shape)
    for tile in Tiles(city).near(*middle, radius):
        for shape in _of_tile(tile):
            shapes[shape.kind].append(shape)
    return tuple(shape for kind in _KINDS for shape in shapes[kind])


def is_sea(shapes: Iterable[Shape]) -> bool:
    """Whether water is what lies under everything."""
    return any(shape.kind == "water" for shape in shapes)


def city_of(trace: Trace) -> City | None:
    """The city a trace was played in, built again; None if it is no longer to be had exactly as it was."""
    try:
        city = PluginHost().scene(trace.header.instance.scene.kind).build(trace.header.instance.scene)
    except LingjingError:
        return None  # another machine's map, or a plug-in that is not here: the trace is drawn without
    return city if identity(city) == trace.header.city_sha256 else None


def identity(city: City) -> str:
    """What a trace's header calls its city: SHA-256 over its content."""
    return city.sha256 or hashlib.sha256(msgspec.json.encode(city)).hexdigest()


# -- private


def _everywhere(city: City) -> Iterator[Shape]:
    for water in city.waters:
        yield Shape("water", water.polygon, water.holes)
    for land in city.lands:
        yield Shape("sand" if land.surface == "sand" else "land", land.polygon)


def _of_tile(tile: Pieces) -> Iterator[Shape]:
    for area in tile.areas:
        if area.surface in _SURFACES:
            yield Shape(_SURFACES[area.surface], area.polygon, area.holes)
    for junction in tile.junctions:
        yield Shape("road", junction.polygon)
    for road in tile.roads:
        if not road.tunnel:
            for lane in road.lanes:
                on_foot = lane.kind in ("foot", "bicycle")
                yield Shape("path" if on_foot else "road", _flat(lane.shape), width_m=lane.width_m)
    for solid in tile.solids:
        yield Shape("slab" if solid.top_m - solid.base_m <= SLAB_M else "solid", solid.polygon)
    for bridge in tile.bridges:
        yield Shape("bridge", _flat(bridge.path), width_m=bridge.width_m)
    for building in sorted(tile.buildings, key=lambda one: (one.top_m, one.id)):
        yield Shape("building", building.polygon, building.holes)
    for pipe in tile.pipes:
        yield Shape("pipe", _flat(pipe.path), width_m=2 * pipe.radius_m)


def _flat(path: Sequence[tuple[float, ...]]) -> tuple[Point, ...]:
    return tuple((point[0], point[1]) for point in path)
