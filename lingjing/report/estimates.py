"""Estimates from rows of episodes, with 95 % intervals and the number of episodes behind them.

Shares of episodes have Wilson's interval. Means, medians and pooled rates are bootstrapped over episodes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from typing import Literal, NamedTuple

import numpy as np

from lingjing.analysis.detection import PerceptionCounts, calibration_gaps
from lingjing.analysis.metrics import Metrics
from lingjing.analysis.shares import ConfidenceBounds, wilson
from lingjing.bench.played import Played
from lingjing.bench.rows import SuiteRow
from lingjing.bench.statistics import bootstrap, bounds_of, drawn_samples
from lingjing.bench.table_cells import UNDEFINED, ResultCell


class BoundedEstimate(NamedTuple):
    """A value with its 95 % interval."""

    value: float
    """The value; nan if it is not defined."""

    low: float
    """Lower end of its interval; nan if it has none."""

    high: float
    """Upper end of its interval; nan if it has none."""

    number: int
    """Number of episodes behind it."""

    def times(self, factor: float) -> BoundedEstimate:
        """Return the same estimate in other units."""
        return BoundedEstimate(self.value * factor, self.low * factor, self.high * factor, self.number)

    @property
    def known(self) -> bool:
        """True if the value is defined."""
        return not math.isnan(self.value)

    def text(self, spec: str) -> str:
        """Return it as `62 [48, 74]`, as `62` if it has no interval, or as N/A."""
        if not self.known:
            return UNDEFINED
        ends = "" if math.isnan(self.low) else f" [{self.low:{spec}}, {self.high:{spec}}]"
        return f"{self.value:{spec}}{ends}"

    def cell(self, spec: str = ".0f") -> ResultCell:
        """Return it as the entry of a table."""
        return ResultCell(self.text(spec), self.value)


MANY = 500
"""Number of episodes above which the interval of a pooled rate is that of its linearisation. It agrees with the
bootstrap's to a tenth of a percentage point, and takes a thousandth of the time (measured)."""

_Z = 1.959963984540054
"""The standard normal quantile at 0.975."""

UNKNOWN = BoundedEstimate(math.nan, math.nan, math.nan, 0)
"""The estimate from no episode."""

RowMeasure = Callable[[Sequence[SuiteRow]], BoundedEstimate]
"""A function that estimates one number from rows of episodes."""


def share(flags: Iterable[bool]) -> BoundedEstimate:
    """Return the percentage of true flags, with Wilson's interval."""
    known = list(flags)
    if not known:
        return UNKNOWN
    low, high = wilson(sum(known), len(known))
    return BoundedEstimate(sum(known) / len(known), low, high, len(known)).times(100.0)


def mean(values: Iterable[float | None]) -> BoundedEstimate:
    """Return the mean of the defined values."""
    known = [float(value) for value in values if value is not None and not math.isnan(value)]
    if not known:
        return UNKNOWN
    return _bounded(sum(known) / len(known), bootstrap(known), len(known))


def pooled(parts: Iterable[tuple[float, float]]) -> BoundedEstimate:
    """Return the rate over one pool of all episodes: the sum of the first numbers over the sum of the second ones."""
    known = np.array([part for part in parts if part[1] > 0], dtype=np.float64).reshape(-1, 2)
    if not len(known):
        return UNKNOWN
    whole = known.sum(axis=0)
    value = float(whole[0] / whole[1])
    if len(known) > MANY:
        half = _Z * float(np.sqrt(np.square(known[:, 0] - value * known[:, 1]).sum()) / whole[1])
        return _bounded(value, ConfidenceBounds(value - half, value + half), len(known))
    drawn = known[drawn_samples(len(known))].sum(axis=1)
    return _bounded(value, bounds_of(drawn[:, 0] / drawn[:, 1]), len(known))


def tsr(rows: Sequence[SuiteRow]) -> BoundedEstimate:
    """Return the task success rate in percent."""
    return share(row.report.success for row in rows)


def scr(rows: Sequence[SuiteRow]) -> BoundedEstimate:
    """Return the mean subtask completion rate in percent."""
    return mean(row.report.scr for row in rows).times(100.0)


