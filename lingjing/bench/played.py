"""What the counted episodes of a cell amount to: rates, means, medians, pooled counts."""

from __future__ import annotations

import math
from collections.abc import Callable, Hashable, Iterable, Sequence
from dataclasses import dataclass
from statistics import median
from typing import Literal, TypeVar

from lingjing.analysis.behaviour import ActionCounts, BehaviourRates
from lingjing.analysis.detection import PerceptionCounts, calibration_error
from lingjing.analysis.metrics import Metrics
from lingjing.bench.rows import SuiteRow

KeyT = TypeVar("KeyT", bound=Hashable)

_PAPERS_ORDER = ("vdn", "bi", "ld", "idf", "upr", "ufr", "cr", "ssr", "cd")
_MODE_ORDER = ("single", "star", "broadcast")


@dataclass(frozen=True, slots=True)
class Played:
    """The counted episodes of one cell, or of several that are taken together."""

    rows: tuple[SuiteRow, ...]

    def won(self) -> dict[int, bool]:
        """Whether the episode of each seed was won."""
        return {row.seed: row.report.success for row in self.rows}

    def rate(self) -> float:
        """The share of successes; nan where nothing was played."""
        return mean_of([float(row.report.success) for row in self.rows])

    def scr(self) -> float:
        """The mean subtask completion rate."""
        return mean_of([row.report.scr for row in self.rows])

    def metrics(self) -> list[Metrics]:
        """The metrics of all that have any."""
        return [row.report.metrics for row in self.rows if row.report.metrics is not None]

    def mean(self, name: str) -> float:
        """The mean of a metric over the episodes in which it is defined."""
        found = (getattr(one, name) for one in self.metrics())
        return mean_of([float(value) for value in found if value is not None])

    def perceived(self, kind: Literal["missing", "hallucinating", "confusing"]) -> float:
        """The share of all aligned frames with one or more of a kind of error."""
        told = self._perceived()
        frames = sum(one.frames for one in told)
        return sum(getattr(one, kind) for one in told) / frames if frames else math.nan

    def location_error_m(self) -> float:
        """The median over all matched reports of their distance from the target."""
        errors = [error for one in self._perceived() for error in one.errors_m]
        return median(errors) if errors else math.nan

    def calibration_error(self) -> float:
        """Expected calibration error over the confidences of all reports."""
        error = calibration_error([said for one in self._perceived() for said in one.confidences])
        return math.nan if error is None else error

    def attention_iou(self) -> float:
        """The mean over the episodes whose attention is known."""
        return mean_of([row.attention_iou for row in self.rows if row.attention_iou is not None])

    def _perceived(self) -> list[PerceptionCounts]:
        return [row.report.perceived for row in self.rows if row.report.perceived is not None]

    def weighted(self, name: str, weight: str) -> float:
        """The mean of a rate over what `weight` counts in each episode, as over one pool of all of them."""
        pairs = [(getattr(one, name), getattr(one, weight)) for one in self.metrics()]
        known = [(float(value), float(count)) for value, count in pairs if value is not None]
        whole = sum(count for _, count in known)
        return sum(value * count for value, count in known) / whole if whole else math.nan

    def behaviour(self) -> BehaviourRates:
        """The rates of all actions, pooled."""
        return sum((third for row in self.rows for third in row.report.terciles), ActionCounts()).rates()

    def f1(self) -> float:
        """Detection F1 over the pooled counts."""
        found = [
            one for one in self.metrics() if one.f1 is not None or one.precision is not None or one.recall is not None
        ]
        hits = sum(one.detections for one in found)
        wrong = sum(one.false_positives + one.misses for one in found)
        return 2 * hits / (2 * hits + wrong) if hits + wrong else math.nan

    def stages(self) -> dict[str, float]:
        """The share of episodes that completed each stage and all before it, in the mission's order."""
        names = dict.fromkeys(stage.name for one in self.metrics() for stage in one.stages)
        each = [{stage.name: stage.cumulative for stage in one.stages} for one in self.metrics()]
        return {name: mean_of([float(one[name]) for one in each if name in one]) for name in names}

    def steps(self) -> dict[str, float]:
        """The cumulative stages of the mission, and those of last-mile delivery."""
        return {**self.stages(), **self.last_mile()}

    def last_mile(self) -> dict[str, float]:
        """The share of episodes of last-mile delivery that did S1 to S5 up to each; nothing in other missions."""
        done = [one.last_mile for one in self.metrics() if one.last_mile is not None]
        return {f"S{stage}": mean_of([float(count >= stage) for count in done]) for stage in range(1, 6) if done}


def mean_of(values: Sequence[float]) -> float:
    """The mean; nan of nothing."""
    return sum(values) / len(values) if values else math.nan


def rows_by(rows: Iterable[SuiteRow], key: Callable[[SuiteRow], KeyT]) -> dict[KeyT, list[SuiteRow]]:
    """The rows by what a function says of each, in the order in which that comes first."""
    found: dict[KeyT, list[SuiteRow]] = {}
    for row in rows:
        found.setdefault(key(row), []).append(row)
    return found


def as_listed(rows: Iterable[SuiteRow]) -> list[SuiteRow]:
    """The rows as a suite lists who played and under what, whatever the column: so entrants stand in tables."""
    return sorted(rows, key=lambda row: (row.entrant_place, row.condition_place))


def columns_of(rows: Iterable[SuiteRow]) -> tuple[tuple[str, str], ...]:
    """The (mission, mode) pairs of the rows, in the paper's order."""
    found = dict.fromkeys((row.mission, row.mode) for row in rows)

    def place(column: tuple[str, str]) -> tuple[int, str, int]:
        mission, mode = column
        known = _PAPERS_ORDER.index(mission) if mission in _PAPERS_ORDER else len(_PAPERS_ORDER)
        return known, mission, _MODE_ORDER.index(mode) if mode in _MODE_ORDER else 0

    return tuple(sorted(found, key=place))


__all__ = ["Played", "as_listed", "columns_of", "mean_of", "rows_by"]
