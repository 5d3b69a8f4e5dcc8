"""What a mission announces for later, as every engine reads it: the weather at a time, who is there at a time.

A declared event happens at a decision boundary, so its time is known from the start; each engine asks this schedule
instead of being told, and all of them change at the same instant.
"""

from __future__ import annotations

from lingjing.mission.instance import Instance, Weather

_TOLERANCE_S = 1e-6


class Schedule:
    """The events of an instance in the order of their ticks."""

    def __init__(self, instance: Instance) -> None:
        self._tick_s = instance.clock.tick_s
        self._events = sorted(instance.events, key=lambda event: event.tick)
        self._weather = instance.weather
        self._dormant = frozenset(entity.id for entity in instance.entities if entity.dormant)

    def weather(self, time_s: float) -> Weather:
        """The weather in force at `time_s`."""
        current = self._weather
        for event in self._events:
            if event.weather is not None and self._due(event.tick, time_s):
                current = event.weather
        return current

    def present(self, entity: str, time_s: float) -> bool:
        """Whether an entity has appeared by `time_s` and has not vanished."""
        here = entity not in self._dormant
        for event in self._events:
            if self._due(event.tick, time_s):
                here = (here or entity in event.appear) and entity not in event.vanish
        return here

    def _due(self, tick: int, time_s: float) -> bool:
        return tick * self._tick_s <= time_s + _TOLERANCE_S
