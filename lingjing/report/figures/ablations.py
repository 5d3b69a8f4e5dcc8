"""Ablations: the effect of each component of an agent, as in the paper's two tables of ablations."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from lingjing.bench.rows import SuiteRow
from lingjing.bench.table_cells import ResultCell, ResultLine, ResultTable, marked, plain
from lingjing.report.charts import BarGroup, ChartBar, bar_chart
from lingjing.report.conditions import INTERVENTION, PROMPT, VariedColumn, varied_columns
from lingjing.report.estimates import UNKNOWN, BoundedEstimate, cost_factor, location_error_m, mean, scr, tsr
from lingjing.report.evidence import ReportEvidence
from lingjing.report.figure import FigureKind, FigurePart, called, column_words, heading_of

DECIDER = "decider"
"""Option of a policy that replaces its model by a sweep of the search area."""


def _parts(evidence: ReportEvidence) -> Iterator[FigurePart]:
    for study in evidence.played():
        for column in varied_columns(study):
            components = sorted(column.options - {PROMPT, INTERVENTION})
            if not components:
                continue
            title = column_words(column.mission, column.mode)
            groups, lines = [], []
            conditions = column.conditions()
            variants: dict[str, set[str]] = {}
            for (entrant, _), rows in conditions.items():
                arguments = rows[0].options.policy_args
                variants.setdefault(entrant, set()).add(repr([arguments.get(name) for name in components]))
            for (entrant, condition), rows in conditions.items():
                if len(variants[entrant]) < 2:  # it is compared in the table of the decision layer alone
                    continue
                name = condition or "default"
                bars = (ChartBar("success (SR)", 0, tsr(rows)), ChartBar("subtasks (SCR)", 1, scr(rows)))
                groups.append(BarGroup(f"{called(rows[0])}: {name}", bars))
                cost = cost_factor(rows, column.rows)
                cells = (ResultCell(str(len(rows)), len(rows)), tsr(rows).cell(), scr(rows).cell(),
                         location_error_m(rows).cell(".1f"), plain(cost, ".2f"))  # fmt: skip
                lines.append(ResultLine(called(rows[0]), (name,), cells))
            heads = ("n", "SR %", "SCR %", "LocErr m", "Cost x")
            note = "brackets are 95 % intervals; Cost x is tokens over those of the same entrant's baseline"
            compared = marked(lines, lower=(3,), only=(1, 2, 3))
            table = ResultTable("ablation", f"{title}: components", ("Variant",), heads, compared, (note,))
            yield FigurePart(
                heading=heading_of(study, evidence, title),
                drawings=(bar_chart(title, groups, unit="%", most=100.0),),
                tables=(table, *_decision_layer(column)),
            )


def _decision_layer(column: VariedColumn) -> Iterator[ResultTable]:
    """Yield the table of the gain of the model over the sweep without it, on the seeds that both have played."""
    swept = [row for row in column.rows if row.options.policy_args.get(DECIDER) == "sweep"]
    full = [rows for rows in column.conditions().values() if rows[0].baseline]
    if not swept or not full:
        return
    lines = [_line("Sweep (no model)", swept, UNKNOWN)]
    lines += [_line(called(rows[0]), rows, _gain(rows, swept)) for rows in full]
    heads = ("n", "SR %", "SCR %", "Difference of SR")
    note = "the difference is over the seeds that both have played, bootstrapped"
    title = f"{column_words(column.mission, column.mode)}: the decision layer"
    yield ResultTable("decision", title, ("Decides",), heads, tuple(lines), (note,))


def _line(name: str, rows: Sequence[SuiteRow], gain: BoundedEstimate) -> ResultLine:
    cells = (ResultCell(str(len(rows)), len(rows)), tsr(rows).cell(), scr(rows).cell(), gain.cell("+.0f"))
    return ResultLine("", (name,), cells)


def _gain(rows: Sequence[SuiteRow], base: Sequence[SuiteRow]) -> BoundedEstimate:
    """Return the mean difference of success on common seeds, in percentage points."""
    successes = {row.seed: row.report.success for row in base}
    return mean(float(row.report.success) - float(successes[row.seed]) for row in rows if row.seed in successes).times(
        100.0
    )


KIND = FigureKind(
    name="ablations",
    title="Ablations",
    source="tab:abl, tab:abl-llm",
    about="One component of the agent removed or made coarser at a time, on the same seeds.",
    needs="lingjing bench ablations --max-cost USD (or runs that differ in an option: lingjing run ssr --policy react "
    "--policy-arg model=NAME --policy-arg research=0)",
    make=_parts,
)
