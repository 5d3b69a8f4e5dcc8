"""Main results: the task success of every entrant in every column, as in the paper's main table."""

from __future__ import annotations

from collections.abc import Iterator

from lingjing.bench.played import Played, columns_of, grouped, in_suite_order
from lingjing.bench.tables import average_of, column_head
from lingjing.report.charts import share_grid
from lingjing.report.evidence import ReportEvidence
from lingjing.report.figure import FigureKind, FigurePart, called, heading_of, tables_of


def _parts(evidence: ReportEvidence) -> Iterator[FigurePart]:
    for study in evidence.played():
        plain = [row for row in study.rows if not row.condition or (row.baseline and not study.name)]
        if not plain:
            continue
        columns = columns_of(plain)
        heads = [column_head(mission, mode, columns) for mission, mode in columns]
        lines = []
        for own in grouped(in_suite_order(plain), lambda row: row.entrant).values():
            each = [
                100 * Played.of(row for row in own if (row.mission, row.mode) == column).rate() for column in columns
            ]
            lines.append((called(own[0]), [*each, 100 * average_of(own, columns)]))
        yield FigurePart(
            heading=heading_of(study, evidence),
            drawings=(share_grid("Task success rate, %", [*heads, "Avg"], lines),),
            tables=tables_of(plain, "success", "intervals"),
        )


KIND = FigureKind(
    name="main",
    title="Main results",
    source="Table 3, tab:main",
    about="Engine-adjudicated task success rate (TSR), percent. Small s and b are star and broadcast. Avg is over the "
    "modes of a mission first, then over missions; an entrant has it if it played every column.",
    needs="lingjing bench main (or: lingjing bench reference --policy heuristic random --limit 5)",
    make=_parts,
)
