"""A mission's scheduled events, as task events of the boundaries at which they are due.

`weather` carries the changed weather values. `appeared` and `vanished` list the concerned entities; an entity that is
present does not appear again. Each carries the scheduled event's name. They belong to the mission, not to an engine, so
`emitted` in a rule never matches them, whatever an interaction is called.
"""

from __future__ import annotations

from collections.abc import Iterator

from lingjing.mission.instance import EventSpec, Instance, Weather
from lingjing.trace.records import TaskEvent

WEATHER, APPEARED, VANISHED = "weather", "appeared", "vanished"
"""The kinds of scheduled task events."""


class ScheduledEvents:
    """The scheduled events of one instance. Holds no run-time state."""

    def __init__(self, instance: Instance) -> None:
        self._by_tick: dict[int, tuple[TaskEvent, ...]] = {}
        weather = instance.weather
        there = {entity.id for entity in instance.entities if not entity.dormant}
        for event in sorted(instance.events, key=lambda scheduled: scheduled.tick):
            time_s = event.tick * instance.clock.tick_s
            due = tuple(_parts(event, weather, there, time_s))
            self._by_tick[event.tick] = (*self._by_tick.get(event.tick, ()), *due)
            weather = event.weather or weather
            there = (there | set(event.appear)) - set(event.vanish)

    def at(self, tick: int) -> tuple[TaskEvent, ...]:
        """Return the events that are due at a boundary, in declaration order."""
        return self._by_tick.get(tick, ())


def _parts(event: EventSpec, weather: Weather, there: set[str], time_s: float) -> Iterator[TaskEvent]:
    appeared = tuple(name for name in event.appear if name not in there)
    vanished = tuple(name for name in event.vanish if name in there or name in appeared)
    if event.weather is not None:
        yield TaskEvent(
            kind=WEATHER, name=event.name, entities=(), time_s=time_s, values=_changes(weather, event.weather)
        )
    if appeared:
        yield TaskEvent(kind=APPEARED, name=event.name, entities=appeared, time_s=time_s)
    if vanished:
        yield TaskEvent(kind=VANISHED, name=event.name, entities=vanished, time_s=time_s)


def _changes(before: Weather, after: Weather) -> dict[str, float]:
    fields = Weather.__struct_fields__
    return {name: getattr(after, name) for name in fields if getattr(after, name) != getattr(before, name)}
