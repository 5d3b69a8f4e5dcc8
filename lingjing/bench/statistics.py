"""Intervals and tests for tables: the bootstrap, McNemar's test and Holm's correction.

All results are functions of the arguments: the bootstrap draws from its own stream with a fixed seed. All confidence
levels are 0.95.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Mapping, Sequence
from itertools import combinations
from statistics import fmean
from typing import NamedTuple, TypeVar

import numpy as np
import numpy.typing as npt

from lingjing.analysis.shares import ConfidenceBounds, wilson

LEVEL = 0.95
"""The confidence level of all intervals."""

DRAWS = 2000
"""Bootstrap samples. With more, the ends of an interval over 100 episodes move by less than 0.1 percentage points."""

DISCORDANT = 0.5
"""The share of pairs that exactly one of two entrants wins, for `smallest_difference`. Chosen: that of two independent
entrants which win half of their episodes; no independent ones differ more often."""

POWER = 0.8
"""The probability with which the smallest difference is found. The usual convention."""

InstanceT = TypeVar("InstanceT", bound=Hashable)
"""The key of an instance."""


class PairedTest(NamedTuple):
    """The result of McNemar's test of two entrants on the same instances."""

    pairs: int
    """Common instances."""
    only_first: int
    """Instances that only the first entrant won."""
    only_second: int
    """Instances that only the second entrant won."""
    p: float
    """The two-sided p value."""


def bootstrap(values: Sequence[float]) -> ConfidenceBounds:
    """Return the percentile bootstrap interval of a mean; nan without values, the value itself for one value."""
    if not values:
        return ConfidenceBounds(math.nan, math.nan)
    drawn = np.asarray(values, dtype=np.float64)
    return bounds_of(drawn[drawn_samples(len(drawn))].mean(axis=1))


def drawn_samples(count: int) -> npt.NDArray[np.int64]:
    """Return bootstrap samples of `count` items: an array (samples, count) of indices."""
    return _generator().integers(0, count, (DRAWS, count))


def bounds_of(values: npt.NDArray[np.float64]) -> ConfidenceBounds:
    """Return the central interval of a statistic's values over samples. nan values are ignored; nan if all are."""
    if np.isnan(values).all():
        return ConfidenceBounds(math.nan, math.nan)
    return _quantiles(values)


def macro_average(columns: Mapping[tuple[str, str], Mapping[int, float]]) -> float:
    """Return the task-balanced mean: over the modes of a mission first, then over missions.

    `columns` are values by (mission, mode) and seed.
    """
    missions: dict[str, list[float]] = {}
    for (mission, _), values in columns.items():
        missions.setdefault(mission, []).append(fmean(values.values()))
    return fmean(map(fmean, missions.values()))


def macro_bounds(columns: Mapping[tuple[str, str], Mapping[int, float]]) -> ConfidenceBounds:
    """Return the bootstrap interval of the macro average.

    The seeds of a mission are drawn together for all of its modes, because a seed is the same instance in each of
    them.
    """
    random = _generator()
    drawn_means = []
    for mission in dict.fromkeys(mission for mission, _ in columns):
        modes = [values for (name, _), values in columns.items() if name == mission]
        seeds = sorted({seed for values in modes for seed in values})
        table = np.array([[values.get(seed, math.nan) for seed in seeds] for values in modes])
        drawn = table[:, random.integers(0, len(seeds), (DRAWS, len(seeds)))]
        known = ~np.isnan(drawn)
        with np.errstate(invalid="ignore"):  # a sample may contain no seed of a mode
            means = np.where(known, drawn, 0.0).sum(axis=2) / known.sum(axis=2)
        drawn_means.append(np.nanmean(means, axis=0))
    return _quantiles(np.mean(drawn_means, axis=0))


