"""Search signatures: coverage, speed and redundancy of searches, as in the paper's table."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence

from lingjing.bench.played import grouped
from lingjing.bench.rows import SuiteRow
from lingjing.bench.table_cells import ResultCell, ResultLine, ResultTable, marked
from lingjing.report.charts import BarGroup, ChartBar, bar_chart
from lingjing.report.estimates import RowMeasure, metric, metrics_of
from lingjing.report.evidence import ReportEvidence
from lingjing.report.figure import FigureKind, FigurePart, called, column_words, heading_of

SIGNATURES: tuple[tuple[str, RowMeasure, str, float | None, bool], ...] = (
    ("search coverage, %", metric("coverage", 100.0), ".0f", 100.0, False),
    ("first discovery, tick", metric("first_discovery_tick"), ".1f", None, True),
    ("redundant revisits, %", metric("redundant_revisits", 100.0), ".0f", 100.0, True),
    ("idle-agent fraction", metric("idle_fraction"), ".2f", 1.0, True),
    ("messages at discovery, %", metric("discovery_messages", 100.0), ".0f", 100.0, False),
)
"""Signatures: name, measure, format, end of the scale (None for the largest value), and True if lower is better."""


def _parts(evidence: ReportEvidence) -> Iterator[FigurePart]:
    for study in evidence.played():
        drawings, tables, number_of = [], [], study.numbers()
        columns = grouped(study.plain, lambda row: (row.mission, row.mode, row.condition))
        for (mission, mode, condition), rows in columns.items():
            if all(metrics.coverage is None for metrics in metrics_of(rows)):
                continue
            title = ", ".join(filter(None, (column_words(mission, mode), condition)))
            entrants = grouped(rows, lambda row: row.entrant)
            drawings.append(bar_chart(title, list(_groups(number_of, entrants)), lone=True))
            tables.append(_table(title, entrants))
        if drawings:
            yield FigurePart(heading=heading_of(study, evidence), drawings=tuple(drawings), tables=tuple(tables))


def _groups(number_of: Callable[[SuiteRow], int], entrants: Mapping[str, Sequence[SuiteRow]]) -> Iterator[BarGroup]:
    for name, measure, spec, most, _ in SIGNATURES:
        values = [(own[0], measure(own)) for own in entrants.values()]
        ends = [end for _, value in values for end in (value.value, value.high) if end == end]
        bars = tuple(ChartBar(called(row), number_of(row), value) for row, value in values)
        yield BarGroup(name, bars, spec, most if most is not None else max(ends, default=1.0))


def _table(title: str, entrants: Mapping[str, Sequence[SuiteRow]]) -> ResultTable:
    lines = []
    for own in entrants.values():
        cells = [measure(own).cell(spec) for _, measure, spec, *_ in SIGNATURES]
        lines.append(ResultLine(own[0].group, (called(own[0]),), (ResultCell(str(len(own)), len(own)), *cells)))
    heads = ("n", *(name for name, *_ in SIGNATURES))
    only = tuple(range(1, len(heads)))
    lower = [at + 1 for at, signature in enumerate(SIGNATURES) if signature[-1]]
    note = "means of episodes with 95 % intervals; first discovery is over the episodes that have one"
    return ResultTable("signatures", title, ("Entrant",), heads, marked(lines, lower=lower, only=only), (note,))


KIND = FigureKind(
    name="signatures",
    title="Search signatures",
    source="tab:viz",
    about="Coverage, speed and redundancy of the search of cells. Coverage and messages at discovery are "
    "better when higher.",
    needs="lingjing bench behaviour (or: lingjing run ssr --seeds 0-9; a mission whose agents observe cells)",
    make=_parts,
)
