"""The structure of tables: cells with a text, a number and a mark for the best and the second best value."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Literal, NamedTuple

from lingjing.analysis.shares import ConfidenceBounds

Mark = Literal["", "best", "second"]
"""The mark of a cell."""

ABSENT = "–"
"""Shown if nothing was played."""

UNDEFINED = "N/A"
"""Shown for an undefined number."""

PRIVILEGED = "†"
"""Follows the name of an entrant that observes the ground truth."""
UNAUDITED = "§"
"""Follows the name of an entrant with rows that no audit has confirmed."""
UNRESOLVED = "‡"
"""Follows the name of an entrant with lost episodes, or with tries that only its own service has aborted."""


class ResultCell(NamedTuple):
    """One cell of a table."""

    text: str
    """The shown text."""
    value: float = math.nan
    """The number behind the text; nan if there is none."""
    mark: Mark = ""
    """The mark of the best or second best value."""


class ResultLine(NamedTuple):
    """One line of a table."""

    group: str
    """The heading above the line; empty: no heading."""
    label: tuple[str, ...]
    """Texts of the columns before the cells."""
    cells: tuple[ResultCell, ...]


class ResultTable(NamedTuple):
    """A table with its heads and notes."""

    kind: str
    """The kind of table, as in `TableKind`."""
    title: str
    labels: tuple[str, ...]
    """Heads of the columns before the cells."""
    heads: tuple[str, ...]
    """Heads of the cells."""
    lines: tuple[ResultLine, ...]
    notes: tuple[str, ...] = ()
    """Footnotes."""


def marked(
    lines: Sequence[ResultLine], *, by_column: bool = True, lower: Sequence[int] = (), only: Sequence[int] | None = None
) -> tuple[ResultLine, ...]:
    """Return the lines with the best and the second best value of each column marked.

    `lower` are columns in which less is better; `only` are the columns to mark (None: all). Privileged entrants and
    entrants with open episodes are not compared.
    """
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
    """Return whether the results of the entrant are never marked."""
    return name.endswith((PRIVILEGED, UNRESOLVED))


def with_cases(average: float, worst: float, best: float) -> ResultCell:
    """Return a share with the shares of the worst and the best case, in per cent. The cell has no value, so it is
    never the best.
    """
    cases = f"({100 * worst:.0f}..{100 * best:.0f})"
    return ResultCell(cases if math.isnan(average) else f"{100 * average:.0f} {cases}")


def best_of(cells: Sequence[ResultCell], *, lower: bool = False, second: bool = True) -> tuple[ResultCell, ...]:
    """Return the cells with the best value marked and, if wanted, the second best. Cells with equal texts are equal."""
    values = sorted({_shown_value(cell) for cell in cells if not math.isnan(cell.value)}, reverse=not lower)
    if len(values) < 2:
        return tuple(cells)
    marks: dict[float, Mark] = {values[0]: "best"}
    if second:
        marks[values[1]] = "second"
    return tuple(cell._replace(mark=marks.get(_shown_value(cell), "")) for cell in cells)


def _shown_value(cell: ResultCell) -> float:
    """Return the value as the table shows it: numbers with equal texts must not be ranked."""
    try:
        return float(cell.text)
    except ValueError:
        return cell.value


def percent(share: float | None) -> ResultCell:
    """Return a share in per cent, or a dash for None and nan."""
    if share is None or math.isnan(share):
        return ResultCell(ABSENT)
    return ResultCell(f"{100 * share:.0f}", 100 * share)


def plain(value: float, spec: str) -> ResultCell:
    """Return a number in a format, or N/A for nan."""
    return ResultCell(UNDEFINED) if math.isnan(value) else ResultCell(format(value, spec), value)


def measure(spec: str, factor: float = 1.0) -> Callable[[float], ResultCell]:
    """Return a function that formats a number after multiplication by a factor."""
    return lambda value: plain(value * factor, spec)


def ranged(share: float, bounds: ConfidenceBounds, behind: str = "") -> ResultCell:
    """Return a share in per cent with its interval, if it has one."""
    if math.isnan(share) or math.isnan(bounds.low):
        return percent(share)
    return ResultCell(f"{100 * share:.0f} [{100 * bounds.low:.0f}, {100 * bounds.high:.0f}]{behind}", 100 * share)


def probability(p: float) -> ResultCell:
    """Return a p value."""
    return ResultCell("< 0.001" if p < 0.001 else f"{p:.3f}", p)


def titled(title: str, subject: str) -> str:
    """Return a title and the subject of a table, joined; either may be empty."""
    joined = ": ".join(filter(None, (title, subject)))
    return joined[:1].upper() + joined[1:]


__all__ = [
    "ABSENT", "PRIVILEGED", "UNRESOLVED", "Mark", "ResultCell", "ResultLine", "ResultTable", "best_of",
    "is_out_of_competition", "marked", "measure", "percent", "plain", "probability", "ranged", "titled", "with_cases",
]  # fmt: skip
