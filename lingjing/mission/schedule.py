"""`Schedule`: the declared weather and presence of entities at a given time, for every engine.

A declared event occurs at a decision boundary, so that its time is known from the start. Engines read the schedule and
receive no message, and all of them change at the same instant.
"""

from __future__ import annotations

from lingjing.mission.instance import Instance, Weather

_TOLERANCE_S = 1e-6
"""Tolerance of comparisons of simulated time, seconds (chosen: far below a macro-step)."""


class Schedule:
    """The events of an instance in the order of their ticks."""

    def __init__(self, instance: Instance) -> None:
        self._tick_s = instance.clock.tick_s
        self._events = sorted(instance.events, key=lambda event: event.tick)
        self._weather = instance.weather
        self._dormant = frozenset(entity.id for entity in instance.entities if entity.dormant)

    def weather(self, time_s: float) -> Weather:
        """The weather at `time_s`."""
        current = self._weather
        for event in self._events:
            if event.weather is not None and self._due(event.tick, time_s):
                current = event.weather
        return current

    def present(self, entity: str, time_s: float) -> bool:
        """True if an entity exists at `time_s`: it has appeared and has not vanished."""
        is_present = entity not in self._dormant
        for event in self._events:
            if self._due(event.tick, time_s):
                is_present = (is_present or entity in event.appear) and entity not in event.vanish
        return is_present

    def _due(self, tick: int, time_s: float) -> bool:
        return tick * self._tick_s <= time_s + _TOLERANCE_S
