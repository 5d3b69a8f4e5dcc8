"""The cost of model calls: tokens, dollars, and the ratio to the baseline."""

from __future__ import annotations

from collections.abc import Iterator

from lingjing.bench.played import Played, grouped
from lingjing.bench.table_cells import ResultCell, ResultLine, ResultTable, plain
from lingjing.report.charts import BarGroup, ChartBar, bar_chart
from lingjing.report.estimates import UNKNOWN, cost_factor, metric, metrics_of, weighted
from lingjing.report.evidence import ReportEvidence
from lingjing.report.figure import FigureKind, FigurePart, called, column_words, heading_of

_TOKENS = metric("tokens", 1e-3)


def _parts(evidence: ReportEvidence) -> Iterator[FigurePart]:
    for study in evidence.played():
        if not any(metrics.calls for metrics in metrics_of(study.rows)):
            continue
        drawings, lines = [], []
        for (mission, mode), rows in study.by(lambda row: (row.mission, row.mode)).items():
            spent = [row for row in rows if row.report.metrics is not None and row.report.metrics.calls]
            groups = []
            for (_, condition), own in grouped(spent, lambda row: (row.entrant, row.condition)).items():
                factor, tokens = cost_factor(own, rows), Played.of(own).mean("tokens")
                name = called(own[0], condition)
                groups.append(BarGroup(name, (ChartBar("thousand tokens an episode", 0, _TOKENS(own)),), ".1f"))
                dollars = sum(metrics.cost_usd for metrics in metrics_of(own))
                cells = (
                    ResultCell(str(len(own)), len(own)), metric("calls")(own).cell(".1f"), _TOKENS(own).cell(".1f"),
                    plain(factor, ".2f"), metric("cost_usd")(own).cell(".4f"), plain(dollars, ".2f"),
                    (weighted("json_compliance", "answers", 100.0)(own) if tokens else UNKNOWN).cell(),
                )  # fmt: skip
                lines.append(ResultLine(column_words(mission, mode), (name,), cells))
            if groups:
                drawings.append(bar_chart(f"{column_words(mission, mode)}: thousand tokens", groups))
        heads = ("n", "Calls", "Tokens, thousand", "Cost x", "USD", "USD in all", "JSON %")
        note = "means of episodes with 95 % intervals; Cost x compares tokens with the baseline of the same entrant"
        table = ResultTable("cost", "Calls of models", ("Entrant",), heads, tuple(lines), (note,))
        yield FigurePart(heading=heading_of(study, evidence), drawings=tuple(drawings), tables=(table,))


KIND = FigureKind(
    name="cost",
    title="Relative cost",
    source="tab:abl (Cost)",
    about="Prompt and completion tokens of all calls of an episode, those of repeated answers too.",
    needs="lingjing run ssr --policy react --policy-arg model=NAME --seeds 0-4 (without a model nothing is spent)",
    make=_parts,
)
