"""Communication modes: star and broadcast on the same instances, as in the paper's table and process figures."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from lingjing.bench.paired_tests import paired_tests
from lingjing.bench.played import grouped, in_suite_order
from lingjing.bench.rows import SuiteRow
from lingjing.bench.table_cells import ResultCell, ResultLine, ResultTable, best_of
from lingjing.report.charts import BarGroup, ChartBar, bar_chart
from lingjing.report.estimates import RowMeasure, metric, tsr, weighted
from lingjing.report.evidence import ReportEvidence
from lingjing.report.figure import FigureKind, FigurePart, called, heading_of

MODES = ("star", "broadcast")
"""The compared modes."""

MEASURES: tuple[tuple[str, str, RowMeasure, str, bool], ...] = (
    ("TSR", "success, %", tsr, ".0f", False),
    ("Msg", "messages", metric("messages"), ".1f", True),
    ("KB", "payload, kB", metric("kilobytes"), ".1f", True),
    ("Rnd", "rounds", metric("rounds"), ".1f", True),
    ("Gap", "assignment gap, %", metric("gap"), ".0f", True),
    ("Rep", "repeated targets, %", weighted("rep", "target_events", 100.0), ".0f", True),
)
"""The paper's columns: short name, name in words, measure, format, and True if lower is better."""


def _parts(evidence: ReportEvidence) -> Iterator[FigurePart]:
    for study in evidence.played():
        drawings, lines, matched = [], list[ResultLine](), list[SuiteRow]()
        cells = grouped(in_suite_order(study.plain), lambda row: (row.entrant, row.condition, row.mission))
        for (_, condition, mission), rows in cells.items():
            both = _matched(rows)
            if not both:
                continue
            matched += [row for each in both for row in each]
            seeds, name = len(both[0]), called(rows[0], condition)
            groups = [_group(words, measure, spec, both) for _, words, measure, spec, _ in MEASURES]
            drawings.append(
                bar_chart(f"{mission.upper()}, {name}: {seeds} seed{'s' * (seeds > 1)} in both modes", groups)
            )
            for short, _, measure, spec, lower in MEASURES:
                entries = best_of([measure(each).cell(spec) for each in both], lower=lower, second=False)
                lines.append(ResultLine(name, (mission.upper(), short), (ResultCell(str(seeds), seeds), *entries)))
        if drawings:
            yield FigurePart(
                heading=heading_of(study, evidence),
                drawings=tuple(drawings),
                tables=(_table(lines), *_tests(matched)),
            )


def _matched(rows: Sequence[SuiteRow]) -> tuple[list[SuiteRow], list[SuiteRow]] | None:
    """Return the rows of each mode on the seeds that were played in both; None if there is no such seed."""
    by_mode = [{row.seed: row for row in rows if row.mode == mode} for mode in MODES]
    seeds = sorted(by_mode[0].keys() & by_mode[1].keys())
    return ([by_mode[0][seed] for seed in seeds], [by_mode[1][seed] for seed in seeds]) if seeds else None


def _group(words: str, measure: RowMeasure, spec: str, both: tuple[list[SuiteRow], list[SuiteRow]]) -> BarGroup:
    values = [measure(each) for each in both]
    ends = [end for value in values for end in (value.value, value.high) if end == end]
    most = 100.0 if words.endswith("%") else max(ends, default=1.0)
    bars = tuple(ChartBar(mode, at, value) for at, (mode, value) in enumerate(zip(MODES, values, strict=True)))
    return BarGroup(words, bars, spec, most)


def _table(lines: Sequence[ResultLine]) -> ResultTable:
    note = "brackets are 95 % intervals; bold is the better mode; Rep is pooled, Gap is over the episodes that have it"
    heads = ("Matched seeds", "Star", "Broadcast")
    return ResultTable(
        "modes", "Communication modes on matched instances", ("Mission", "Metric"), heads, (*lines,), (note,)
    )


def _tests(rows: Sequence[SuiteRow]) -> Iterator[ResultTable]:
    for table in paired_tests(rows, ""):
        lines = tuple(line for line in table.lines if line.group == "Modes")
        if lines:
            yield table._replace(title="Success in the two modes, paired", lines=lines)


KIND = FigureKind(
    name="communication",
    title="Communication modes and cost",
    source="Table 4, tab:comm; fig:logistics-process (b), fig:sea-process (b)",
    about="Success and cost of star and broadcast on the same seeds. All but success are better when lower. Msg "
    "counts a broadcast once for each recipient; Gap is the undone share of tasks, Rep the share of repeated targets.",
    needs="lingjing bench modes (or: lingjing bench reference --missions ufr ssr cd --policy heuristic --limit 5)",
    make=_parts,
)
