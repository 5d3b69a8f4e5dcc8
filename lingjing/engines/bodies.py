"""What engines know of others that reach them only as mirrors: are they there, how large, and what fills their boxes.

Entities declare their measures (`lingjing.plugins.bodies`). Background traffic is of a kind (`BodyState.kind`), which
`scene.sizes` measures.
"""

from __future__ import annotations

from math import hypot

from lingjing.mission.instance import Entity, Vector
from lingjing.plugins.bodies import solid_size
from lingjing.scene.sizes import SIZES, Size
from lingjing.trace.records import CLEARED, DORMANT, BodyState


def is_gone(state: BodyState, entity: Entity | None) -> bool:
    """Whether a mirror is of what can neither be seen nor touched: not there yet, no more, or taken aboard."""
    return state.status in (DORMANT, CLEARED) or (entity is not None and entity.is_aboard(state.status))


def moved_on(position: Vector, velocity: Vector, seconds: float) -> Vector:
    """Where a body is some seconds later if it keeps its velocity."""
    x, y, z = (here + seconds * rate for here, rate in zip(position, velocity, strict=True))
    return x, y, z


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


def floats(entity: Entity) -> bool:
    """Whether an entity is afloat where there is water: a vessel, what drifts, and what stands on water."""
    return entity.engine == "vessel" or "drift_mps" in entity.properties or entity.properties.get("on") == "water"
