"""How large things are that engines know of each other only as mirrors: length, width and height by kind, metres.

The kind of a mirror is its own (`BodyState.kind`, background traffic) or its entity's type. A type that is not listed
counts as its nearest listed ancestor; one without any has the `length`, `width` and `height` that its type or mission
gives it, and half a metre where none is given.
"""

from __future__ import annotations

from dataclasses import dataclass

from lingjing.mission.instance import Entity
from lingjing.trace.records import BodyState


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
    "robot_dog": Size(0.7, 0.32, 0.4),
    "quadrotor": Size(0.9, 0.9, 0.35),
    "fixed_wing": Size(8.2, 11.0, 2.7),
    "lifeboat": Size(8.2, 2.7, 2.4),
    "person_in_water": Size(0.6, 0.5, 0.4),
}
"""Cars after the traffic simulator's defaults, the dog after Unitree's data sheet of the Go2, the rest as drawn."""

UNKNOWN = Size(0.5, 0.5, 0.5)


def size_of(kind: str, bases: tuple[str, ...] = ()) -> Size:
    """Dimensions of a kind, else of the nearest ancestor that is listed."""
    return next((SIZES[name] for name in (kind, *bases) if name in SIZES), UNKNOWN)


def entity_size(entity: Entity) -> Size:
    """Dimensions of an entity by its type and that type's ancestors."""
    return size_of(entity.type, entity.bases)


def solid_size(entity: Entity) -> Size | None:
    """Dimensions of an entity that one can bump into; None for one that is nothing to bump into.

    Every asset is a body, a stranger's too. A target is one where its type is listed: a fire or a leak is none.
    """
    if entity.role != "asset" or any(name in SIZES for name in (entity.type, *entity.bases)):
        size = entity_size(entity)
        return None if size is UNKNOWN else size
    return Size(*(_given(entity, name) for name in ("length_m", "width_m", "height_m")))


def mirror_size(state: BodyState, entity: Entity | None) -> Size | None:
    """Dimensions of a mirrored body that one can bump into: an entity, or background traffic of a listed kind."""
    return solid_size(entity) if entity is not None and not state.kind else SIZES.get(state.kind)


def _given(entity: Entity, name: str) -> float:
    value = entity.properties.get(name)
    number = float(value) if isinstance(value, int | float) and not isinstance(value, bool) else 0.0
    return number if number > 0.0 else UNKNOWN.length_m
