"""The mission's own events: they occur at a time or when a condition holds, change the world, and may be undone.

After a boundary was adjudicated, each event is examined once, in the order of `Instance.events`. An event that is in
force is undone if its `until` holds. Any other event occurs at its tick, or at the first boundary at which its
condition holds. An event with a pause may occur again after the pause, which begins at its last change. No event
changes twice at one boundary, so that events which trigger each other end. A condition sees the events that were
examined before it.

The changes are in force from that boundary on. They are recorded as task events with the event's name. They belong to
the mission, not to an engine, so `emitted` in a rule never matches them, whatever an interaction is called.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from msgspec.structs import replace

from lingjing.kernel.context import RuntimeContext
from lingjing.kernel.registry import Registry
from lingjing.kernel.rules import evaluate, field_of, holds
from lingjing.mission.instance import Entity, EventSpec, Instance, StateChange, Weather
from lingjing.mission.natures import is_never_negative
from lingjing.mission.schedule import OCCURRED, UNDONE, DeclaredWorld, Layer, Occurrence, SetValue
from lingjing.mission.units import without_unit
from lingjing.mission.values import Value
from lingjing.trace.records import TaskEvent

WEATHER, APPEARED, VANISHED, CHANGED = "weather", "appeared", "vanished", "changed"
CLOSED, REOPENED, COMMS, JAMMED, JAM_ENDED = "closed", "reopened", "comms", "jammed", "jam_ended"
"""The kinds of task events for single changes.

