"""Drift: rates of actions by third of an episode, as in the paper's table of behaviour by trajectory tercile."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from lingjing.analysis.behaviour import TERCILES, ActionCounts
from lingjing.bench.played import grouped, in_suite_order
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
"""Rates: short name, title, and a function that returns the counted actions and the number they are a share of."""

_NOTE = "each agent's actions of an episode in three equal parts, pooled; intervals are over episodes"


def _parts(evidence: ReportEvidence) -> Iterator[FigurePart]:
    for study in evidence.played():
        entrants = {
            key: counted
            for key, rows in grouped(in_suite_order(study.plain), lambda row: (row.entrant, row.condition)).items()
            if (counted := [row for row in rows if row.report.terciles])
        }
        if not entrants:
            continue
        number_of = study.numbers()
        rates = {key: [_thirds(rows, counted) for *_, counted in RATES] for key, rows in entrants.items()}
        drawings = []
        for at, (_, title, _) in enumerate(RATES):
            series = [
                ChartSeries(called(rows[0], key[1]), rates[key][at], number_of(rows[0]))
                for key, rows in entrants.items()
            ]
            drawings.append(line_chart(title, TERCILES, series, unit="%", most=100.0, below="third of the actions"))
        lines = [
            line
            for name, rows in _tiers(in_suite_order(study.plain)).items()
            for line in _lines("", name, rows, [_thirds(rows, counted) for *_, counted in RATES])
        ]
        for key, rows in entrants.items():
            lines += _lines(rows[0].group, called(rows[0], key[1]), rows, rates[key])
        heads = ("n", "Actions", *(short for short, *_ in RATES))
        table = ResultTable("drift", "Actions by tercile (%)", ("", "Ctx."), heads, tuple(lines), (_NOTE,))
        yield FigurePart(heading=heading_of(study, evidence), drawings=tuple(drawings), tables=(table,))


def _tiers(rows: Sequence[SuiteRow]) -> dict[str, list[SuiteRow]]:
    """Return the rows of each tier, which is a heading of entrants; entrants with access to the truth are in none."""
    return grouped(
        (row for row in rows if row.group and not row.privileged and row.report.terciles), lambda row: row.group
    )


def _lines(
    group: str, name: str, rows: Sequence[SuiteRow], rates: Sequence[Sequence[BoundedEstimate]]
) -> Iterator[ResultLine]:
    for third, word in enumerate(TERCILES):
        actions = sum(row.report.terciles[third].actions for row in rows)
        cells = (
            ResultCell(str(len(rows)), len(rows)), ResultCell(f"{actions:,}", actions),
            *(each[third].cell() for each in rates),
        )  # fmt: skip
        yield ResultLine(group, (name, word.capitalize()), cells)


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
