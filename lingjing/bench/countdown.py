"""Estimates of a suite's remaining time and cost, from finished episodes of the same kind.

Durations of missions differ by a factor of ten, so a mean over all kinds would be wrong until the end. A kind without
finished episodes counts with the mean of the other kinds.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Hashable, Iterable
from dataclasses import dataclass


@dataclass(slots=True)
class _Seen:
    """Sums over the finished episodes of one kind."""

    count: int = 0
    wall_s: float = 0.0
    cost_usd: float = 0.0


class Countdown:
    """A countdown of episodes by kind; `jobs` are played in parallel."""

    def __init__(self, jobs: int, kinds: Iterable[Hashable]) -> None:
        self._jobs = max(1, jobs)
        self._left = Counter(kinds)
        self._seen: dict[Hashable, _Seen] = {}

    def learn(self, kind: Hashable, wall_s: float, cost_usd: float = 0.0) -> None:
        """Add the duration (0: not measured) and cost of a finished episode of that kind."""
        if wall_s > 0.0:
            seen = self._seen.setdefault(kind, _Seen())
            seen.count += 1
            seen.wall_s += wall_s
            seen.cost_usd += cost_usd

    def done(self, kind: Hashable, wall_s: float, cost_usd: float = 0.0) -> None:
        """Add a finished episode, and remove it from the remaining ones."""
        self.learn(kind, wall_s, cost_usd)
        self._left[kind] -= 1

    @property
    def left_s(self) -> float:
        """Estimated seconds until the end; nan before the first measurement."""
        return self._rest({kind: seen.wall_s / seen.count for kind, seen in self._seen.items()}) / self._jobs

    @property
    def left_usd(self) -> float:
        """Estimated further cost in US dollars; nan before the first measurement."""
        return self._rest({kind: seen.cost_usd / seen.count for kind, seen in self._seen.items()})

    def _rest(self, means: dict[Hashable, float]) -> float:
        if not means:
            return math.nan
        usual = sum(means.values()) / len(means)
        return sum(count * means.get(kind, usual) for kind, count in self._left.items())


__all__ = ["Countdown"]