def metric(name: str, factor: float = 1.0) -> RowMeasure:
    """Return the measure that is the mean of a metric over the episodes that have it."""
    return lambda rows: mean(getattr(metrics, name) for metrics in metrics_of(rows)).times(factor)


def weighted(name: str, weight: str, factor: float = 1.0) -> RowMeasure:
    """Return the measure that pools a rate, weighted by the metric `weight`, which counts its cases in each episode."""

    def measured(rows: Sequence[SuiteRow]) -> BoundedEstimate:
        parts = [(getattr(metrics, name), getattr(metrics, weight)) for metrics in metrics_of(rows)]
        return pooled((value * count, count) for value, count in parts if value is not None).times(factor)

    return measured


def unmatched(rows: Sequence[SuiteRow]) -> BoundedEstimate:
    """Return 1 - F1 of detection over the pooled counts."""
    counts = [(each.false_positives + each.misses, 2 * each.detections) for each in metrics_of(rows)]
    return pooled((wrong, right + wrong) for wrong, right in counts)


def perceived(kind: Literal["missing", "hallucinating", "confusing"], factor: float = 1.0) -> RowMeasure:
    """Return the measure that is the share of all aligned frames with at least one error of a kind."""
    return lambda rows: pooled((getattr(counts, kind), counts.frames) for counts in _perceived(rows)).times(factor)


def location_error_m(rows: Sequence[SuiteRow]) -> BoundedEstimate:
    """Return the median distance in metres between matched reports and their targets."""
    errors = [np.array(counts.errors_m, dtype=np.float64) for counts in _perceived(rows) if counts.errors_m]
    if not errors:
        return UNKNOWN
    drawn = [np.median(np.concatenate([errors[at] for at in sample])) for sample in drawn_samples(len(errors))]
    return _bounded(float(np.median(np.concatenate(errors))), bounds_of(np.array(drawn)), len(errors))


def calibration(rows: Sequence[SuiteRow]) -> BoundedEstimate:
    """Return the expected calibration error (0 to 1) over the confidences of all reports."""
    confidences = [counts.confidences for counts in _perceived(rows) if counts.confidences]
    if not confidences:
        return UNKNOWN
    gaps = np.array([calibration_gaps(each) for each in confidences])
    counts = np.array([len(each) for each in confidences])
    sample = drawn_samples(len(confidences))
    drawn = np.abs(gaps[sample].sum(axis=1)).sum(axis=1) / counts[sample].sum(axis=1)
    return _bounded(float(np.abs(gaps.sum(axis=0)).sum() / counts.sum()), bounds_of(drawn), len(confidences))


def cost_factor(rows: Sequence[SuiteRow], among: Iterable[SuiteRow]) -> float:
    """Return the tokens of an episode over those of the same entrant's baseline in `among`.

    The paper: "relative cost divides this total by the designated full agent or prompt baseline". It is nan if the
    baseline took no tokens.
    """
    return Played.of(rows).cost_factor(
        Played.of(row for row in among if row.baseline and row.entrant == rows[0].entrant)
    )


def _perceived(rows: Iterable[SuiteRow]) -> list[PerceptionCounts]:
    return [row.report.perceived for row in rows if row.report.perceived is not None]


def metrics_of(rows: Iterable[SuiteRow]) -> list[Metrics]:
    """Return the metrics of the rows that have them."""
    return [row.report.metrics for row in rows if row.report.metrics is not None]


def _bounded(value: float, bounds: ConfidenceBounds, count: int) -> BoundedEstimate:
    if count == 1:  # one episode does not show how episodes vary
        return BoundedEstimate(value, math.nan, math.nan, 1)
    return BoundedEstimate(value, bounds.low, bounds.high, count)


__all__ = [
    "UNKNOWN", "BoundedEstimate", "RowMeasure", "calibration", "cost_factor", "location_error_m", "mean", "metric",
    "metrics_of", "perceived", "pooled", "scr", "share", "tsr", "unmatched", "weighted",
]  # fmt: skip
