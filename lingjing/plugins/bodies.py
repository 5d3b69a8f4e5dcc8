"""How large things are that engines know of each other only as mirrors: length, width and height by kind, metres.

The kind of a mirror is its own (`BodyState.kind`, background traffic) or its entity's type. A type that is not listed
counts as its nearest listed ancestor; one without any has the `length`, `width` and `height` that its type or mission
gives it, and half a metre where none is given.
"""

from __future__ import annotations

from lingjing.mission.instance import Entity
from lingjing.scene.sizes import SIZES, UNKNOWN, Size
from lingjing.trace.records import BodyState


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
