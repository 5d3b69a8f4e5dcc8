"""JSON Schemas of action and message specs, and the bounds to which the kernel clips arguments."""

from __future__ import annotations

import math
from collections.abc import Mapping

from lingjing.mission.instance import ArgumentSpec, Datum
from lingjing.mission.model import Field

REACH_M = 1.0e7
"""Bound of every coordinate, distance and other argument of a command (chosen; the Earth's radius is 6.4e6 m).
Arithmetic with admitted numbers stays finite, so that no argument can make an engine fail."""

ELEVATION = "z"
"""The argument with an elevation, which the altitude band limits."""

JsonSchema = dict[str, object]


def altitude_band(properties: Mapping[str, Datum]) -> tuple[float, float] | None:
    """The lowest and the highest elevation of an entity with an altitude band, metres; None without one."""
    low, high = properties.get("band_low_m"), properties.get("band_high_m")
    if not isinstance(low, int | float) or not isinstance(high, int | float):
        return None
    return float(low), float(high)


def argument_bounds(spec: ArgumentSpec, properties: Mapping[str, Datum]) -> tuple[float, float]:
    """The bounds to which the kernel clips an argument: its declared ones, and for an elevation also the altitude band.

    A verb of the motion `up` or `down` is limited by the resource's present altitude, which is not included here.
    """
    low = -math.inf if spec.minimum is None else spec.minimum
    high = math.inf if spec.maximum is None else spec.maximum
    band = altitude_band(properties) if spec.name == ELEVATION else None
    return (low, high) if band is None else (max(low, band[0]), min(high, band[1]))


def field_schema(field: Field) -> JsonSchema:
    """The schema of a message's field."""
    if field.type == "number":
        bounds = {"minimum": field.minimum, "maximum": field.maximum, "description": field.unit or None}
        return {"type": "number", **{key: value for key, value in bounds.items() if value is not None}}
    return _FIELDS[field.type]


def object_schema(properties: Mapping[str, object], required: tuple[str, ...]) -> JsonSchema:
    """The schema of an object with these properties and no others."""
    return {
        "type": "object",
        "properties": dict(properties),
        "required": list(required),
        "additionalProperties": False,
    }


_FIELDS: dict[str, JsonSchema] = {
    "name": {"type": "string"},
    "text": {"type": "string"},
    "frame": {"type": "string", "description": "id of a picture"},
    "flag": {"type": "boolean"},
    "names": {"type": "array", "items": {"type": "string"}},
    "position": {
        "type": "array",
        "items": {"type": "number", "minimum": -REACH_M, "maximum": REACH_M},
        "minItems": 2,
        "maxItems": 3,
        "description": "east, north, elevation in metres",
    },
    "box": {
        "type": "array",
        "items": {"type": "number", "minimum": 0, "maximum": 1},
        "minItems": 4,
        "maxItems": 4,
        "description": "x_min, y_min, x_max, y_max in 0..1, origin top left",
    },
}
