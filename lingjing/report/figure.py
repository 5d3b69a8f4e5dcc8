"""The types of figures and of their parts, and the names that figures give to entrants, columns and studies."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

import msgspec

from lingjing.bench.rows import SuiteRow
from lingjing.bench.table_cells import PRIVILEGED, ResultTable
from lingjing.bench.tables import make_tables, standing_notes
from lingjing.report.drawing import Drawing
from lingjing.report.evidence import ReportEvidence, ReportStudy


class FigurePart(msgspec.Struct, frozen=True, kw_only=True):
    """Drawings that belong together, with the tables of their numbers."""

    heading: str = ""
    """The study, mission or folder that it shows; empty if the figure has one part alone."""

    drawings: tuple[Drawing, ...] = ()
    """Drawings, side by side where there is room."""

    tables: tuple[ResultTable, ...] = ()
    """Tables of the numbers in the drawings."""

    notes: tuple[str, ...] = ()
    """Notes that a reader of the drawings needs."""


class FigureKind(msgspec.Struct, frozen=True, kw_only=True):
    """A kind of figure."""

    name: str
    """Its name on the command line."""

    title: str
    """Its title on the page."""

    source: str
    """The labels of the tables and figures in the paper that it corresponds to; may be empty."""

    about: str
    """One to three sentences on reading it."""

    needs: str
    """The command that plays the episodes that it needs."""

    make: Callable[[ReportEvidence], Iterable[FigurePart]]
    """Makes its parts, none if the evidence holds no data for it."""


def called(row: SuiteRow, condition: str = "") -> str:
    """Return an entrant's name in a figure, with a mark if it had access to the truth."""
    name = f"{row.entrant} {PRIVILEGED}" if row.privileged else row.entrant
    return f"{name} ({condition})" if condition else name


def heading_of(study: ReportStudy, evidence: ReportEvidence, *words: str) -> str:
    """Return the heading of a part: the study's title, if there are several studies, and the words."""
    title = study.title or ("single traces" if len(evidence.studies) > 1 else "")
    several = len(list(evidence.played())) > 1
    return ": ".join(filter(None, (title if several else "", ", ".join(filter(None, words)))))


def column_words(mission: str, mode: str) -> str:
    """Return the name of a column, such as `SSR (broadcast)`."""
    return f"{mission.upper()} ({mode})"


def tables_of(rows: Sequence[SuiteRow], *kinds: str) -> tuple[ResultTable, ...]:
    """Return tables of `lingjing bench` without the notes that the page has once for all figures."""
    common = standing_notes(rows)
    return tuple(
        table._replace(notes=tuple(note for note in table.notes if note not in common))
        for table in make_tables(rows, kinds)
    )


__all__ = ["FigureKind", "FigurePart", "called", "column_words", "heading_of", "tables_of"]
