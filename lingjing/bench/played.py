"""Statistics of the counted episodes of a cell: rates, means, medians and pooled counts."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Hashable, Iterable, Sequence
from dataclasses import dataclass
from statistics import median
from typing import TYPE_CHECKING, Literal, TypeVar

from lingjing.analysis.behaviour import TERCILES, ActionCounts
from lingjing.analysis.detection import PerceptionCounts, calibration_error
from lingjing.analysis.families import FAMILIES, FailureFamily
from lingjing.analysis.metrics import Metrics
from lingjing.play.report import EpisodeReport

if TYPE_CHECKING:
    from lingjing.bench.rows import SuiteRow

KeyT = TypeVar("KeyT", bound=Hashable)
"""A key of `grouped`."""

ThingT = TypeVar("ThingT")
"""An item of `grouped`."""

_PAPERS_ORDER = ("vdn", "bi", "ld", "idf", "upr", "ufr", "cr", "ssr", "cd")
"""The order of missions in the paper's tables."""

_MODE_ORDER = ("single", "star", "broadcast")


@dataclass(frozen=True, slots=True)
class Played:
    """The counted episodes of one cell, or of several pooled cells. Undefined statistics are nan."""

    episodes: tuple[EpisodeReport, ...]
    """The reports of the counted episodes."""
    lost: int = 0
    """The number of episodes without a result."""
    doubtful_wins: int = 0
    """The number of successes after a try that only the entrant's own service has aborted."""

    @classmethod
    def of(cls, rows: Iterable[SuiteRow]) -> Played:
        """Return the counted and the open episodes (`lingjing.bench.unresolved`) of a suite's rows."""
        listed = list(rows)
        counted = [row for row in listed if row.standing == "counted"]
        again = {(row.cell, row.seed) for row in listed if row.standing == "aborted"}
        doubtful = sum(row.report.success and (row.cell, row.seed) in again for row in counted)
        without_result = {(row.cell, row.seed) for row in listed} - {(row.cell, row.seed) for row in counted}
        return cls(tuple(row.report for row in counted), len(without_result), doubtful)

    @property
    def is_open(self) -> bool:
        """True if the worst and the best case differ."""
        return bool(self.lost or self.doubtful_wins)

    def cases(self) -> tuple[float, float]:
        """Return the share of successes in the worst and in the best case: lost episodes count as failures, or as
        successes.
        """
        wins, count = sum(episode.success for episode in self.episodes), len(self.episodes) + self.lost
        return _share(wins - self.doubtful_wins, count), _share(wins + self.lost, count)

    def won(self) -> dict[int, bool]:
        """Return the success of the episode of each seed."""
        return {episode.seed: episode.success for episode in self.episodes}

    def rate(self) -> float:
        """Return the share of successes."""
        return mean_of([float(episode.success) for episode in self.episodes])

    def scr(self) -> float:
        """Return the mean subtask completion rate."""
        return mean_of([episode.scr for episode in self.episodes])

    def metrics(self) -> list[Metrics]:
        """Return the metrics of all episodes that have them."""
        return [episode.metrics for episode in self.episodes if episode.metrics is not None]

    def mean(self, name: str) -> float:
        """Return the mean of a metric over the episodes in which it is defined."""
        values = (getattr(metrics, name) for metrics in self.metrics())
        return mean_of([float(value) for value in values if value is not None])

    def cost_factor(self, baseline: Played) -> float:
        """Return tokens per episode relative to the baseline; nan if the baseline used none."""
        base = baseline.mean("tokens")
        return self.mean("tokens") / base if base > 0 else math.nan

    def perceived(self, kind: Literal["missing", "hallucinating", "confusing"]) -> float:
        """Return the share of all aligned frames with at least one error of a kind."""
        counts = self._perceived()
        return _share(sum(getattr(each, kind) for each in counts), sum(each.frames for each in counts))

    def location_error_m(self) -> float:
        """Return the median distance of matched reports from their targets, metres."""
        errors = [error for counts in self._perceived() for error in counts.errors_m]
        return median(errors) if errors else math.nan

    def calibration_error(self) -> float:
        """Return the expected calibration error over the confidences of all reports."""
        error = calibration_error([confidence for counts in self._perceived() for confidence in counts.confidences])
        return math.nan if error is None else error

    def _perceived(self) -> list[PerceptionCounts]:
        return [episode.perceived for episode in self.episodes if episode.perceived is not None]

    def weighted(self, name: str, weight: str) -> float:
        """Return the mean of a share, weighted by the count `weight` of each episode: the share over the pooled
        counts.
        """
        pairs = [(getattr(metrics, name), getattr(metrics, weight)) for metrics in self.metrics()]
        known = [(round(value * count), count) for value, count in pairs if value is not None]
        return _share(sum(part for part, _ in known), sum(count for _, count in known))

    def terciles(self) -> dict[str, ActionCounts]:
        """Return the action counts of the first, second and last third of each agent's actions."""
        counts = [episode.terciles for episode in self.episodes if episode.terciles]
        return {name: sum((each[at] for each in counts), ActionCounts()) for at, name in enumerate(TERCILES)}

    def families(self) -> dict[FailureFamily, float]:
        """Return the share of each failure family in all lost episodes; empty if none was lost."""
        counts = Counter(episode.family for episode in self.episodes if episode.family is not None)
        return {family: counts[family] / counts.total() for family in FAMILIES if counts}

    def precision(self) -> float:
        """Return detections over detections and false reports."""
        hits, false, _ = self._detected()
        return _share(hits, hits + false)

    def recall(self) -> float:
        """Return detections over detections and misses."""
        hits, _, missed = self._detected()
        return _share(hits, hits + missed)

    def f1(self) -> float:
        """Return the detection F1 over the pooled counts."""
        hits, false, missed = self._detected()
        return _share(2 * hits, 2 * hits + false + missed)

    def _detected(self) -> tuple[int, int, int]:
        """Return the sums of detections, false reports and misses."""
        listed = self.metrics()
        return (
            sum(metrics.detections for metrics in listed),
            sum(metrics.false_positives for metrics in listed),
            sum(metrics.misses for metrics in listed),
        )

    def stages(self) -> dict[str, float]:
        """Return the share of episodes that completed each stage and all stages before it, in the mission's order."""
        names = dict.fromkeys(stage.name for metrics in self.metrics() for stage in metrics.stages)
        each = [{stage.name: stage.cumulative for stage in metrics.stages} for metrics in self.metrics()]
        return {name: mean_of([float(metrics[name]) for metrics in each if name in metrics]) for name in names}

    def steps(self) -> dict[str, float]:
        """Return the cumulative stages of the mission, and those of last-mile delivery."""
        return {**self.stages(), **self.last_mile()}

    def last_mile(self) -> dict[str, float]:
        """Return the share of last-mile episodes that completed S1 to each of S1 to S5; empty for other missions."""
        done = [metrics.last_mile for metrics in self.metrics() if metrics.last_mile is not None]
        return {f"S{stage}": mean_of([float(count >= stage) for count in done]) for stage in range(1, 6) if done}


