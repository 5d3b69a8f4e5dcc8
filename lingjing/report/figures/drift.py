"""How actions change along an episode: the paper's table of behaviour by trajectory tercile."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from lingjing.analysis.behaviour import TERCILES, ActionCounts
from lingjing.bench.played import rows_by
from lingjing.bench.rows import SuiteRow
from lingjing.bench.table_cells import ResultCell, ResultLine, ResultTable
from lingjing.report.charts import ChartSeries, line_chart
from lingjing.report.estimates import BoundedEstimate, pooled
from lingjing.report.evidence import ReportEvidence
from lingjing.report.figure import FigureKind, FigurePart, called, heading_of

RATES: tuple[tuple[str, str, Callable[[ActionCounts], tuple[int, int]]], ...] = (
    ("Adher.", "Constraint adherence", lambda counts: (counts.adherent, counts.actions)),
    ("Repeat", "Repetition", lambda counts: (counts.repeated, counts.following)),
    ("OOB", "Out of bounds", lambda counts: (counts.out_of_bounds, counts.actions)),
    ("Forgot", "Forgotten subgoals", lambda counts: (counts.forgotten, counts.actions)),
)


def _parts(evidence: ReportEvidence) -> Iterator[FigurePart]:
    for study in evidence.played():
        told = {
            key: some
            for key, rows in rows_by(study.plain, lambda row: (row.entrant, row.condition)).items()
            if (some := [row for row in rows if row.report.terciles])
        }
        if not told:
            continue
        drawings = []
        for _, title, counted in RATES:
            series = [
                ChartSeries(called(rows[0], condition), _thirds(rows, counted), study.number(rows[0]))
                for (_, condition), rows in told.items()
            ]
            drawings.append(line_chart(title, TERCILES, series, unit="%", most=100.0, below="third of the actions"))
        lines = [line for key, rows in told.items() for line in _lines(called(rows[0], key[1]), rows)]
        heads = ("n", "Actions", *(short for short, *_ in RATES))
        note = (
            "each agent's actions of an episode in three equal parts, pooled; intervals are bootstrapped over episodes"
        )
        table = ResultTable("drift", "Actions by tercile (%)", ("", "Ctx."), heads, tuple(lines), (note,))
        yield FigurePart(heading=heading_of(study, evidence), drawings=tuple(drawings), tables=(table,))


def _lines(name: str, rows: Sequence[SuiteRow]) -> Iterator[ResultLine]:
    for third, word in enumerate(TERCILES):
        actions = sum(row.report.terciles[third].actions for row in rows)
        cells = (
            ResultCell(str(len(rows)), len(rows)), ResultCell(f"{actions:,}", actions),
            *(_rate(rows, third, counted).cell() for *_, counted in RATES),
        )  # fmt: skip
        yield ResultLine(rows[0].group, (name, word.capitalize()), cells)


def _thirds(
    rows: Sequence[SuiteRow], counted: Callable[[ActionCounts], tuple[int, int]]
) -> tuple[BoundedEstimate, ...]:
    return tuple(_rate(rows, third, counted) for third in range(len(TERCILES)))


def _rate(rows: Sequence[SuiteRow], third: int, counted: Callable[[ActionCounts], tuple[int, int]]) -> BoundedEstimate:
    return pooled(counted(row.report.terciles[third]) for row in rows).times(100.0)


KIND = FigureKind(
    name="drift",
    title="Drift along the episode",
    source="tab:ctx",
    about="Rates of each agent's actions in the first, second and last third of its sequence. Adherence is better when "
    "higher, the others when lower.",
    needs="lingjing bench behaviour (or any runs: lingjing run ssr --seeds 0-9)",
    make=_parts,
)
