"""Intervals and tests for the numbers of tables: the bootstrap, McNemar's test, Holm's correction.

Everything is a function of its arguments: the bootstrap draws from a stream of its own that starts from a fixed seed.
Levels are 0.95 everywhere.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Mapping, Sequence
from statistics import fmean
from typing import NamedTuple, TypeVar

import numpy as np
import numpy.typing as npt

from lingjing.analysis.shares import ConfidenceBounds

LEVEL = 0.95
DRAWS = 2000
"""Bootstrap samples; more move the ends of an interval by less than a tenth of a point at 100 episodes."""

InstanceT = TypeVar("InstanceT", bound=Hashable)


class PairedTest(NamedTuple):
    """McNemar's test of two entrants on the same instances: how often only the one or only the other won, and p."""

    pairs: int
    only_first: int
    only_second: int
    p: float


def bootstrap(values: Sequence[float]) -> ConfidenceBounds:
    """The percentile bootstrap interval of a mean; nan of nothing, the value itself of one."""
    if not values:
        return ConfidenceBounds(math.nan, math.nan)
    drawn = np.asarray(values, dtype=np.float64)
    return bounds_of(drawn[drawn_samples(len(drawn))].mean(axis=1))


def drawn_samples(count: int) -> npt.NDArray[np.int64]:
    """The bootstrap samples of `count` things: (samples, count) of their places."""
    return _generator().integers(0, count, (DRAWS, count))


def bounds_of(values: npt.NDArray[np.float64]) -> ConfidenceBounds:
    """The interval that holds the middle of a statistic's values over samples, as far as they are numbers; nan if none
    is one."""
    if np.isnan(values).all():
        return ConfidenceBounds(math.nan, math.nan)
    return _quantiles(values)


def macro_average(columns: Mapping[tuple[str, str], Mapping[int, float]]) -> float:
    """The task-balanced mean: over modes within a mission first, then over missions; `columns` are values by
    (mission, mode) and seed."""
    missions: dict[str, list[float]] = {}
    for (mission, _), values in columns.items():
        missions.setdefault(mission, []).append(fmean(values.values()))
    return fmean(map(fmean, missions.values()))


def macro_bounds(columns: Mapping[tuple[str, str], Mapping[int, float]]) -> ConfidenceBounds:
    """The bootstrap interval of the macro average. The seeds of a mission are drawn together in all of its modes, since
    a seed is the same instance in each."""
    random = _generator()
    drawn_means = []
    for mission in dict.fromkeys(mission for mission, _ in columns):
        modes = [values for (name, _), values in columns.items() if name == mission]
        seeds = sorted({seed for values in modes for seed in values})
        table = np.array([[values.get(seed, math.nan) for seed in seeds] for values in modes])
        drawn = table[:, random.integers(0, len(seeds), (DRAWS, len(seeds)))]
        known = ~np.isnan(drawn)
        with np.errstate(invalid="ignore"):  # a draw may hold no seed that a mode has played
            means = np.where(known, drawn, 0.0).sum(axis=2) / known.sum(axis=2)
        drawn_means.append(np.nanmean(means, axis=0))
    return _quantiles(np.mean(drawn_means, axis=0))


def mcnemar(first: Mapping[InstanceT, bool], second: Mapping[InstanceT, bool]) -> PairedTest:
    """McNemar's exact test over the instances that both have played: two-sided binomial over the pairs that differ."""
    from scipy.stats import binomtest

    shared = first.keys() & second.keys()
    only_first = sum(first[seed] and not second[seed] for seed in shared)
    only_second = sum(second[seed] and not first[seed] for seed in shared)
    differing = only_first + only_second
    p = float(binomtest(only_first, differing).pvalue) if differing else 1.0
    return PairedTest(len(shared), only_first, only_second, p)


def holm(values: Sequence[float]) -> list[float]:
    """Holm's correction of p values for how many there are, in the order given."""
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
    "LEVEL", "PairedTest", "bootstrap", "bounds_of", "drawn_samples", "holm", "macro_average", "macro_bounds",
    "mcnemar",
]  # fmt: skip
