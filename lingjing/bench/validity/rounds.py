"""Rounds of studies: the next few seeds of every study, then of every study again; and the hours that are left."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field

from lingjing.bench.countdown import Countdown
from lingjing.bench.durations import SECONDS_AN_HOUR, Durations
from lingjing.bench.planning import SuiteCell
from lingjing.bench.rows import SuiteRow
from lingjing.bench.running import SuiteRun
from lingjing.bench.validity.studies import Study


@dataclass
class Rounds:
    """The studies, played in rounds."""

    studies: Sequence[Study]
    ends: Sequence[int]
    """The seeds of each study that are played after each round; all of a longer study's after the last."""
    durations: Durations
    jobs: int
    limit: int | None = None
    """Largest number of seeds of each study; None for all seeds."""
    hours: float | None = None
    """Hours after which no further episode begins; None for no limit."""
    tell: Callable[[SuiteRow, float], None] = field(default=lambda row, left_h: None)
    """Receives each new row, and the hours that are left."""
    is_out_of_time: bool = False
    """True after the hours have prevented an episode from beginning."""

    def counts(self) -> Iterator[int]:
        """Yield the seeds of each study that are played after each round."""
        last = max((study.size for study in self.studies), default=0)
        most = last if self.limit is None else min(last, self.limit)
        before = 0
        for end in (*(end for end in self.ends if end < last), last):
            if min(end, most) > before:
                before = min(end, most)
                yield before

    def play(self) -> Iterator[Study]:
        """Play all rounds, and yield each study after each of its rounds, so that its record can be stored."""
        deadline = time.monotonic() + (self.hours or 0.0) * SECONDS_AN_HOUR
        for study in self.studies:
            study.run.may_begin = lambda: self.hours is None or time.monotonic() < deadline
        for count in self.counts():
            for study in self.studies:
                if not study.due(count):
                    continue
                self._follow(study.run)
                study.play(count)
                yield study
                self.is_out_of_time |= study.run.is_out_of_time
                if self.is_out_of_time:
                    return

    def left(self) -> list[SuiteCell]:
        """Return the cell of each episode that is still to be played."""
        counts = list(self.counts())
        return [cell for study in self.studies for cell in study.left(counts[-1] if counts else 0)]

    def left_hours(self) -> float:
        """Return the hours of the episodes that are still to be played."""
        return self.durations.hours(self.left(), self.jobs)

    def _follow(self, run: SuiteRun) -> None:
        """Pass each new row of a run on, with the hours that are left of the whole."""

        def follow(row: SuiteRow, _: Countdown) -> None:
            self.durations.learn(row)
            self.tell(row, self.left_hours())

        run.tell = follow


__all__ = ["Rounds"]
