"""Numbers of figures with their 95 % intervals and how many episodes they are over, taken from rows of episodes.

Shares of episodes have Wilson's interval; means, medians and pooled rates are bootstrapped over episodes.
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
    """A value (nan where it is not defined), the ends of its interval, and the `number` of episodes behind it."""

    value: float
    low: float
    high: float
    number: int

    def times(self, factor: float) -> BoundedEstimate:
        """The same in other units."""
        return BoundedEstimate(self.value * factor, self.low * factor, self.high * factor, self.number)

    @property
    def known(self) -> bool:
        """Whether it is defined."""
        return not math.isnan(self.value)

    def text(self, spec: str) -> str:
        """`62 [48, 74]`, or N/A."""
        if not self.known:
            return UNDEFINED
        ends = "" if math.isnan(self.low) else f" [{self.low:{spec}}, {self.high:{spec}}]"
        return f"{self.value:{spec}}{ends}"

    def cell(self, spec: str = ".0f") -> ResultCell:
        """The entry of a table."""
        return ResultCell(self.text(spec), self.value)


MANY = 500
"""From so many episodes on the interval of a pooled rate is that of its linearisation: the bootstrap's to a tenth of a
point, in a thousandth of the time."""

_Z = 1.959963984540054
"""The standard normal quantile at 0.975."""

UNKNOWN = BoundedEstimate(math.nan, math.nan, math.nan, 0)

RowMeasure = Callable[[Sequence[SuiteRow]], BoundedEstimate]
"""What makes one number of episodes."""


def share(flags: Iterable[bool]) -> BoundedEstimate:
    """The percentage of what is true, with Wilson's interval."""
    known = list(flags)
    if not known:
        return UNKNOWN
    low, high = wilson(sum(known), len(known))
    return BoundedEstimate(sum(known) / len(known), low, high, len(known)).times(100.0)


def mean(values: Iterable[float | None]) -> BoundedEstimate:
    """The mean of what is defined."""
    known = [float(value) for value in values if value is not None and not math.isnan(value)]
    if not known:
        return UNKNOWN
    return _bounded(sum(known) / len(known), bootstrap(known), len(known))


def pooled(parts: Iterable[tuple[float, float]]) -> BoundedEstimate:
    """The sum of all first numbers over the sum of all second ones: a rate over one pool of all episodes."""
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
    """Task success rate, percent."""
    return share(row.report.success for row in rows)


def scr(rows: Sequence[SuiteRow]) -> BoundedEstimate:
    """Mean subtask completion rate, percent."""
    return mean(row.report.scr for row in rows).times(100.0)


def metric(name: str, factor: float = 1.0) -> RowMeasure:
    """What takes the mean of a metric over the episodes that have it."""
    return lambda rows: mean(getattr(one, name) for one in metrics_of(rows)).times(factor)


def weighted(name: str, weight: str, factor: float = 1.0) -> RowMeasure:
    """What pools a rate over what `weight` counts in each episode."""

    def measured(rows: Sequence[SuiteRow]) -> BoundedEstimate:
        parts = [(getattr(one, name), getattr(one, weight)) for one in metrics_of(rows)]
        return pooled((value * count, count) for value, count in parts if value is not None).times(factor)

    return measured


def unmatched(rows: Sequence[SuiteRow]) -> BoundedEstimate:
    """1 - F1 of detection over the pooled counts."""
    told = [(one.false_positives + one.misses, 2 * one.detections) for one in metrics_of(rows)]
    return pooled((wrong, right + wrong) for wrong, right in told)


def perceived(kind: Literal["missing", "hallucinating", "confusing"], factor: float = 1.0) -> RowMeasure:
    """What takes the share of all aligned frames with one or more of a kind of error."""
    return lambda rows: pooled((getattr(one, kind), one.frames) for one in _perceived(rows)).times(factor)


def location_error_m(rows: Sequence[SuiteRow]) -> BoundedEstimate:
    """The median over all matched reports of their distance from the target."""
    errors = [np.array(one.errors_m, dtype=np.float64) for one in _perceived(rows) if one.errors_m]
    if not errors:
        return UNKNOWN
    drawn = [np.median(np.concatenate([errors[at] for at in sample])) for sample in drawn_samples(len(errors))]
    return _bounded(float(np.median(np.concatenate(errors))), bounds_of(np.array(drawn)), len(errors))


def calibration(rows: Sequence[SuiteRow]) -> BoundedEstimate:
    """Expected calibration error over the confidences of all reports."""
    told = [one.confidences for one in _perceived(rows) if one.confidences]
    if not told:
        return UNKNOWN
    gaps = np.array([calibration_gaps(each) for each in told])
    counts = np.array([len(each) for each in told])
    sample = drawn_samples(len(told))
    drawn = np.abs(gaps[sample].sum(axis=1)).sum(axis=1) / counts[sample].sum(axis=1)
    return _bounded(float(np.abs(gaps.sum(axis=0)).sum() / counts.sum()), bounds_of(drawn), len(told))


def cost_factor(rows: Sequence[SuiteRow], among: Iterable[SuiteRow]) -> float:
    """Tokens of an episode over those of the same entrant's baseline `among` some rows: "relative cost divides this
    total by the designated full agent or prompt baseline"; nan where that took none."""
    return Played.of(rows).cost_factor(
        Played.of(row for row in among if row.baseline and row.entrant == rows[0].entrant)
    )


def _perceived(rows: Iterable[SuiteRow]) -> list[PerceptionCounts]:
    return [row.report.perceived for row in rows if row.report.perceived is not None]


def metrics_of(rows: Iterable[SuiteRow]) -> list[Metrics]:
    """The metrics of all that have any."""
    return [row.report.metrics for row in rows if row.report.metrics is not None]


def _bounded(value: float, bounds: ConfidenceBounds, count: int) -> BoundedEstimate:
    if count == 1:  # one episode says nothing of how others vary
        return BoundedEstimate(value, math.nan, math.nan, 1)
    return BoundedEstimate(value, bounds.low, bounds.high, count)


__all__ = [
    "UNKNOWN", "BoundedEstimate", "RowMeasure", "calibration", "cost_factor", "location_error_m", "mean", "metric",
    "metrics_of", "perceived", "pooled", "scr", "share", "tsr", "unmatched", "weighted",
]  # fmt: skip
