"""Entries of tables: a text, the number behind it, and the marks of the best and the second best."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Literal, NamedTuple

from lingjing.analysis.shares import ConfidenceBounds

Mark = Literal["", "best", "second"]

ABSENT = "–"
UNDEFINED = "N/A"
PRIVILEGED = "†"
"""Behind the name of an entrant that was shown the truth."""
UNRESOLVED = "‡"
"""Behind the name of an entrant that has lost episodes, or tries that only its own service has aborted."""


class ResultCell(NamedTuple):
    """One entry of a table: its text, the number behind it (nan for none) and whether it is the best of its kind."""

    text: str
    value: float = math.nan
    mark: Mark = ""


class ResultLine(NamedTuple):
    """One line of a table, under a heading."""

    group: str
    label: tuple[str, ...]
    cells: tuple[ResultCell, ...]


class ResultTable(NamedTuple):
    """A table with its heads: `labels` are those of the columns before the entries."""

    kind: str
    title: str
    labels: tuple[str, ...]
    heads: tuple[str, ...]
    lines: tuple[ResultLine, ...]
    notes: tuple[str, ...] = ()


def marked(
    lines: Sequence[ResultLine], *, by_column: bool = True, lower: Sequence[int] = (), only: Sequence[int] | None = None
) -> tuple[ResultLine, ...]:
    """The lines with the best and the second best of each column marked; entrants that were shown the truth, or have
    open episodes, do not compete."""
    ranked = [
        line for line in lines if not is_out_of_competition(line.label[0]) and not is_out_of_competition(line.group)
    ]
    if len(ranked) < 2 or not by_column:
        return tuple(lines)
    marks: dict[tuple[int, int], Mark] = {}
    for column in range(len(ranked[0].cells)):
        if only is not None and column not in only:
            continue
        cells = best_of([line.cells[column] for line in ranked], lower=column in lower)
        marks |= {(id(line), column): cell.mark for line, cell in zip(ranked, cells, strict=True)}
    return tuple(
        line._replace(
            cells=tuple(cell._replace(mark=marks.get((id(line), at), "")) for at, cell in enumerate(line.cells))
        )
        for line in lines
    )


def is_out_of_competition(name: str) -> bool:
    """True for the name of an entrant whose results are never marked."""
    return name.endswith((PRIVILEGED, UNRESOLVED))


def with_cases(average: float, worst: float, best: float) -> ResultCell:
    """A share between those of the worst and the best case, as percentages; without a value that could be the best."""
    cases = f"({100 * worst:.0f}..{100 * best:.0f})"
    return ResultCell(cases if math.isnan(average) else f"{100 * average:.0f} {cases}")


def best_of(cells: Sequence[ResultCell], *, lower: bool = False, second: bool = True) -> tuple[ResultCell, ...]:
    """The cells with the best value marked and, if wanted, the second best; those that read alike are alike."""
    values = sorted({_read(cell) for cell in cells if not math.isnan(cell.value)}, reverse=not lower)
    if len(values) < 2:
        return tuple(cells)
    marks: dict[float, Mark] = {values[0]: "best"}
    if second:
        marks[values[1]] = "second"
    return tuple(cell._replace(mark=marks.get(_read(cell), "")) for cell in cells)


def _read(cell: ResultCell) -> float:
    """The value as the table shows it: two that look the same differ by less than is told."""
    try:
        return float(cell.text)
    except ValueError:
        return cell.value


def percent(share: float | None) -> ResultCell:
    """A share as a percentage, or a dash for none."""
    if share is None or math.isnan(share):
        return ResultCell(ABSENT)
    return ResultCell(f"{100 * share:.0f}", 100 * share)


def plain(value: float, spec: str) -> ResultCell:
    """A number in a format, or N/A."""
    return ResultCell(UNDEFINED) if math.isnan(value) else ResultCell(format(value, spec), value)


def measure(spec: str, factor: float = 1.0) -> Callable[[float], ResultCell]:
    """What writes a number in a format, times a factor."""
    return lambda value: plain(value * factor, spec)


def ranged(share: float, bounds: ConfidenceBounds, behind: str = "") -> ResultCell:
    """A share with its interval, if it has one, as percentages."""
    if math.isnan(share) or math.isnan(bounds.low):
        return percent(share)
    return ResultCell(f"{100 * share:.0f} [{100 * bounds.low:.0f}, {100 * bounds.high:.0f}]{behind}", 100 * share)


def probability(p: float) -> ResultCell:
    """A p value."""
    return ResultCell("< 0.001" if p < 0.001 else f"{p:.3f}", p)


def titled(title: str, what: str) -> str:
    """A title and what a table shows of it, either of which may be empty."""
    told = ": ".join(filter(None, (title, what)))
    return told[:1].upper() + told[1:]


__all__ = [
    "ABSENT", "PRIVILEGED", "UNRESOLVED", "Mark", "ResultCell", "ResultLine", "ResultTable", "best_of",
    "is_out_of_competition", "marked", "measure", "percent", "plain", "probability", "ranged", "titled", "with_cases",
]  # fmt: skip
