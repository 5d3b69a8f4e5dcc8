"""Checks that every city passes: finite numbers, sufficient bounds, complete shapes and unique ids."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from typing import Any

import msgspec

from lingjing.mission.instance import SceneSpec
from lingjing.mission.kinds import centre_m, extent_m
from lingjing.scene.city import City, Pieces

_LEAST = {"polygon": 3, "top": 3, "path": 2, "shape": 2}
"""Least number of points in a piece's field, by the field's name."""


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
    if msgspec.msgpack.decode(msgspec.msgpack.encode(city), type=City) != city:
        yield "it changes on the way to another process (msgpack)"
    for kind in Pieces.__struct_fields__:
        pieces = getattr(city, kind)
        for name, count in Counter(getattr(piece, "id", None) for piece in pieces).items():
            if name is not None and count > 1:
                yield f"{count} of its {kind} are called `{name}`"
        for number, piece in enumerate(pieces):
            yield from _piece_faults(f"{kind}[{number}]", msgspec.to_builtins(piece))


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
