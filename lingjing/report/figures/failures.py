"""Failure families of lost episodes, as in the paper's table."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence

from lingjing.bench.failure_tables import FAMILY_NAMES
from lingjing.bench.played import grouped, in_suite_order
from lingjing.bench.rows import SuiteRow
from lingjing.report.charts import ShareBar, share_chart
from lingjing.report.evidence import ReportEvidence
from lingjing.report.figure import FigureKind, FigurePart, called, column_words, heading_of, tables_of


def _parts(evidence: ReportEvidence) -> Iterator[FigurePart]:
    for study in evidence.played():
        drawings = []
        listed = in_suite_order(study.plain)
        for (_, condition), rows in grouped(listed, lambda row: (row.entrant, row.condition)).items():
            bars = list(_bars(rows))
            if bars:
                drawings.append(share_chart(called(rows[0], condition), tuple(FAMILY_NAMES.values()), bars))
        if drawings:
            yield FigurePart(
                heading=heading_of(study, evidence), drawings=tuple(drawings), tables=tables_of(study.plain, "failures")
            )


def _bars(rows: Sequence[SuiteRow]) -> Iterator[ShareBar]:
    for (mission, mode), own in grouped(rows, lambda row: (row.mission, row.mode)).items():
        lost = Counter(row.report.family for row in own if row.report.family is not None)
        if lost:
            shares = tuple(lost[family] / lost.total() for family in FAMILY_NAMES)
            yield ShareBar(column_words(mission, mode), lost.total(), shares)


KIND = FigureKind(
    name="failures",
    title="Failure families",
    source="tab:fa",
    about="Percent of lost episodes. Each has the earliest breakdown that its trace shows; infrastructure failures are "
    "left out. lingjing why TRACE shows the records of one.",
    needs="lingjing bench main (or any runs of which some are lost: lingjing run ssr --seeds 0-9 --policy random)",
    make=_parts,
)