`weather` carries the changed values. `appeared` and `vanished` list the concerned entities; an entity that is present
does not appear again. `changed` carries the new value of a state, or the new status word.
`closed`, `reopened`, `jammed` and `jam_ended` list the region, and `comms` and `jammed` carry the loss and the range.
"""

MARKS = (OCCURRED, UNDONE)
"""Kinds that are for the trace alone. Agents observe the changes."""

CHANGES = (WEATHER, APPEARED, VANISHED, CHANGED, CLOSED, REOPENED, COMMS, JAMMED, JAM_ENDED)
"""Kinds of changes that agents may observe."""

ContextAt = Callable[[Registry], RuntimeContext]
"""Returns the evaluation context of a registry at its own boundary."""


@dataclass(frozen=True, slots=True)
class _Transition:
    """An event that occurs or is undone at a boundary."""

    occurrence: Occurrence
    values: tuple[SetValue, ...]
    """The values that are set at this boundary."""


class MissionEvents:
    """The events of one instance. Holds no run-time state: that is `Registry.occurrences`."""

    def __init__(self, instance: Instance) -> None:
        self._events = instance.events
        self._tick_s = instance.clock.tick_s
        self._world = DeclaredWorld(instance)
        self._entities = {entity.id: entity for entity in instance.entities}
        self._orders = {event.name: order for order, event in enumerate(instance.events)}
        self._fixed_ticks = frozenset(event.tick for event in instance.events if event.is_fixed)
        self._all_fixed = all(event.is_fixed for event in instance.events)

    def occur(self, registry: Registry, context_at: ContextAt) -> tuple[Registry, tuple[TaskEvent, ...]]:
        """Return the registry with the events of its boundary, and what they change, in order."""
        if self._all_fixed and registry.tick not in self._fixed_ticks:
            return registry, ()
        happened: list[TaskEvent] = []
        for order, event in enumerate(self._events):
            transition = self._transition(event, registry, context_at)
            if transition is None:
                continue
            before = self._layers(registry)
            registry = _with(registry, transition.occurrence)
            happened += self._task_events(order, event, transition, before, self._layers(registry), registry.time_s)
        return registry, tuple(happened)

    def _transition(self, event: EventSpec, registry: Registry, context_at: ContextAt) -> _Transition | None:
        last = next((item for item in reversed(registry.occurrences) if item.event == event.name), None)
        if last is not None and last.undone is None and event.until is not None:
            if not holds(event.until, {}, context_at(registry)):
                return None
            restored = tuple(_restored(last, registry.occurrences))
            return _Transition(replace(last, undone=registry.tick, before=restored), restored)
        if not self._may_occur(event, last, registry, context_at):
            return None
        at = context_at(registry)
        pairs = [pair for change in event.changes if (pair := self._set_value(change, at)) is not None]
        values = tuple(value for value, _ in pairs)
        earlier = tuple(before for _, before in pairs) if event.until is not None else ()
        return _Transition(Occurrence(event.name, registry.tick, values=values, before=earlier), values)

    def _may_occur(self, event: EventSpec, last: Occurrence | None, registry: Registry, context_at: ContextAt) -> bool:
        if last is not None:
            if event.pause_s is None:
                return False
            since_s = (registry.tick - (last.tick if last.undone is None else last.undone)) * self._tick_s
            if since_s < event.pause_s - 1e-9 or since_s <= 0.0:
                return False
        if event.condition is None:
            return event.tick is not None and registry.tick >= event.tick
        return holds(event.condition, {}, context_at(registry))

    def _set_value(self, change: StateChange, at: RuntimeContext) -> tuple[SetValue, SetValue] | None:
        """Return the new and the present value of a state or status; None if one of them has no value."""
        entity = self._entities[change.entity]
        new = _as_set(change, evaluate(change.value, {}, at))
        present = _as_set(change, field_of(entity, change.field, at))
        if new is None or present is None:
            return None
        if not isinstance(new.value, str) and new.value < 0 and _is_amount(entity, change.field):
            new = replace(new, value=0.0)
        return new, present

    def _layers(self, registry: Registry) -> list[Layer]:
        """The events in force after the occurrences of a registry."""
        layers = []
        for item in registry.occurrences:
            if item.undone is None:
                order = self._orders[item.event]
                layers.append((item.tick, order, self._events[order]))
        return sorted(layers, key=lambda layer: layer[:2])

    def _task_events(
        self,
        order: int,
        event: EventSpec,
        transition: _Transition,
        before: Sequence[Layer],
        after: Sequence[Layer],
        time_s: float,
    ) -> Iterator[TaskEvent]:
        if not event.is_fixed:
            kind = OCCURRED if transition.occurrence.undone is None else UNDONE
            yield TaskEvent(kind=kind, name=event.name, entities=event.entities, time_s=time_s)
        if event.weather is not None:
            values = _changes(self._world.weather(before), self._world.weather(after))
            yield TaskEvent(kind=WEATHER, name=event.name, entities=(), time_s=time_s, values=values)
        yield from self._presences(event, before, after, time_s)
        yield from self._roads_and_radio(event, before, after, time_s)
        for value in transition.values:
            number = {} if isinstance(value.value, str) else {value.field: value.value}
            word = value.value if isinstance(value.value, str) else ""
            entities = (value.entity,)
            yield TaskEvent(kind=CHANGED, name=event.name, entities=entities, time_s=time_s, values=number, word=word)

    def _roads_and_radio(
        self, event: EventSpec, before: Sequence[Layer], after: Sequence[Layer], time_s: float
    ) -> Iterator[TaskEvent]:
        earlier, now = self._world.closed(before), self._world.closed(after)
        for kind, regions in ((CLOSED, set(now) - set(earlier)), (REOPENED, set(earlier) - set(now))):
            for region in sorted(regions):
                yield TaskEvent(kind=kind, name=event.name, entities=(region,), time_s=time_s)
        if not event.radio:
            return
        old, new = self._world.radio(before), self._world.radio(after)
        if (old.loss, old.range_m) != (new.loss, new.range_m):
            values = _radio_values(new.loss, new.range_m)
            yield TaskEvent(kind=COMMS, name=event.name, entities=(), time_s=time_s, values=values)
        for jam in event.radio:
            if jam.region:
                kind = JAMMED if len(new.jams) > len(old.jams) else JAM_ENDED
                values = _radio_values(jam.loss, jam.range_m) if kind == JAMMED else {}
                yield TaskEvent(kind=kind, name=event.name, entities=(jam.region,), time_s=time_s, values=values)

    def _presences(
        self, event: EventSpec, before: Sequence[Layer], after: Sequence[Layer], time_s: float
    ) -> Iterator[TaskEvent]:
        concerned = dict.fromkeys((*event.appear, *event.vanish))
        pairs = [(name, self._world.present(name, before), self._world.present(name, after)) for name in concerned]
        for kind, wanted in ((APPEARED, True), (VANISHED, False)):
            names = tuple(name for name, earlier, now in pairs if earlier is not wanted and now is wanted)
            if names:
                yield TaskEvent(kind=kind, name=event.name, entities=names, time_s=time_s)


def _with(registry: Registry, occurrence: Occurrence) -> Registry:
    """Return the registry with a new occurrence, or with one that was undone."""
    if occurrence.undone is None:
        return replace(registry, occurrences=(*registry.occurrences, occurrence))
    same = (occurrence.event, occurrence.tick)
    kept = tuple(occurrence if (item.event, item.tick) == same else item for item in registry.occurrences)
    return replace(registry, occurrences=kept)


def _as_set(change: StateChange, value: Value) -> SetValue | None:
    if isinstance(value, bool) or not isinstance(value, float | int | str):
        return None
    return SetValue(change.entity, change.field, value)


def _is_amount(entity: Entity, field: str) -> bool:
    return is_never_negative(without_unit(field), entity.interactions)


def _restored(ended: Occurrence, occurrences: Sequence[Occurrence]) -> Iterator[SetValue]:
    """Yield the values that an undone event sets again, except those that a later event in force has set."""
    later = {
        (value.entity, value.field)
        for item in occurrences
        if item.event != ended.event and item.tick >= ended.tick and item.undone is None
        for value in item.values
    }
    return (value for value in ended.before if (value.entity, value.field) not in later)


def _changes(before: Weather, after: Weather) -> dict[str, float]:
    fields = Weather.__struct_fields__
    return {name: getattr(after, name) for name in fields if getattr(after, name) != getattr(before, name)}


def _radio_values(loss: float | None, range_m: float | None) -> dict[str, float]:
    return {name: value for name, value in (("loss", loss), ("range_m", range_m)) if value is not None}
