"""How large things are: length, width and height, metres.

What a scene and its traffic put up is of a size by its kind. What a mission's own entities measure, and whether one can
bump into them, their types declare: `length`, `width`, `height`, `shape` and `origin` (docs/language.md).
"""

from __future__ import annotations

from dataclasses import dataclass

from lingjing.mission.appearance import BARE, MEASURES, UNSAID_M
from lingjing.mission.footprint import sunk_below_m
from lingjing.mission.instance import Entity


@dataclass(frozen=True, slots=True)
class Size:
    """Outer dimensions along, across and up, metres."""

    length_m: float
    width_m: float
    height_m: float


SIZES: dict[str, Size] = {
    "car": Size(4.5, 1.8, 1.5),
    "delivery_van": Size(5.9, 2.1, 2.6),
    "truck": Size(9.0, 2.5, 3.6),
    "bus": Size(12.0, 2.55, 3.1),
    "fire_truck": Size(8.6, 2.5, 3.3),
    "motorcycle": Size(2.2, 0.8, 1.5),
    "bicycle": Size(1.7, 0.6, 1.6),
    "person": Size(0.4, 0.5, 1.75),
}
"""Cars after the traffic simulator's defaults, the rest as drawn."""


def entity_size(entity: Entity) -> Size:
    """Dimensions of an entity; half a metre where it declares none."""
    return Size(*((entity.number(f"{name}_m") or UNSAID_M) for name in MEASURES))


def solid_size(entity: Entity) -> Size | None:
    """Dimensions of an entity that one can bump into; None for one that is nothing to bump into.

    Every asset is a body. A target is one if it declares its length, width and height: a fire or a leak does not.
    Nothing of the shape `none` is one.
    """
    measured = all(entity.number(f"{name}_m") for name in MEASURES)
    if entity.properties.get("shape") == BARE or not (entity.role == "asset" or measured):
        return None
    return entity_size(entity)


def sunk_m(entity: Entity | None) -> float:
    """How far an entity reaches below its position: half of its height if its origin is its middle."""
    return 0.0 if entity is None else sunk_below_m(entity)
