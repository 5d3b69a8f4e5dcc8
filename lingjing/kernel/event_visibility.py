"""Which events are told to whom: the one place that decides (the table with the paper's lines is in `docs/kernel.md`).

An event reaches only agents that observe `events`. Of the adjudicator's, those are told that read nothing hidden and no
message: a verdict about a report is for the trace. Of the engines', an interaction is told as its type declares
(`told = all`, `actor` or `none`); without a word everybody is told of what is done to a target that hides nothing, and
nobody of what is done to another. Anything else that involves somebody whose place is hidden, as a collision does, is
felt by whoever controls a body in it. Of the mission's own events everybody is told of the weather, and of those who
come and go by themselves only of whose place is public. A told event names no entity with a hidden place, and its
number counts what its agent was told alone.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from lingjing.mission.hidden_reads import reads, rule_reads
from lingjing.mission.instance import AgentSpec, Instance
from lingjing.trace.records import AdjudicatedEvent, EventView, TaskEvent

ALL, ACTOR, NONE = "all", "actor", "none"
"""Whoever observes events; of them who commands a body that took part; nobody."""


class EventVisibility:
    """What the agents of one instance are told of its events; holds no run-time state."""

    def __init__(self, instance: Instance) -> None:
        self._entities = {entity.id: entity for entity in instance.entities}
        self._unplaced = frozenset(entity.id for entity in instance.entities if "position" in entity.hidden)
        self._open = frozenset(_open_kinds(instance))

    def of(
        self, agent: AgentSpec, task_events: Sequence[TaskEvent], adjudicated: Sequence[AdjudicatedEvent], tick: int
    ) -> tuple[EventView, ...]:
        """The agent's share: the mission's and the engines' events of this boundary `tick`, then the adjudicator's of
        the one before."""
        acted = [(event.kind, event.entities) for event in task_events if self._tells(agent, event)]
        judged = [event for event in adjudicated if event.kind in self._open]
        return (
            *(self._view(f"t{tick}-{number}", tick, *event) for number, event in enumerate(acted, 1)),
            *(
                self._view(f"e{event.tick}-{number}", event.tick, event.kind, event.bindings)
                for number, event in enumerate(judged, 1)
            ),
        )

    def _tells(self, agent: AgentSpec, event: TaskEvent) -> bool:
        word = self._word(event)
        return word == ALL or (word == ACTOR and not set(agent.commands).isdisjoint(event.entities))

    def _word(self, event: TaskEvent) -> str:
        if event.name:
            return NONE if event.entities and self._unplaced.issuperset(event.entities) else ALL
        entities = [self._entities[name] for name in event.entities if name in self._entities]
        for entity in entities:
            for one in entity.interactions:
                if one.name == event.kind:
                    return one.told or (NONE if entity.hidden else ALL)
        return ACTOR if any(entity.id in self._unplaced for entity in entities) else ALL

    def _view(self, name: str, tick: int, kind: str, entities: Iterable[str]) -> EventView:
        named = tuple(entity for entity in entities if entity not in self._unplaced)
        return EventView(id=name, kind=kind, tick=tick, entities=named)


def _open_kinds(instance: Instance) -> Iterable[str]:
    """The rules and constraints that read nothing hidden and no message."""
    secret = {name for entity in instance.entities if entity.hidden for name in (entity.group, entity.id)}
    secret |= {region.name for region in instance.regions if region.hidden}
    secret |= {message.kind for message in instance.messages}
    secret |= {one.name for entity in instance.entities if entity.hidden for one in entity.interactions}
    rules = {rule.name: rule for rule in instance.rules}
    for rule in instance.rules:
        if not rule_reads(rule, rules, secret):
            yield rule.name
    for constraint in instance.constraints:
        if constraint.domain not in secret and not reads(constraint.condition, rules, secret):
            yield constraint.name


__all__ = ["ACTOR", "ALL", "NONE", "EventVisibility"]
