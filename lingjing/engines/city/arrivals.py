"""A queue of people that grows and shrinks: seeded arrivals and departures at constant mean rates.

They change a state `people` without a unit. Without `arrivals` and `departures` the state is a stock like any other.
"""

from __future__ import annotations

import math

from lingjing.mission.instance import Entity
from lingjing.mission.seeding import Stream

PEOPLE = "people"
_NEVER = math.inf


class PeopleQueue:
    """Who comes and goes. `arrivals` and `departures` (Hz) of the entity are mean rates; 0 by default."""

    def __init__(self, entity: Entity, seed: int) -> None:
        self._rates = rates(entity)
        self._streams = tuple(Stream(seed, f"city/{entity.id}/{name}") for name in ("arrivals", "departures"))
        self._next = [self._gap(which) for which in (0, 1)]

    def after(self, count: float, time_s: float) -> float:
        """How many of `count` there are once all have come and gone who are due by `time_s`; nobody leaves an empty
        queue."""
        while (due := min(self._next)) <= time_s:
            which = self._next.index(due)
            count = count + 1.0 if which == 0 else max(0.0, count - 1.0)
            self._next[which] = due + self._gap(which)
        return count

    def _gap(self, which: int) -> float:
        rate = self._rates[which]
        return _NEVER if rate <= 0.0 else -math.log(1.0 - self._streams[which].unit()) / rate


def rates(entity: Entity) -> tuple[float, float]:
    """How many a second come and go on average."""
    return entity.number_or("arrivals_hz", 0.0), entity.number_or("departures_hz", 0.0)
