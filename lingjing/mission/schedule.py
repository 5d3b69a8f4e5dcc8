"""`Schedule`: weather, presence of entities and values that events set, at a given time, for every engine.

An event changes the world at a decision boundary. The time of a *fixed* event is known from the start, so that engines
read it from the schedule and receive no message. Every other event *occurs* when the kernel says so: an `Occurrence`.
The world hands all occurrences so far to the schedule of its engines before each tick.

An event in force is a *layer* over the declared world. Layers lie in the order of their times, then in the order of
the instance's events; a later one covers an earlier one. An undone event is a layer that is taken away again, so that
the world is what it would be without it (ADR 0041).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import msgspec
from msgspec.structs import replace

from lingjing.mission.instance import EventSpec, Instance, RadioChange, Weather

_TOLERANCE_S = 1e-6
"""Tolerance of comparisons of simulated time, seconds (chosen: far below a macro-step)."""

OCCURRED, UNDONE = "occurred", "undone"
"""The kinds of task events that mark when an event with a condition occurred and when it was undone."""


class SetValue(msgspec.Struct, frozen=True):
    """The value of one state or status that an event sets."""

    entity: str
    """Id of the target."""
    field: str
    """The state by its name in rules (`demand_kg`), or `status`."""
    value: float | str
    """The number, or the status word."""


class Occurrence(msgspec.Struct, frozen=True, omit_defaults=True):
    """One time at which an event occurred."""

    event: str
    """The event's name."""
    tick: int
    """The boundary at which it occurred."""
    undone: int | None = None
    """The boundary at which it was undone; None while it is in force."""
    values: tuple[SetValue, ...] = ()
    """The values that it set."""
    before: tuple[SetValue, ...] = ()
    """The values that these replaced and that undoing sets again."""


Layer = tuple[int, int, EventSpec]
"""An event in force: the boundary at which it occurred, its place among the instance's events, and the event."""


class Radio(msgspec.Struct, frozen=True):
    """The radio at one time."""

    loss: float
    """Share of lost messages outside of jammed regions, 0..1."""
    range_m: float | None
    """Largest distance outside of jammed regions, metres; None for no limit."""
    jams: tuple[RadioChange, ...] = ()
    """The settings in jammed regions."""


class DeclaredWorld:
    """The declared world of an instance under layers of events."""

    def __init__(self, instance: Instance) -> None:
        self._weather = instance.weather
        self._radio = Radio(instance.comms.loss, instance.comms.range_m)
        self._dormant = frozenset(entity.id for entity in instance.entities if entity.dormant)

    def closed(self, layers: Iterable[Layer]) -> tuple[str, ...]:
        """The regions with closed roads under these layers, sorted."""
        regions: set[str] = set()
        for _, _, event in layers:
            regions = (regions | set(event.closes)) - set(event.reopens)
        return tuple(sorted(regions))

    def radio(self, layers: Iterable[Layer]) -> Radio:
        """The radio under these layers."""
        current = self._radio
        for change in (change for _, _, event in layers for change in event.radio):
            if change.region:
                current = replace(current, jams=(*current.jams, change))
            else:
                loss = current.loss if change.loss is None else change.loss
                range_m = current.range_m if change.range_m is None else change.range_m
                current = replace(current, loss=loss, range_m=range_m)
        return current

    def weather(self, layers: Iterable[Layer]) -> Weather:
        """The weather under these layers."""
        current = self._weather
        for _, _, event in layers:
            if event.weather is not None:
                fields = event.weather_fields or event.weather.__struct_fields__
                current = replace(current, **{name: getattr(event.weather, name) for name in fields})
        return current

    def present(self, entity: str, layers: Iterable[Layer]) -> bool:
        """True if an entity exists under these layers: it has appeared and has not vanished."""
        is_present = entity not in self._dormant
        for _, _, event in layers:
            is_present = (is_present or entity in event.appear) and entity not in event.vanish
        return is_present


class Schedule:
    """The world of an instance over time."""

    def __init__(self, instance: Instance, occurrences: Sequence[Occurrence] = ()) -> None:
        self._tick_s = instance.clock.tick_s
        self._world = DeclaredWorld(instance)
        self._events = {event.name: (order, event) for order, event in enumerate(instance.events)}
        self._fixed = [
            (event.tick, order, event)
            for order, event in self._events.values()
            if event.is_fixed and event.tick is not None
        ]
        self._occurrences: tuple[Occurrence, ...] = ()
        self._layers: list[tuple[Layer, int | None]] = []
        self.update(occurrences)

    @property
    def occurrences(self) -> tuple[Occurrence, ...]:
        """All occurrences so far, without those of fixed events."""
        return self._occurrences

    def update(self, occurrences: Sequence[Occurrence]) -> None:
        """Take over all occurrences so far. Those of fixed events are known already."""
        self._occurrences = tuple(item for item in occurrences if not self._events[item.event][1].is_fixed)
        layers: list[tuple[Layer, int | None]] = [(layer, None) for layer in self._fixed]
        layers += [((item.tick, *self._events[item.event]), item.undone) for item in self._occurrences]
        self._layers = sorted(layers, key=lambda pair: pair[0][:2])

    def weather(self, time_s: float) -> Weather:
        """The weather at `time_s`."""
        return self._world.weather(self._at(time_s))

    def present(self, entity: str, time_s: float) -> bool:
        """True if an entity exists at `time_s`: it has appeared and has not vanished."""
        return self._world.present(entity, self._at(time_s))

    def closed(self, time_s: float) -> tuple[str, ...]:
        """The regions with closed roads at `time_s`, sorted."""
        return self._world.closed(self._at(time_s))

    def radio(self, time_s: float) -> Radio:
        """The radio at `time_s`."""
        return self._world.radio(self._at(time_s))

    def values_set(self, time_s: float) -> tuple[SetValue, ...]:
        """The values that events set or restore at the boundary at `time_s`, in order; () between two boundaries."""
        tick = round(time_s / self._tick_s)
        if not self._occurrences or abs(tick * self._tick_s - time_s) > _TOLERANCE_S:
            return ()
        ended = [value for item in self._occurrences if item.undone == tick for value in item.before]
        return (*ended, *(value for item in self._occurrences if item.tick == tick for value in item.values))

    def _at(self, time_s: float) -> Iterable[Layer]:
        return (
            layer
            for layer, undone in self._layers
            if self._has_come(layer[0], time_s) and not (undone is not None and self._has_come(undone, time_s))
        )

    def _has_come(self, tick: int, time_s: float) -> bool:
        return tick * self._tick_s <= time_s + _TOLERANCE_S
