"""What the counted episodes of a cell amount to: rates, means, medians, pooled counts."""

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
ThingT = TypeVar("ThingT")

_PAPERS_ORDER = ("vdn", "bi", "ld", "idf", "upr", "ufr", "cr", "ssr", "cd")
_MODE_ORDER = ("single", "star", "broadcast")


@dataclass(frozen=True, slots=True)
class Played:
    """The counted episodes of one cell, or of several that are taken together. What is not defined is nan.

    `lost` is the number of episodes without a result. `doubtful_wins` is the number of successes that followed a try
    which only the entrant's own service has aborted.
    """

    episodes: tuple[EpisodeReport, ...]
    lost: int = 0
    doubtful_wins: int = 0

    @classmethod
    def of(cls, rows: Iterable[SuiteRow]) -> Played:
        """Those of rows of a suite: counted ones, and open ones (`lingjing.bench.unresolved`)."""
        listed = list(rows)
        counted = [row for row in listed if row.standing == "counted"]
        again = {(row.cell, row.seed) for row in listed if row.standing == "aborted"}
        doubtful = sum(row.report.success and (row.cell, row.seed) in again for row in counted)
        lost = sum(row.standing == "lost" for row in listed)
        return cls(tuple(row.report for row in counted), lost, doubtful)

    @property
    def is_open(self) -> bool:
        """True if the worst and the best case differ."""
        return bool(self.lost or self.doubtful_wins)

    def cases(self) -> tuple[float, float]:
        """The share of successes in the worst and in the best case: lost episodes are failures, or wins."""
        wins, count = sum(one.success for one in self.episodes), len(self.episodes) + self.lost
        return _share(wins - self.doubtful_wins, count), _share(wins + self.lost, count)

    def won(self) -> dict[int, bool]:
        """Whether the episode of each seed was won."""
        return {episode.seed: episode.success for episode in self.episodes}

    def rate(self) -> float:
        """The share of successes."""
        return mean_of([float(episode.success) for episode in self.episodes])

    def scr(self) -> float:
        """The mean subtask completion rate."""
        return mean_of([episode.scr for episode in self.episodes])

    def metrics(self) -> list[Metrics]:
        """The metrics of all that have any."""
        return [episode.metrics for episode in self.episodes if episode.metrics is not None]

    def mean(self, name: str) -> float:
        """The mean of a metric over the episodes in which it is defined."""
        found = (getattr(one, name) for one in self.metrics())
        return mean_of([float(value) for value in found if value is not None])

    def cost_factor(self, baseline: Played) -> float:
        """Prompt and completion tokens of an episode over those of the baseline's; nan where that took none."""
        base = baseline.mean("tokens")
        return self.mean("tokens") / base if base > 0 else math.nan

    def perceived(self, kind: Literal["missing", "hallucinating", "confusing"]) -> float:
        """The share of all aligned frames with one or more of a kind of error."""
        told = self._perceived()
        return _share(sum(getattr(one, kind) for one in told), sum(one.frames for one in told))

    def location_error_m(self) -> float:
        """The median over all matched reports of their distance from the target."""
        errors = [error for one in self._perceived() for error in one.errors_m]
        return median(errors) if errors else math.nan

    def calibration_error(self) -> float:
        """Expected calibration error over the confidences of all reports."""
        error = calibration_error([said for one in self._perceived() for said in one.confidences])
        return math.nan if error is None else error

    def _perceived(self) -> list[PerceptionCounts]:
        return [episode.perceived for episode in self.episodes if episode.perceived is not None]

    def weighted(self, name: str, weight: str) -> float:
        """The mean of a share of what `weight` counts in each episode, as over one pool of all of them."""
        pairs = [(getattr(one, name), getattr(one, weight)) for one in self.metrics()]
        known = [(round(value * count), count) for value, count in pairs if value is not None]
        return _share(sum(part for part, _ in known), sum(count for _, count in known))

    def terciles(self) -> dict[str, ActionCounts]:
        """The counts of the first, second and last third of each agent's actions."""
        told = [episode.terciles for episode in self.episodes if episode.terciles]
        return {name: sum((each[at] for each in told), ActionCounts()) for at, name in enumerate(TERCILES)}

    def families(self) -> dict[FailureFamily, float]:
        """Of all lost episodes the share of each failure family; nothing where none was lost."""
        counts = Counter(episode.family for episode in self.episodes if episode.family is not None)
        return {family: counts[family] / counts.total() for family in FAMILIES if counts}

    def precision(self) -> float:
        """Detections over detections and false reports."""
        hits, false, _ = self._detected()
        return _share(hits, hits + false)

    def recall(self) -> float:
        """Detections over detections and misses."""
        hits, _, missed = self._detected()
        return _share(hits, hits + missed)

    def f1(self) -> float:
        """Detection F1 over the pooled counts."""
        hits, false, missed = self._detected()
        return _share(2 * hits, 2 * hits + false + missed)

    def _detected(self) -> tuple[int, int, int]:
        """Detections, false reports and misses, all of them."""
        told = self.metrics()
        return (
            sum(one.detections for one in told),
            sum(one.false_positives for one in told),
            sum(one.misses for one in told),
        )

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


def _share(part: int, whole: int) -> float:
    return part / whole if whole else math.nan


def mean_of(values: Sequence[float]) -> float:
    """The mean; nan of nothing."""
    return sum(values) / len(values) if values else math.nan


def grouped(things: Iterable[ThingT], key: Callable[[ThingT], KeyT]) -> dict[KeyT, list[ThingT]]:
    """The things by what a function says of each, in the order in which that comes first."""
    found: dict[KeyT, list[ThingT]] = {}
    for thing in things:
        found.setdefault(key(thing), []).append(thing)
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


__all__ = ["Played", "as_listed", "columns_of", "grouped", "mean_of"]
