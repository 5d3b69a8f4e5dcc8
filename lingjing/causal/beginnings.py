"""From where a pair is replaced that does not repair from its first departure on.

An agent of its own ways departs from its reference early, and not everything that it does otherwise is wrong: replaced
from there, it may lose what it would have won by its own way. So later boundaries are tried too.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Sequence

LATER = 4
"""So many later beginnings of a pair are tried."""


def rows_of(departed: Sequence[int], agreed: Sequence[int]) -> list[list[int]]:
    """Departures in rows with nothing right in between, in their order."""
    rows: dict[int, list[int]] = {}
    for tick in departed:
        rows.setdefault(bisect_left(agreed, tick), []).append(tick)
    return list(rows.values())


def later_beginnings(departed: Sequence[int], agreed: Sequence[int]) -> list[int]:
    """Boundaries of later departures, likeliest first, `LATER` at most: those at which departures begin anew after
    something that was right, the longest rows of departures first; then the middle of all, and their quarters."""
    anew = [row[0] for row in sorted(rows_of(departed, agreed), key=len, reverse=True)]
    parts = [departed[len(departed) * quarter // 4] for quarter in (2, 1, 3)]
    return [tick for tick in dict.fromkeys([*anew, *parts]) if tick != departed[0]][:LATER]
