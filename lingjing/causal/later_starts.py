"""Later boundaries at which the substitution of a pair may start.

An agent with a different strategy departs from its reference early, and not every departure is a mistake: substituted
from its first departure, it may lose an episode that its own strategy would win. So later boundaries are tried too.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence

LATER = 4
"""The number of later starts that are tried for a pair. Chosen."""


def runs_of(departed: Sequence[int], agreed: Sequence[int]) -> list[list[int]]:
    """Return runs of departures, that is, departures without an agreement in between, in their order."""
    runs: dict[int, list[int]] = {}
    for tick in departed:
        runs.setdefault(bisect_left(agreed, tick), []).append(tick)
    return list(runs.values())


def later_starts(departed: Sequence[int], agreed: Sequence[int]) -> list[int]:
    """Return at most `LATER` later starts, the likeliest first.

    These are the starts of runs of departures, the longest runs first; then the middle of all departures, and their
    quarters.
    """
    run_starts = [run[0] for run in sorted(runs_of(departed, agreed), key=len, reverse=True)]
    parts = [departed[len(departed) * quarter // 4] for quarter in (2, 1, 3)]
    return [tick for tick in dict.fromkeys([*run_starts, *parts]) if tick != departed[0]][:LATER]
