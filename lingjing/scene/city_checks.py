"""Checks that every city passes: finite numbers, sufficient bounds, complete shapes and unique ids."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from typing import Any

import msgspec
import shapely

from lingjing.decoding import from_msgpack
from lingjing.mission.geometry2d import Polygon
from lingjing.mission.instance import SceneSpec
from lingjing.mission.kinds import centre_m, extent_m
from lingjing.scene.city import City, Pieces

_LEAST = {"polygon": 3, "top": 3, "path": 2, "shape": 2}
"""Least number of points in a piece's field, by the field's name."""

_LEAST_OVERLAP_M2 = 1.0
"""The overlap of a land and a water that is no fault, square metres. Chosen: outlines that touch may cross a little."""


def city_faults(city: City, spec: SceneSpec) -> Iterator[str]:
    """Yield each violation of the scene's spec and the contract of cities, in words."""
    west, south, east, north = city.bounds
    if not (west < east and south < north):
        yield f"its bounds {city.bounds} are no (west, south, east, north)"
    half_m, (x, y) = (extent_m(spec) or 0.0) / 2.0, centre_m(spec)
    if half_m and not (west <= x - half_m and south <= y - half_m and x + half_m <= east and y + half_m <= north):
        yield f"its bounds {city.bounds} do not hold the {2.0 * half_m:g} m that the scene is wide"
    if not (-85.0 <= city.origin[0] <= 85.0 and -180.0 <= city.origin[1] <= 180.0):
        yield f"its origin {city.origin} is no latitude and longitude"
    if city.datum_m != spec.datum_m:
        yield f"its water lies at {city.datum_m:g} m, the mission says {spec.datum_m:g} m"
    yield from _flooded_lands(city)
    if from_msgpack(msgspec.msgpack.encode(city), City) != city:
        yield "it changes on the way to another process (msgpack)"
    for kind in Pieces.__struct_fields__:
        pieces = getattr(city, kind)
        for name, count in Counter(getattr(piece, "id", None) for piece in pieces).items():
            if name is not None and count > 1:
                yield f"{count} of its {kind} are called `{name}`"
        for number, piece in enumerate(pieces):
            yield from _piece_faults(f"{kind}[{number}]", msgspec.to_builtins(piece))


def _flooded_lands(city: City) -> Iterator[str]:
    """Yield each land with a top that is not above a water under it: the surface there is ambiguous."""
    waters = [(number, water, _area(water.polygon, water.holes)) for number, water in enumerate(city.waters)]
    for number, land in enumerate(city.lands):
        area = _area(land.polygon)
        for of_water, water, wet in waters:
            if land.top_m <= water.level_m and area is not None and wet is not None and area.intersects(wet):
                overlap_m2 = area.intersection(wet).area
                if overlap_m2 > _LEAST_OVERLAP_M2:
                    yield (
                        f"lands[{number}] has its top at {land.top_m:g} m and waters[{of_water}] its level at "
                        f"{water.level_m:g} m, and they overlap by {overlap_m2:.0f} m²: raise the land, lower the "
                        f"water, or cut a hole into the water"
                    )


def _area(polygon: Polygon, holes: tuple[Polygon, ...] = ()) -> shapely.Geometry | None:
    """Return a polygon as a geometry; None for a faulty one, which another check reports."""
    numbers = [number for outline in (polygon, *holes) for point in outline for number in point]
    if min(map(len, (polygon, *holes))) < _LEAST["polygon"] or not all(map(math.isfinite, numbers)):
        return None
    return shapely.make_valid(shapely.Polygon(polygon, holes))


def _piece_faults(where: str, value: Any) -> Iterator[str]:
    """Yield numbers that are not finite, and lines and outlines of too few points, with their paths."""
    if isinstance(value, float) and not math.isfinite(value):
        yield f"{where} is {value}"
    for key, part in value.items() if isinstance(value, dict) else ():
        least = _LEAST.get(key, 0)
        if least and len(part) < least:
            yield f"{where}.{key} has {len(part)} points, {least} are due"
        yield from _piece_faults(f"{where}.{key}", part)
    for number, part in enumerate(value if isinstance(value, list | tuple) else ()):
        yield from _piece_faults(f"{where}[{number}]", part)
