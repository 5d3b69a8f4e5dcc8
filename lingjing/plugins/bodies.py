"""What engines know of others that reach them only as mirrors: how large they are, and whether they are in the way.

An entity's type or its mission declares `length`, `width`, `height`, `shape` and `origin` (docs/language.md).
Background traffic is of a kind (`BodyState.kind`), which `scene.sizes` measures.
"""

from __future__ import annotations

from math import hypot

from lingjing.mission.appearance import BARE, MEASURES, UNSAID_M
from lingjing.mission.instance import Entity
from lingjing.scene.sizes import SIZES, Size
from lingjing.trace.records import BodyState


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


def mirror_size(state: BodyState, entity: Entity | None) -> Size | None:
    """Dimensions of a mirrored body that one can bump into: an entity, or background traffic of a known kind."""
    return solid_size(entity) if entity is not None and not state.kind else SIZES.get(state.kind)


def shape_of(entity: Entity | None) -> str:
    """What fills the box of a body's dimensions: a box, a cylinder, a sphere or a cone."""
    return "box" if entity is None else str(entity.properties.get("shape", "box"))


def within(shape: str, ahead: float, abeam: float, up: float) -> bool:
    """Whether a point lies in a shape that fills the box from -1 to 1 along each axis."""
    if max(abs(ahead), abs(abeam), abs(up)) >= 1.0:
        return False
    if shape == "sphere":
        return hypot(ahead, abeam, up) < 1.0
    if shape == "cylinder":
        return hypot(ahead, abeam) < 1.0
    return shape != "cone" or 2.0 * hypot(ahead, abeam) < 1.0 - up


def sunk_m(entity: Entity | None) -> float:
    """How far an entity reaches below its position: half of its height if its origin is its middle."""
    if entity is None or entity.properties.get("origin") != "middle":
        return 0.0
    return entity_size(entity).height_m / 2.0


def floats(entity: Entity) -> bool:
    """Whether an entity is afloat where there is water: a vessel, what drifts, and what stands on water."""
    return entity.engine == "vessel" or "drift_mps" in entity.properties or entity.properties.get("on") == "water"


__all__ = ["UNSAID_M", "entity_size", "floats", "mirror_size", "shape_of", "solid_size", "sunk_m", "within"]