def _share(part: int, whole: int) -> float:
    return part / whole if whole else math.nan


def mean_of(values: Sequence[float]) -> float:
    """Return the mean; nan for an empty list."""
    return sum(values) / len(values) if values else math.nan


def grouped(things: Iterable[ThingT], key: Callable[[ThingT], KeyT]) -> dict[KeyT, list[ThingT]]:
    """Return items by key, in the order in which keys appear first."""
    groups: dict[KeyT, list[ThingT]] = {}
    for thing in things:
        groups.setdefault(key(thing), []).append(thing)
    return groups


def in_suite_order(rows: Iterable[SuiteRow]) -> list[SuiteRow]:
    """Return the rows in the suite's order of entrants and conditions, which is the order in tables."""
    return sorted(rows, key=lambda row: (row.entrant_place, row.condition_place))


def columns_of(rows: Iterable[SuiteRow]) -> tuple[tuple[str, str], ...]:
    """Return the (mission, mode) pairs of the rows, in the paper's order."""
    pairs = dict.fromkeys((row.mission, row.mode) for row in rows)

    def place(column: tuple[str, str]) -> tuple[int, str, int]:
        mission, mode = column
        known = _PAPERS_ORDER.index(mission) if mission in _PAPERS_ORDER else len(_PAPERS_ORDER)
        return known, mission, _MODE_ORDER.index(mode) if mode in _MODE_ORDER else 0

    return tuple(sorted(pairs, key=place))


__all__ = ["Played", "columns_of", "grouped", "in_suite_order", "mean_of"]
