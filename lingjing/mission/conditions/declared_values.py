"""`DeclaredValues`: the numbers of an instance that nothing changes during the episode."""

from __future__ import annotations

from collections.abc import Sequence

from lingjing.mission.certain import Knowledge, known
from lingjing.mission.expression import Ref
from lingjing.mission.instance import Entity, Instance
from lingjing.mission.intervals import exactly
from lingjing.mission.natures import FIRE, LEAK, PEOPLE
from lingjing.mission.values import Value


class DeclaredValues(Knowledge):
    """The declared numbers. Values that depend on the run (places, events, reports, states that interactions change)
    are unknown."""

    def __init__(self, instance: Instance) -> None:
        self._settings = instance.settings
        self._set_fields = {(change.entity, change.field) for event in instance.events for change in event.changes}
        self._groups: dict[str, list[Entity]] = {}
        for entity in instance.entities:
            self._groups.setdefault(entity.group, []).append(entity)

    def name(self, ref: Ref) -> Value:
        """A setting, or the single entity of a group."""
        if ref.kind == "param":
            return known(self._settings.get(ref.name))
        members = self._groups.get(ref.name, [])
        return members[0] if len(members) == 1 else tuple(members) or None

    def field(self, value: Value, name: str) -> Value:
        """A declared number of an entity."""
        amount = self.number(value, name) if isinstance(value, Entity) else None
        return None if amount is None else exactly(amount)

    def number(self, entity: Entity, field: str) -> float | None:
        """A declared number of an entity; None for a state that may change during the episode."""
        return None if (entity.id, field) in self._set_fields else declared(entity, field)

    def members(self, domain: str) -> Sequence[Value] | None:
        """The entities of a group."""
        return self._groups.get(domain)


def declared(entity: Entity, field: str) -> float | None:
    """A declared number of an entity; None for a state that interactions or its engine may change."""
    spec = entity.state_of(field)
    return None if spec is not None and _may_change(entity, spec.name) else entity.number(field)


def _may_change(entity: Entity, state: str) -> bool:
    """True if interactions, an engine or the target's nature change a state."""
    if entity.role == "asset" or state in (FIRE.level, LEAK.level):
        return True
    flows = state == PEOPLE and any(entity.number(rate) for rate in ("arrivals_hz", "departures_hz"))
    return flows or any(state in (spec.takes, spec.gives, spec.source) for spec in entity.interactions)
