"""Scaling and robustness: success over parameters of a mission, as in the paper's figure.

Scaling has parameters that are numbers of assets or targets, robustness all others, such as sensing and budgets.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import msgspec

from lingjing.bench.played import grouped
from lingjing.bench.rows import SuiteRow
from lingjing.bench.table_cells import ResultCell, ResultLine, ResultTable
from lingjing.report.charts import ChartSeries, line_chart
from lingjing.report.estimates import BoundedEstimate, RowMeasure, location_error_m, metric, metrics_of, scr, share, tsr
from lingjing.report.evidence import ReportEvidence
from lingjing.report.figure import FigureKind, FigurePart, called, column_words, heading_of
from lingjing.report.swept import ParameterSweep, sweeps_of

ARRIVAL = "Arrival (S4)"
"""Title of the measure of last-mile delivery."""
_S4 = (
    "S4 is cumulative: it needs the route's ends and places as typed reports (S2, S3), which no policy but react sends"
)
_ARRIVED = 4
"""The stage at which last-mile delivery is measured: S4, the legal-edge arrival, as in the paper."""


def _scaling(evidence: ReportEvidence) -> Iterator[FigurePart]:
    yield from _parts(evidence, counts=True)


def _robustness(evidence: ReportEvidence) -> Iterator[FigurePart]:
    yield from _parts(evidence, counts=False)


def _parts(evidence: ReportEvidence, *, counts: bool) -> Iterator[FigurePart]:
    for study in evidence.played():
        for sweep in sweeps_of(study):
            if sweep.counts == counts:
                title = f"{column_words(sweep.mission, sweep.mode)} by {sweep.parameter}"
                part = _part(sweep, _measures(sweep))
                yield msgspec.structs.replace(part, heading=heading_of(study, evidence, title))


def _measures(sweep: ParameterSweep) -> list[tuple[str, str, float | None, RowMeasure]]:
    """Return the measures that are shown of a sweep: title, unit, end of the scale (None if open), function."""
    metrics = metrics_of(row for rows in sweep.points.values() for row in rows)
    measures: list[tuple[str, str, float | None, RowMeasure]] = [("Success (TSR)", "%", 100.0, tsr)]
    if any(each.last_mile is not None for each in metrics):
        measures.append((ARRIVAL, "%", 100.0, _arrival))
    measures.append(("Subtasks (SCR)", "%", 100.0, scr))
    if sweep.counts:
        return measures
    if any(each.coverage is not None for each in metrics):
        measures.append(("Search coverage", "%", 100.0, metric("coverage", 100.0)))
    if any(each.localisation_error_m is not None for each in metrics):
        measures.append(("Location error", "m", None, location_error_m))
    return measures


def _arrival(rows: Sequence[SuiteRow]) -> BoundedEstimate:
    return share(each.last_mile >= _ARRIVED for each in metrics_of(rows) if each.last_mile is not None)


def _part(sweep: ParameterSweep, measures: list[tuple[str, str, float | None, RowMeasure]]) -> FigurePart:
    values = list(sweep.points)
    steps = [sweep.words(value) for value in values]
    entrants = grouped((row for rows in sweep.points.values() for row in rows), lambda row: row.entrant)
    drawings = []
    for title, unit, most, measure in measures:
        series = [
            ChartSeries(called(own[0]), tuple(
                measure([row for row in sweep.points[value] if row.entrant == entrant]) for value in values), at)
            for at, (entrant, own) in enumerate(entrants.items())
        ]  # fmt: skip
        drawings.append(line_chart(title, steps, series, unit=unit, most=most, below=sweep.parameter, places=values))
    lines = []
    for entrant, own in entrants.items():
        for value, step in zip(values, steps, strict=True):
            rows = [row for row in sweep.points[value] if row.entrant == entrant]
            if rows:
                cells = (ResultCell(str(len(rows)), len(rows)), *(measure(rows).cell() for *_, measure in measures))
                lines.append(ResultLine(called(own[0]), (step,), cells))
    notes = (_S4,) if any(title == ARRIVAL for title, *_ in measures) else ()
    heads = ("n", *(f"{title} {unit}" for title, unit, *_ in measures))
    title = f"{column_words(sweep.mission, sweep.mode)} by {sweep.parameter}, with 95 % intervals"
    table = ResultTable("sweep", title, (sweep.parameter,), heads, tuple(lines))
    return FigurePart(drawings=tuple(drawings), tables=(table,), notes=notes)


SCALING = FigureKind(
    name="scaling",
    title="Scaling",
    source="fig:scale-robust (a)",
    about="Team size and workload: parameters that are numbers of assets or targets, one changed at a time.",
    needs="lingjing bench scaling (or: lingjing bench scaling --policy heuristic --limit 5)",
    make=_scaling,
)

ROBUSTNESS = FigureKind(
    name="robustness",
    title="Robustness",
    source="fig:scale-robust (b)",
    about="Sensing and control budgets: all other parameters, one changed at a time. Arrival is cumulative.",
    needs="lingjing bench robustness (or: lingjing bench robustness --policy heuristic --limit 5)",
    make=_robustness,
)
