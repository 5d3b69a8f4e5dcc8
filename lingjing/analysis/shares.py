"""The confidence interval of a share of successes (Wilson 1927), 95 %."""

from __future__ import annotations

import math
from typing import NamedTuple

_Z = 1.959963984540054
"""The standard normal quantile at 0.975."""


class ConfidenceBounds(NamedTuple):
    """The ends of a confidence interval."""

    low: float
    high: float


def wilson(won: int, played: int) -> ConfidenceBounds:
    """Wilson's score interval of a share of successes; nan where nothing was played."""
    if not played:
        return ConfidenceBounds(math.nan, math.nan)
    share, square = won / played, _Z * _Z / played
    middle = (share + square / 2) / (1 + square)
    half = _Z * math.sqrt(share * (1 - share) / played + square / played / 4) / (1 + square)
    return ConfidenceBounds(middle - half if won else 0.0, middle + half if won < played else 1.0)
