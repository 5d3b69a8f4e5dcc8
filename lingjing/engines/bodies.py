"""Presence, size and shape of bodies that an engine receives as mirrors.

Entities declare their dimensions (`lingjing.plugins.bodies`). Background traffic has a kind (`BodyState.kind`), and
`scene.sizes` holds the dimensions of each kind.
"""

from __future__ import annotations

from math import hypot
from typing import TYPE_CHECKING

from lingjing.mission.instance import Entity, Vector
from lingjing.mission.vocabulary import CLEARED, DORMANT
from lingjing.plugins.bodies import solid_size
from lingjing.scene.sizes import SIZES, Size
from lingjing.trace.records import BodyState

if TYPE_CHECKING:
    from lingjing.plugins.engine import EngineSpec


def is_absent(state: BodyState, entity: Entity | None) -> bool:
    """Return whether a mirrored body can neither be seen nor touched: dormant, cleared or taken aboard."""
    return state.status in (DORMANT, CLEARED) or (entity is not None and entity.is_aboard(state.status))


def extrapolate(position: Vector, velocity: Vector, seconds: float) -> Vector:
    """Return the position of a body after `seconds` at constant velocity."""
    x, y, z = (here + seconds * rate for here, rate in zip(position, velocity, strict=True))
    return x, y, z


def mirror_size(state: BodyState, entity: Entity | None) -> Size | None:
    """Return the dimensions of a solid mirrored body: an entity or background traffic. None if it is not solid."""
    return solid_size(entity) if entity is not None and not state.kind else SIZES.get(state.kind)


def shape_of(entity: Entity | None) -> str:
    """Return the shape that fills the box of a body's dimensions: `box`, `cylinder`, `sphere` or `cone`."""
    return "box" if entity is None else str(entity.properties.get("shape", "box"))


def is_inside_shape(shape: str, ahead: float, abeam: float, up: float) -> bool:
    """Return whether a point lies inside a shape that fills the box from -1 to 1 along each axis."""
    if max(abs(ahead), abs(abeam), abs(up)) >= 1.0:
        return False
    if shape == "sphere":
        return hypot(ahead, abeam, up) < 1.0
    if shape == "cylinder":
        return hypot(ahead, abeam) < 1.0
    return shape != "cone" or 2.0 * hypot(ahead, abeam) < 1.0 - up


def is_afloat(entity: Entity) -> bool:
    """Return whether an entity floats where there is water: a vessel, a drifting body, or a body declared on water."""
    return entity.engine == "vessel" or "drift_mps" in entity.properties or entity.properties.get("on") == "water"


def is_coarse(spec: EngineSpec) -> bool:
    """Return whether the option `motion` of an engine is `coarse`. Raises `UsageError` for a faulty option."""
    if not spec.instance.engine_options.get(spec.engine):
        return False  # the usual case does not load pydantic
    from lingjing.engines.motion_options import MotionOptions
    from lingjing.plugins.options import engine_options

    return engine_options(MotionOptions, spec).motion == "coarse"
