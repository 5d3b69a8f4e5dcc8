"""A mission's scheduled events, as task events of the boundaries at which they are due.

`weather` carries what changes of the weather, `appeared` and `vanished` whom the event brings or takes; each has the
event's name. Who is there already does not appear again. They are the mission's and no engine's: no rule reads them as
something emitted, whatever an interaction may be called.
"""

from __future__ import annotations

from collections.abc import Iterator

from lingjing.mission.instance import EventSpec, Instance, Weather
from lingjing.trace.records import TaskEvent

WEATHER, APPEARED, VANISHED = "weather", "appeared", "vanished"


class ScheduledEvents:
    """The events of one instance; holds no run-time state."""

    def __init__(self, instance: Instance) -> None:
        self._by_tick: dict[int, tuple[TaskEvent, ...]] = {}
        weather = instance.weather
        there = {entity.id for entity in instance.entities if not entity.dormant}
        for event in sorted(instance.events, key=lambda one: one.tick):
            time_s = event.tick * instance.clock.tick_s
            due = tuple(_parts(event, weather, there, time_s))
            self._by_tick[event.tick] = (*self._by_tick.get(event.tick, ()), *due)
            weather = event.weather or weather
            there = (there | set(event.appear)) - set(event.vanish)

    def at(self, tick: int) -> tuple[TaskEvent, ...]:
        """What is due at a boundary, in the order of declaration."""
        return self._by_tick.get(tick, ())


def _parts(event: EventSpec, weather: Weather, there: set[str], time_s: float) -> Iterator[TaskEvent]:
    come = tuple(one for one in event.appear if one not in there)
    gone = tuple(one for one in event.vanish if one in there or one in come)
    if event.weather is not None:
        yield TaskEvent(
            kind=WEATHER, name=event.name, entities=(), time_s=time_s, values=_changes(weather, event.weather)
        )
    if come:
        yield TaskEvent(kind=APPEARED, name=event.name, entities=come, time_s=time_s)
    if gone:
        yield TaskEvent(kind=VANISHED, name=event.name, entities=gone, time_s=time_s)


def _changes(before: Weather, after: Weather) -> dict[str, float]:
    fields = Weather.__struct_fields__
    return {name: getattr(after, name) for name in fields if getattr(after, name) != getattr(before, name)}
