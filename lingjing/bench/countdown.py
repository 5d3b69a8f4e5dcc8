"""How long the rest of a study takes: from how long episodes of the same kind have taken.

Missions differ tenfold in how long they take, so a mean over all would lie until the end; a kind that has not been
played yet counts as long as the mean of those that have.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Hashable, Iterable


class Countdown:
    """Counts kinds of episodes down; `jobs` are played at a time."""

    def __init__(self, jobs: int, kinds: Iterable[Hashable]) -> None:
        self._jobs = max(1, jobs)
        self._left = Counter(kinds)
        self._seen: dict[Hashable, tuple[int, float]] = {}

    def learn(self, kind: Hashable, wall_s: float) -> None:
        """An episode of that kind took so long (0: it was not measured)."""
        if wall_s > 0.0:
            count, total = self._seen.get(kind, (0, 0.0))
            self._seen[kind] = count + 1, total + wall_s

    def done(self, kind: Hashable, wall_s: float) -> None:
        """One of those to be played has been."""
        self.learn(kind, wall_s)
        self._left[kind] -= 1

    @property
    def left_s(self) -> float:
        """Seconds of wall clock that the rest will take; nan before anything has been measured."""
        if not self._seen:
            return math.nan
        means = {kind: total / count for kind, (count, total) in self._seen.items()}
        usual = sum(means.values()) / len(means)
        return sum(count * means.get(kind, usual) for kind, count in self._left.items()) / self._jobs
