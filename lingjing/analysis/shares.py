"""The 95 % confidence interval of a share of successes."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple


class ConfidenceBounds(NamedTuple):
    """The ends of a confidence interval."""

    low: float
    high: float


@lru_cache(maxsize=4096)  # the tables and figures of one report use the same few counts many times
def wilson(won: int, played: int) -> ConfidenceBounds:
    """Return the score interval of Wilson (1927) of a share, between 0 and 1; nan if `played` is 0."""
    if not played:
        return ConfidenceBounds(math.nan, math.nan)
    from scipy.stats import binomtest  # here, since loading scipy.stats takes most of a second

    interval = binomtest(won, played).proportion_ci(confidence_level=0.95, method="wilson")
    return ConfidenceBounds(float(interval.low), float(interval.high))