def mcnemar(first: Mapping[InstanceT, bool], second: Mapping[InstanceT, bool]) -> PairedTest:
    """Return McNemar's exact test over the common instances: a two-sided binomial test over the pairs that differ."""
    from scipy.stats import binomtest

    shared = first.keys() & second.keys()
    only_first = sum(first[seed] and not second[seed] for seed in shared)
    only_second = sum(second[seed] and not first[seed] for seed in shared)
    differing = only_first + only_second
    p = float(binomtest(only_first, differing).pvalue) if differing else 1.0
    return PairedTest(len(shared), only_first, only_second, p)


def smallest_difference(pairs: int) -> float:
    """Return the smallest difference of two success rates, 0 to 1, that McNemar's exact test finds at 5 % with the
    probability `POWER` on this number of pairs, of which the share `DISCORDANT` differs; nan if there is none.
    """
    from scipy.stats import binom

    differing = np.arange(pairs + 1)
    weights = binom.pmf(differing, pairs, DISCORDANT)
    # the fewest wins of one of the two that make a two-sided p value of at most 5 %
    critical = differing - binom.ppf((1.0 - LEVEL) / 2.0, differing, 0.5) + 1.0
    for points in range(1, round(100 * DISCORDANT) + 1):
        share = 0.5 + points / 100.0 / (2.0 * DISCORDANT)
        if float((weights * binom.sf(critical - 1.0, differing, share)).sum()) >= POWER:
            return points / 100.0
    return math.nan


def trend(outcomes: Sequence[Sequence[bool]]) -> float:
    """Return the one-sided p value of a falling trend of success over ordered levels, on matched instances.

    `outcomes`: for each instance the successes at all levels, in their order. The statistic is the sum of the levels of
    all successes, as in the test of Cochran and Armitage. Its distribution is exact: under the hypothesis of no effect
    the outcomes of one instance are in any order, and instances are independent of each other. nan without instances.
    """
    if not outcomes:
        return math.nan
    counts = {0: 1.0}
    for row in outcomes:
        sums = [0.0] * (sum(range(len(row))) + 1)
        subsets = list(combinations(range(len(row)), sum(row)))
        for subset in subsets:
            sums[sum(subset)] += 1.0 / len(subsets)
        following: dict[int, float] = {}
        for total, probability in counts.items():
            for more, share in enumerate(sums):
                if share:
                    following[total + more] = following.get(total + more, 0.0) + probability * share
        counts = following
    observed = sum(level for row in outcomes for level, won in enumerate(row) if won)
    return min(1.0, math.fsum(probability for total, probability in counts.items() if total <= observed))


def difference_bounds(first: tuple[int, int], second: tuple[int, int]) -> ConfidenceBounds:
    """Return Newcombe's interval (1998, method 10) of the difference of two rates, each as (won, played).

    It treats the two as independent, so it is too wide rather than too narrow for matched instances that agree. nan
    without episodes.
    """
    if not first[1] or not second[1]:
        return ConfidenceBounds(math.nan, math.nan)
    rate, other = first[0] / first[1], second[0] / second[1]
    own, theirs = wilson(*first), wilson(*second)
    low = math.hypot(rate - own.low, theirs.high - other)
    high = math.hypot(own.high - rate, other - theirs.low)
    return ConfidenceBounds(rate - other - low, rate - other + high)


def holm(values: Sequence[float]) -> list[float]:
    """Return p values with Holm's correction for their number, in the same order."""
    corrected, highest = [0.0] * len(values), 0.0
    for rank, at in enumerate(sorted(range(len(values)), key=lambda at: values[at])):
        highest = max(highest, min(1.0, values[at] * (len(values) - rank)))
        corrected[at] = highest
    return corrected


def _quantiles(values: npt.NDArray[np.float64]) -> ConfidenceBounds:
    low, high = np.nanquantile(values, [(1 - LEVEL) / 2, (1 + LEVEL) / 2])
    return ConfidenceBounds(float(low), float(high))


def _generator() -> np.random.Generator:
    return np.random.Generator(np.random.PCG64(20240229))


__all__ = [
    "LEVEL", "PairedTest", "bootstrap", "bounds_of", "difference_bounds", "drawn_samples", "holm", "macro_average",
    "macro_bounds", "mcnemar", "smallest_difference", "trend",
]  # fmt: skip
