"""The visibility of events: the one place that decides which agent observes which event.

`docs/kernel.md` has the table with the paper's lines. Only agents that observe `events` receive any. The rules:

- An adjudicated event is visible if its rule reads nothing hidden and no message. A verdict on a report is for the
  trace alone.
- The event of an interaction is visible as its type declares (`told = all`, `actor` or `none`). Without a declaration
  it is visible to none if a hidden value decides it (`lingjing.mission.conditions.taint`), and to all agents otherwise.
- The state that such an interaction changes follows its event: an event that an agent may not see must not show in the
  target's status, stock or place or in the actor's stock either (`EventVisibility.withheld`). Where a hidden value
  decides the moved amount, both stocks are withheld from every agent.
- Another engine event that involves an entity with a hidden position, such as a collision, is visible to the agents
  that control a body in it.
- What the mission's events change is visible to all agents: the weather, and an entity that appears, vanishes or is
  set if the position of a concerned entity is public. The marks `occurred` and `undone` are for the trace alone.

A visible event names no entity with a hidden position. Event numbers count only the agent's own visible events.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from lingjing.kernel.mission_events import MARKS
from lingjing.mission.conditions.survey import survey_instance
from lingjing.mission.conditions.taint import PLACE, carried_fields, changed_fields, moved_fields
from lingjing.mission.instance import AgentSpec, Entity, Instance, InteractionSpec
from lingjing.trace.records import AdjudicatedEvent, EventView, TaskEvent

ALL, ACTOR, NONE = "all", "actor", "none"
"""The audience of an event: every agent that observes events, those that command a body in it, or no agent."""

MOTION = frozenset({"velocity", "heading_deg"})
"""Fields that show a change of the place."""


class EventVisibility:
    """The event filter of one instance. Its answers depend on the instance alone."""

    def __init__(self, instance: Instance) -> None:
        self._entities = {entity.id: entity for entity in instance.entities}
        self._unplaced = frozenset(entity.id for entity in instance.entities if "position" in entity.hidden)
        survey = survey_instance(instance, shown=True)
        self._open, self._declarations = survey.open_events, survey.declarations
        self._withheld: dict[tuple[str, str], frozenset[str]] = {}  # called for each body in each observation
        self._secretive = tuple(
            (target, interaction, frozenset(actor.id for actor in instance.actors(interaction)))
            for target in instance.entities
            for interaction in target.interactions
            if self._is_secret(interaction.name, target.group) or self._hides_amount(interaction.name, target.group)
        )

    def visible_events(
        self, agent: AgentSpec, task_events: Sequence[TaskEvent], adjudicated: Sequence[AdjudicatedEvent], tick: int
    ) -> tuple[EventView, ...]:
        """Return the agent's visible events: those of this boundary `tick`, then the adjudicated events of the boundary
        before.
        """
        acted = [(event.kind, event.entities) for event in task_events if self._is_visible(agent, event)]
        judged = [event for event in adjudicated if event.kind in self._open]
        return (
            *(self._view(f"t{tick}-{number}", tick, *event) for number, event in enumerate(acted, 1)),
            *(
                self._view(f"e{event.tick}-{number}", event.tick, event.kind, event.bindings)
                for number, event in enumerate(judged, 1)
            ),
        )

    def withheld(self, agent: AgentSpec, entity: Entity) -> frozenset[str]:
        """Return the fields of an entity that would show an interaction with an event that the agent may not see: those
        of its motion, `status`, and the names of the states that the interaction changes.
        """
        known = self._withheld.get((agent.id, entity.id))
        if known is None:
            known = self._withheld[agent.id, entity.id] = self._secret_fields(agent, entity)
        return known

    def _secret_fields(self, agent: AgentSpec, entity: Entity) -> frozenset[str]:
        fields: set[str] = set()
        for target, interaction, actors in self._secretive:
            audience = self._audience_of(interaction, target)
            if target.id == entity.id or entity.id in actors:
                fields |= self._secret_amounts(interaction, target, entity)
            if audience == ALL or (audience == ACTOR and not actors.isdisjoint(agent.commands)):
                continue
            if target.id == entity.id:
                fields |= set(changed_fields(self._declarations.groups[target.group], interaction))
            elif entity.id in actors:
                carried = carried_fields(self._declarations, interaction)
                fields |= {field for group, field in carried if group.name == entity.group}
        names = {spec.field: spec.name for spec in entity.state}
        return frozenset(names.get(field, field) for field in fields) | (MOTION if PLACE in fields else frozenset())

    def _secret_amounts(self, interaction: InteractionSpec, target: Entity, entity: Entity) -> set[str]:
        if not self._hides_amount(interaction.name, target.group):
            return set()
        moved = moved_fields(self._declarations, self._declarations.groups[target.group], interaction)
        return {field for group, field in moved if group.name == entity.group}

    def _is_visible(self, agent: AgentSpec, event: TaskEvent) -> bool:
        audience = self._audience(event)
        return audience == ALL or (audience == ACTOR and not set(agent.commands).isdisjoint(event.entities))

    def _audience(self, event: TaskEvent) -> str:
        if event.name and event.kind in MARKS:
            return NONE
        if event.name:
            return NONE if event.entities and self._unplaced.issuperset(event.entities) else ALL
        entities = [self._entities[name] for name in event.entities if name in self._entities]
        for entity in entities:
            for interaction in entity.interactions:
                if interaction.name == event.kind:
                    return self._audience_of(interaction, entity)
        return ACTOR if any(entity.id in self._unplaced for entity in entities) else ALL

    def _audience_of(self, interaction: InteractionSpec, target: Entity) -> str:
        return interaction.told or (NONE if self._is_secret(interaction.name, target.group) else ALL)

    def _is_secret(self, interaction: str, group: str) -> bool:
        """Return whether a hidden value decides an interaction with targets of a group."""
        return (interaction, group) in self._declarations.taint.interactions

    def _hides_amount(self, interaction: str, group: str) -> bool:
        return (interaction, group) in self._declarations.taint.amounts

    def _view(self, name: str, tick: int, kind: str, entities: Iterable[str]) -> EventView:
        named = tuple(entity for entity in entities if entity not in self._unplaced)
        return EventView(id=name, kind=kind, tick=tick, entities=named)


__all__ = ["ACTOR", "ALL", "NONE", "EventVisibility"]
