"""Perception: errors of detection reports, as in panel (b) of the paper's subtask provenance and its table."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence

from lingjing.bench.played import grouped, in_suite_order
from lingjing.bench.rows import SuiteRow
from lingjing.bench.table_cells import ResultCell, ResultLine, ResultTable, marked
from lingjing.report.charts import BarGroup, ChartBar, bar_chart
from lingjing.report.drawing import Drawing
from lingjing.report.estimates import (
    UNKNOWN,
    BoundedEstimate,
    calibration,
    location_error_m,
    mean,
    metrics_of,
    perceived,
    unmatched,
)
from lingjing.report.evidence import ReportEvidence, ReportStudy
from lingjing.report.figure import FigureKind, FigurePart, called, column_words, heading_of

MEASURES = ("1 - F1", "miss rate", "location error, as a share of the largest", "calibration error (ECE)")
"""Names of the four measures, each between 0 and 1."""

_MISS = perceived("missing")
_RATES = perceived("missing", 100.0), perceived("hallucinating", 100.0), perceived("confusing", 100.0)


def _parts(evidence: ReportEvidence) -> Iterator[FigurePart]:
    for study in evidence.played():
        judged = [
            row for row in study.plain if row.report.metrics is not None and row.report.metrics.miss_rate is not None
        ]
        if not judged:
            continue
        cells = grouped(judged, lambda row: (row.mission, row.mode, row.entrant, row.condition))
        errors = [location_error_m(rows).value for rows in cells.values()]
        farthest = max((error for error in errors if not math.isnan(error)), default=math.nan)
        number_of = study.numbers()
        columns = grouped(judged, lambda row: (row.mission, row.mode))
        yield FigurePart(
            heading=heading_of(study, evidence),
            drawings=tuple(
                _drawn(number_of, column_words(*column), rows, farthest) for column, rows in columns.items()
            ),
            tables=(_panel(cells, farthest), _backbones(study)),
        )


def _measured(rows: Sequence[SuiteRow], farthest: float) -> tuple[BoundedEstimate, ...]:
    """Return the four measures, each from 0 to 1; higher is worse."""
    normal = location_error_m(rows).times(1 / farthest) if farthest > 0 else UNKNOWN
    return unmatched(rows), _MISS(rows), normal, calibration(rows)


def _drawn(number_of: Callable[[SuiteRow], int], title: str, rows: Sequence[SuiteRow], farthest: float) -> Drawing:
    each = grouped(rows, lambda row: (row.entrant, row.condition))
    measured = [(own[0], called(own[0], key[1]), _measured(own, farthest)) for key, own in each.items()]
    groups = [
        BarGroup(
            measure,
            tuple(ChartBar(name, number_of(row), values[number]) for row, name, values in measured),
            ".2f",
            1.0,
        )
        for number, measure in enumerate(MEASURES)
    ]
    return bar_chart(title, groups, lone=True)


def _panel(cells: Mapping[tuple[str, str, str, str], Sequence[SuiteRow]], farthest: float) -> ResultTable:
    lines = []
    for (mission, mode, _, condition), rows in cells.items():
        wrong, missed, normal, calibrated = _measured(rows, farthest)
        frames = sum(metrics.frames for metrics in metrics_of(rows))
        entries = (
            ResultCell(str(len(rows)), len(rows)), ResultCell(f"{frames:,}", frames), wrong.cell(".2f"),
            missed.cell(".2f"), calibrated.cell(".2f"), location_error_m(rows).cell(".1f"), normal.cell(".2f"),
        )  # fmt: skip
        lines.append(ResultLine(column_words(mission, mode), (called(rows[0], condition),), entries))
    heads = ("n", "Frames", "1-F1", "Miss", "ECE", "LocErr m", "LocErr norm.")
    note = (
        "F1, Miss and ECE are pooled over frames and reports; LocErr is the median over all matched reports, "
        "normalised by the largest of the table; intervals are bootstrapped over episodes"
    )
    return ResultTable("panel", "Perception by mission", ("Entrant",), heads, tuple(lines), (note,))


def _backbones(study: ReportStudy) -> ResultTable:
    """Return the paper's table by backbone. Attention is defined for models with maps beside their traces."""
    lines = []
    for rows in grouped(in_suite_order(study.plain), lambda row: row.entrant).values():
        attention = [row.attention_iou for row in rows if row.attention_iou is not None]
        cells = (
            ResultCell(str(len(rows)), len(rows)),
            *(rate(rows).cell() for rate in _RATES),
            mean(attention).cell(".2f"),
        )
        lines.append(ResultLine(rows[0].group, (called(rows[0]),), cells))
    heads = ("n", "Miss", "Halluc.", "Confus.", "Attn-IoU")
    note = "percent of frames; Attn-IoU is from 0 to 1, and N/A without attention.npz beside a trace (docs/metrics.md)"
    compared = marked(lines, lower=(1, 2, 3), only=(1, 2, 3, 4))
    return ResultTable("perception", "Perception by entrant", ("Entrant",), heads, compared, (note,))


KIND = FigureKind(
    name="perception",
    title="Perception",
    source="fig:subtask-provenance (b), tab:perc",
    about="Errors of detection reports against the true boxes of their frames; higher is worse in all bars.",
    needs="lingjing bench provenance (or any run of a mission that judges reports: lingjing run ssr --seeds 0-9)",
    make=_parts,
)
