"""How large an entity is, and whether one can bump into it, by what its type or its mission declares.

These are `length`, `width`, `height`, `shape` and `origin` (docs/language.md).
"""

from __future__ import annotations

from lingjing.mission.appearance import BARE, MEASURES, UNSAID_M
from lingjing.mission.instance import Entity
from lingjing.scene.sizes import Size


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
    if entity is None or entity.properties.get("origin") != "middle":
        return 0.0
    return entity_size(entity).height_m / 2.0


__all__ = ["UNSAID_M", "entity_size", "solid_size", "sunk_m"]
