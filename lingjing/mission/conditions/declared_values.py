"""`DeclaredValues`: the numbers of an instance that nothing changes during the episode. `deadlines_s`: the deadlines
of its stages, which read these numbers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from lingjing.errors import MissionError
from lingjing.mission.certain import Knowledge, certain, known
from lingjing.mission.expression import Ref
from lingjing.mission.instance import Entity, Instance
from lingjing.mission.intervals import Bounds, exactly
from lingjing.mission.natures import FIRE, LEAK, PEOPLE
from lingjing.mission.values import Value


class DeclaredValues(Knowledge):
    """The declared numbers. Values that depend on the run (places, events, reports, states that interactions change)
    are unknown."""

    def __init__(self, instance: Instance) -> None:
        self._settings = instance.settings
        self._set_fields = {(change.entity, change.field) for event in instance.events for change in event.changes}
        self._tick_s = instance.clock.tick_s
        self._groups: dict[str, list[Entity]] = {}
        for entity in instance.entities:
            self._groups.setdefault(entity.group, []).append(entity)

    def name(self, ref: Ref) -> Value:
        """A setting, or the single entity of a group."""
        if ref.kind == "clock":
            return exactly(self._tick_s) if ref.name == "tick" else None
        if ref.kind == "param":
            return known(self._settings.get(ref.name))
        if ref.kind == "switch":
            return known(bool(self._settings.get(ref.name)))
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


def deadlines_s(instance: Instance) -> Mapping[tuple[str, str], float]:
    """The deadline of each (stage, subject) that has one, seconds; the subject of a stage without subjects is "".

    Raises `MissionError` for a subject without the number that a deadline reads.
    """
    known, deadlines = DeclaredValues(instance), dict[tuple[str, str], float]()
    for stage in instance.stages:
        if stage.deadline is None:
            continue
        members = [entity for entity in instance.entities if entity.group == stage.domain]
        for member in members if stage.variable else [None]:
            names = {stage.variable or "": member}
            time_s = certain(stage.deadline, names, known)
            subject = "" if member is None else member.id
            if not isinstance(time_s, Bounds) or not time_s.exact:
                owner = f"`{stage.name}` of `{subject}`" if subject else f"`{stage.name}`"
                message = f"the deadline of the stage {owner} reads a number that is not declared, or that changes"
                raise MissionError(message, hint="use numbers, params, and properties that nothing changes")
            deadlines[stage.name, subject] = time_s.low
    return deadlines


def _may_change(entity: Entity, state: str) -> bool:
    """True if interactions, an engine or the target's nature change a state."""
    if entity.role == "asset" or state in (FIRE.level, LEAK.level):
        return True
    flows = state == PEOPLE and any(entity.number(rate) for rate in ("arrivals_hz", "departures_hz"))
    return flows or any(state in (spec.takes, spec.gives, spec.source) for spec in entity.interactions)
