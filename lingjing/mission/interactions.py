"""Who may act on a target from the start."""

from __future__ import annotations

from collections.abc import Iterable

from lingjing.mission.expression import Flag
from lingjing.mission.instance import Entity
from lingjing.mission.model import RuleParameter, Unlock


def allowed_from_the_start(entities: Iterable[Entity], unlocks: Iterable[Unlock]) -> tuple[Unlock, ...]:
    """The unlocks, without a condition, of the interactions that a mission leaves to anybody at any time: those that
    none of its own `unlock` lines names for the target's group."""
    bound = {(unlock.interaction, given.domain) for unlock in unlocks for given in unlock.parameters}
    free = dict.fromkeys((one.name, entity.group) for entity in entities for one in entity.interactions)
    return tuple(
        Unlock(interaction=name, parameters=(RuleParameter(name="target", domain=group),), condition=Flag(value=True))
        for name, group in free
        if (name, group) not in bound
    )
