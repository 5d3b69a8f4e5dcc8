"""Rounds of studies: the next few seeds of every study, then of every study again; and the hours that are left."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from lingjing.bench.adversaries import USUAL_S, column_of
from lingjing.bench.countdown import Countdown
from lingjing.bench.planning import SuiteCell
from lingjing.bench.rows import SuiteRow
from lingjing.bench.running import SuiteRun
from lingjing.bench.validity.studies import Study

SECONDS_AN_HOUR = 3600.0


class Durations:
    """The seconds of an episode: the mean of its cell's rows, else of its column's at its tier, else those that the
    program declares.
    """

    def __init__(self, declared: Mapping[str, float], rows: Iterable[SuiteRow] = ()) -> None:
        self._declared = declared
        self._sums: dict[tuple[str, ...], tuple[int, float]] = {}
        for row in rows:
            self.learn(row)

    def learn(self, row: SuiteRow) -> None:
        """Add the duration of a row."""
        column = f"{row.mission}-{row.mode}", str(row.tier)
        for key in (column, (*column, row.entrant)) if row.wall_s > 0.0 else ():
            count, seconds = self._sums.get(key, (0, 0.0))
            self._sums[key] = count + 1, seconds + row.wall_s

    def of(self, cell: SuiteCell) -> float:
        """Return the seconds of an episode of the cell."""
        column = column_of(cell), str(cell.column.tier)
        count, seconds = self._sums.get((*column, cell.player.name)) or self._sums.get(column) or (0, 0.0)
        return seconds / count if count else self._declared.get(column_of(cell), USUAL_S)

    def hours(self, cells: Iterable[SuiteCell], jobs: int) -> float:
        """Return the hours of one episode of each of these cells, `jobs` at a time."""
        numbers: Counter[tuple[object, ...]] = Counter()
        known: dict[tuple[object, ...], SuiteCell] = {}
        for cell in cells:
            key = (cell.key, cell.column.tier)
            numbers[key] += 1
            known[key] = cell
        return sum(self.of(cell) * numbers[key] for key, cell in known.items()) / SECONDS_AN_HOUR / jobs


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


__all__ = ["Durations", "Rounds"]
