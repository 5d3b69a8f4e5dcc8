"""Durations of episodes, estimated from the rows of finished ones."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping
from statistics import median

from lingjing.bench.planning import SuiteCell
from lingjing.bench.rows import SuiteRow

SECONDS_AN_HOUR = 3600.0
USUAL_S = 60.0
"""Seconds of an episode in a column without a measurement (chosen)."""


class Durations:
    """The seconds of an episode: the median of its cell's rows, else of its column's at its tier, else those that the
    program declares. A mean of three rows would be that of one episode on a busy machine.
    """

    def __init__(self, declared: Mapping[str, float], rows: Iterable[SuiteRow] = ()) -> None:
        self._declared = declared
        self._measured: defaultdict[tuple[str, ...], list[float]] = defaultdict(list)
        for row in rows:
            self.learn(row)

    def learn(self, row: SuiteRow) -> None:
        """Add the duration of a row."""
        column = f"{row.mission}-{row.mode}", str(row.tier)
        for key in (column, (*column, row.entrant)) if row.wall_s > 0.0 else ():
            self._measured[key].append(row.wall_s)

    def of(self, cell: SuiteCell) -> float:
        """Return the seconds of an episode of the cell."""
        column = cell.column_name, str(cell.column.tier)
        seconds = self._measured.get((*column, cell.player.name)) or self._measured.get(column)
        return median(seconds) if seconds else self._declared.get(cell.column_name, USUAL_S)

    def hours(self, cells: Iterable[SuiteCell], jobs: int) -> float:
        """Return the hours of one episode of each of these cells, `jobs` at a time."""
        numbers: Counter[tuple[object, ...]] = Counter()
        known: dict[tuple[object, ...], SuiteCell] = {}
        for cell in cells:
            key = (cell.key, cell.column.tier)
            numbers[key] += 1
            known[key] = cell
        return sum(self.of(cell) * numbers[key] for key, cell in known.items()) / SECONDS_AN_HOUR / jobs


__all__ = ["SECONDS_AN_HOUR", "USUAL_S", "Durations"]
