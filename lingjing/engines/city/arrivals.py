"""Queues of people with seeded arrivals and departures at constant mean rates (Poisson processes).

The queue changes the state `people`, which has no unit. Without arrivals and departures that state is an ordinary
stock.
"""

from __future__ import annotations

import math

from lingjing.mission.instance import Entity
from lingjing.mission.seeding import Stream

_NEVER = math.inf


class PeopleQueue:
    """The arrivals and departures of one queue.

    The entity's properties `arrivals_hz` and `departures_hz` are mean rates, 0 by default.
    """

    def __init__(self, entity: Entity, seed: int) -> None:
        self._rates = rates(entity)
        self._streams = tuple(Stream(seed, f"city/{entity.id}/{name}") for name in ("arrivals", "departures"))
        self._next = [self._gap(which) for which in (0, 1)]

    def count_at(self, count: float, time_s: float) -> float:
        """Return the number of people after all arrivals and departures up to `time_s`, if `count` people are there
        now.

        A departure from an empty queue has no effect.
        """
        while (due := min(self._next)) <= time_s:
            which = self._next.index(due)
            count = count + 1.0 if which == 0 else max(0.0, count - 1.0)
            self._next[which] = due + self._gap(which)
        return count

    def _gap(self, which: int) -> float:
        rate = self._rates[which]
        return _NEVER if rate <= 0.0 else -math.log(1.0 - self._streams[which].unit()) / rate


def rates(entity: Entity) -> tuple[float, float]:
    """Return the mean rates of arrivals and departures, people per second."""
    return entity.number_or("arrivals_hz", 0.0), entity.number_or("departures_hz", 0.0)
