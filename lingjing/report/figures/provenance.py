"""Subtask provenance: cumulative stage success, as in panel (a) of the paper's figure."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from lingjing.bench.played import Played, grouped
from lingjing.bench.rows import SuiteRow
from lingjing.bench.table_cells import ResultCell, ResultLine, ResultTable
from lingjing.report.charts import ChartSeries, line_chart
from lingjing.report.estimates import share
from lingjing.report.evidence import ReportEvidence
from lingjing.report.figure import FigureKind, FigurePart, called, column_words, heading_of


def _parts(evidence: ReportEvidence) -> Iterator[FigurePart]:
    for study in evidence.played():
        drawings, tables, number_of = [], [], study.numbers()
        for (mission, mode), rows in grouped(study.plain, lambda row: (row.mission, row.mode)).items():
            names = tuple(Played.of(rows).stages())
            if len(names) < 2:
                continue
            series, lines, notes = [], [], list[str]()
            for (_, condition), own in grouped(rows, lambda row: (row.entrant, row.condition)).items():
                done = [
                    {stage.name: stage.cumulative for stage in row.report.metrics.stages}
                    for row in own
                    if row.report.metrics is not None
                ]
                values = tuple(share(each[name] for each in done if name in each) for name in names)
                name = called(own[0], condition)
                series.append(ChartSeries(name, values, number_of(own[0])))
                cells = (ResultCell(str(len(done)), len(done)), *(value.cell() for value in values))
                lines.append(ResultLine(own[0].group, (name,), cells))
                notes += _won_otherwise(name, own)
            title = column_words(mission, mode)
            drawings.append(line_chart(title, names, series, unit="%", most=100.0, below="up to this stage"))
            tables.append(
                ResultTable("stages", f"{title}: episodes that completed all up to a stage (%)", ("Entrant",),
                            ("n", *names), tuple(lines), tuple(notes))
            )  # fmt: skip
        if drawings:
            yield FigurePart(heading=heading_of(study, evidence), drawings=tuple(drawings), tables=tuple(tables))


def _won_otherwise(name: str, rows: Sequence[SuiteRow]) -> Iterator[str]:
    """Yield a note if episodes were won without a stage that success does not require."""
    won = [row.report.metrics.stages for row in rows if row.report.success and row.report.metrics is not None]
    unfinished = [[stage.name for stage in stages if stage.done < stage.required] for stages in won]
    number = sum(map(bool, unfinished))
    if number:
        stages = ", ".join(dict.fromkeys(stage for names in unfinished for stage in names))
        yield f"{name}: {number} of {len(won)} that were won left {stages} open, which success does not require"


KIND = FigureKind(
    name="provenance",
    title="Subtask provenance",
    source="fig:subtask-provenance (a)",
    about="Percent of episodes that completed every stage up to and including the one named, with Wilson intervals. A "
    "steep step is where episodes are lost.",
    needs="lingjing bench provenance (or any run of a mission with stages: lingjing run ssr --seeds 0-9)",
    make=_parts,
)
