"""The one shape of all figures: what it is called, what it shows, what makes it, and what to run where it is absent."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import msgspec

from lingjing.bench.rows import SuiteRow
from lingjing.bench.table_cells import PRIVILEGED, ResultTable
from lingjing.bench.tables import make_tables, standing_notes
from lingjing.report.drawing import Drawing
from lingjing.report.evidence import ReportEvidence, ReportStudy


class FigurePart(msgspec.Struct, frozen=True, kw_only=True):
    """Drawings that belong together, with the tables that have their numbers. `heading` says of what, and may be empty;
    `notes` are what a reader must know of the drawings."""

    heading: str = ""
    drawings: tuple[Drawing, ...] = ()
    tables: tuple[ResultTable, ...] = ()
    notes: tuple[str, ...] = ()


class FigureKind(msgspec.Struct, frozen=True, kw_only=True):
    """A figure of the paper: `name` on the command line, `source` which one it is, `about` how it is read, `needs` the
    command that plays what it needs. `make` gives its parts, none where the evidence holds nothing of it."""

    name: str
    title: str
    source: str
    about: str
    needs: str
    make: Callable[[ReportEvidence], Iterable[FigurePart]]


def called(row: SuiteRow, condition: str = "") -> str:
    """An entrant's name in a figure, marked where it was shown the truth."""
    name = f"{row.entrant} {PRIVILEGED}" if row.privileged else row.entrant
    return f"{name} ({condition})" if condition else name


def heading_of(study: ReportStudy, evidence: ReportEvidence, *words: str) -> str:
    """What a part is of: the study, where there are several, and what else is said."""
    title = study.title or ("single traces" if len(evidence.studies) > 1 else "")
    several = len(list(evidence.played())) > 1
    return ": ".join(filter(None, (title if several else "", ", ".join(filter(None, words)))))


def column_words(mission: str, mode: str) -> str:
    """`SSR (broadcast)`."""
    return f"{mission.upper()} ({mode})"


def tables_of(rows: Sequence[SuiteRow], *kinds: str) -> tuple[ResultTable, ...]:
    """Tables of `lingjing bench` without the notes that a report says once for all figures."""
    said = standing_notes(rows)
    return tuple(
        table._replace(notes=tuple(note for note in table.notes if note not in said))
        for table in make_tables(rows, kinds)
    )


__all__ = ["FigureKind", "FigurePart", "called", "column_words", "heading_of", "tables_of"]
