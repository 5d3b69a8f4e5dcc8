"""A queue of people that grows and shrinks: seeded arrivals and departures at constant mean rates."""

from __future__ import annotations

import math

from lingjing.mission.instance import Entity
from lingjing.mission.seeding import Stream

PEOPLE = "people"
_NEVER = math.inf


class Crowd:
    """The number of people in a queue. `arrivals` and `departures` (Hz) of the entity are mean rates; 0 by default."""

    def __init__(self, entity: Entity, seed: int) -> None:
        first = entity.properties.get(PEOPLE, 0.0)
        self.count = float(first) if isinstance(first, int | float) else 0.0
        self._rates = tuple(_rate(entity, name) for name in ("arrivals_hz", "departures_hz"))
        self._streams = tuple(Stream(seed, f"city/{entity.id}/{name}") for name in ("arrivals", "departures"))
        self._next = [self._gap(which) for which in (0, 1)]

    def advance(self, time_s: float) -> None:
        """Let come and go who is due by `time_s`; nobody leaves an empty queue."""
        while (due := min(self._next)) <= time_s:
            which = self._next.index(due)
            self.count = self.count + 1.0 if which == 0 else max(0.0, self.count - 1.0)
            self._next[which] = due + self._gap(which)

    def _gap(self, which: int) -> float:
        rate = self._rates[which]
        return _NEVER if rate <= 0.0 else -math.log(1.0 - self._streams[which].unit()) / rate


def _rate(entity: Entity, name: str) -> float:
    value = entity.properties.get(name, 0.0)
    return float(value) if isinstance(value, int | float) else 0.0
