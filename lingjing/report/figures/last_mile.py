"""Last-mile delivery: the chain of five stages, and the effect of interventions on it, as in the paper."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from lingjing.analysis.last_mile import STAGES
from lingjing.bench.played import grouped
from lingjing.bench.rows import SuiteRow
from lingjing.bench.table_cells import ResultCell, ResultLine, ResultTable
from lingjing.report.charts import BarGroup, ChartBar, ChartSeries, bar_chart, line_chart
from lingjing.report.estimates import metrics_of, share
from lingjing.report.evidence import ReportEvidence
from lingjing.report.figure import FigureKind, FigurePart, called, column_words, heading_of

REPORTED = (
    "S2 and S3 are read from typed reports of the route (`endpoints`, `waypoint`): a policy that sends none stays at "
    "S1, even if it delivers"
)
"""Note below tables with episodes that were won without such reports."""


def _parts(evidence: ReportEvidence) -> Iterator[FigurePart]:
    for study in evidence.played():
        for (mission, mode), rows in study.by(lambda row: (row.mission, row.mode)).items():
            series, lines, groups = list[ChartSeries](), list[ResultLine](), list[BarGroup]()
            for (_, condition), own in grouped(rows, lambda row: (row.entrant, row.condition)).items():
                done = [metrics.last_mile for metrics in metrics_of(own) if metrics.last_mile is not None]
                if not done:
                    continue
                values = tuple(share(count > stage for count in done) for stage in range(len(STAGES)))
                name = called(own[0], condition)
                series.append(ChartSeries(name, values, len(series)))
                groups.append(BarGroup(name, (ChartBar("S4", 0, values[3]),)))
                won = sum(count > 3 for count in done)
                cells = (ResultCell(str(len(done)), len(done)), *(value.cell() for value in values),
                         ResultCell(f"{won}/{len(done)}", won))  # fmt: skip
                lines.append(ResultLine("", (name,), cells))
            if not series:
                continue
            title = column_words(mission, mode)
            drawings = [
                line_chart(f"{title}: S1 to S5", STAGES, series, unit="%", most=100.0, below="up to this stage")
            ]
            if len(groups) > 1:
                drawings.append(bar_chart(f"{title}: arrival (S4)", groups, unit="%", most=100.0))
            heads = ("n", *(f"{stage} %" for stage in STAGES), "S4")
            note = (
                "S1 aerial inspection, S2 ends of the route, S3 places of the way, S4 legal-edge arrival, S5 target "
                "house; cumulative, with Wilson intervals; stages that an intervention does count as done"
            )
            notes = (note, REPORTED) if _won_unreported(rows) else (note,)
            table = ResultTable("last-mile", f"{title}: cumulative stages", ("Condition",), heads, tuple(lines), notes)
            yield FigurePart(heading=heading_of(study, evidence, title), drawings=tuple(drawings), tables=(table,))


def _won_unreported(rows: Sequence[SuiteRow]) -> bool:
    """Return True if an episode with a broken chain was won: its route was not reported."""
    return any(row.report.success and (row.report.metrics.last_mile or 0) < len(STAGES) for row in rows
               if row.report.metrics is not None and row.report.metrics.last_mile is not None)  # fmt: skip


KIND = FigureKind(
    name="last-mile",
    title="Last-mile delivery",
    source="fig:prov-case, tab:lastmile",
    about="Percent of episodes that did S1 to S5 up to each, under each intervention.",
    needs="lingjing bench lastmile --max-cost USD (or: lingjing run ld --seeds 0-9)",
    make=_parts,
)
