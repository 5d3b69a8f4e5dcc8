"""How long the rest of a suite takes and what it costs: from what episodes of the same kind have taken.

Missions differ tenfold in how long they take, so a mean over all would lie until the end; a kind that has not been
played yet counts as the mean of those that have.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Hashable, Iterable
from dataclasses import dataclass


@dataclass(slots=True)
class _Seen:
    count: int = 0
    wall_s: float = 0.0
    cost_usd: float = 0.0


class Countdown:
    """Counts kinds of episodes down; `jobs` are played at a time."""

    def __init__(self, jobs: int, kinds: Iterable[Hashable]) -> None:
        self._jobs = max(1, jobs)
        self._left = Counter(kinds)
        self._seen: dict[Hashable, _Seen] = {}

    def learn(self, kind: Hashable, wall_s: float, cost_usd: float = 0.0) -> None:
        """An episode of that kind took so long (0: it was not measured) and cost so much."""
        if wall_s > 0.0:
            seen = self._seen.setdefault(kind, _Seen())
            seen.count += 1
            seen.wall_s += wall_s
            seen.cost_usd += cost_usd

    def done(self, kind: Hashable, wall_s: float, cost_usd: float = 0.0) -> None:
        """One of those to be played has been."""
        self.learn(kind, wall_s, cost_usd)
        self._left[kind] -= 1

    @property
    def left_s(self) -> float:
        """Seconds of wall clock that the rest will take; nan before anything has been measured."""
        return self._rest({kind: seen.wall_s / seen.count for kind, seen in self._seen.items()}) / self._jobs

    @property
    def left_usd(self) -> float:
        """US dollars that the rest will cost; nan before anything has been measured."""
        return self._rest({kind: seen.cost_usd / seen.count for kind, seen in self._seen.items()})

    def _rest(self, means: dict[Hashable, float]) -> float:
        if not means:
            return math.nan
        usual = sum(means.values()) / len(means)
        return sum(count * means.get(kind, usual) for kind, count in self._left.items())


__all__ = ["Countdown"]
