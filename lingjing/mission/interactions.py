"""What may be done to a target, as its entity's properties say it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from lingjing.mission.expression import Flag
from lingjing.mission.instance import Entity
from lingjing.mission.model import RuleParameter, Unlock


def interactions(entity: Entity) -> Iterator[tuple[str, str, float]]:
    """(name, engine that may do it, radius in metres) of what may be done to a target."""
    for key, engine in entity.properties.items():
        name = key.removesuffix("_by")
        within = entity.properties.get(f"{name}_within_m")
        if key.endswith("_by") and isinstance(engine, str) and isinstance(within, int | float):
            yield name, engine, float(within)


def allowed_from_the_start(entities: Iterable[Entity], unlocks: Iterable[Unlock]) -> tuple[Unlock, ...]:
    """The unlocks, without a condition, of the interactions that a mission leaves to anybody at any time: those that
    none of its own `unlock` lines names for the target's group."""
    bound = {(unlock.interaction, given.domain) for unlock in unlocks for given in unlock.parameters}
    free = dict.fromkeys((name, entity.group) for entity in entities for name, _, _ in interactions(entity))
    return tuple(
        Unlock(interaction=name, parameters=(RuleParameter(name="target", domain=group),), condition=Flag(value=True))
        for name, group in free
        if (name, group) not in bound
    )
