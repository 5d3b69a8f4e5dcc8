"""Prompts: their evaluation on held-out seeds, and the search for one, as in the paper's figure of prompts."""

from __future__ import annotations

from collections.abc import Iterator

from lingjing.bench.table_cells import ResultCell, ResultLine, ResultTable, marked
from lingjing.report.charts import BarGroup, ChartBar, ChartSeries, bar_chart, line_chart
from lingjing.report.conditions import PROMPT, varied_columns
from lingjing.report.estimates import location_error_m, mean, pooled, scr, share, tsr, weighted
from lingjing.report.evidence import PromptTrial, ReportEvidence
from lingjing.report.figure import FigureKind, FigurePart, called, column_words, heading_of

_JSON = weighted("json_compliance", "answers", 100.0)


def _parts(evidence: ReportEvidence) -> Iterator[FigurePart]:
    yield from _evaluated(evidence)
    for trial in evidence.searches:
        if trial.candidates:
            yield _developed(trial)


def _evaluated(evidence: ReportEvidence) -> Iterator[FigurePart]:
    for study in evidence.played():
        for column in varied_columns(study):
            if PROMPT not in column.options:
                continue
            groups, lines = [], []
            for (_, condition), rows in column.conditions(of=PROMPT).items():
                name = condition or "default"
                bars = (ChartBar("TSR", 0, tsr(rows)), ChartBar("SCR", 1, scr(rows)), ChartBar("JSON", 2, _JSON(rows)))
                groups.append(BarGroup(f"{called(rows[0])}: {name}", bars))
                cells = (ResultCell(str(len(rows)), len(rows)), tsr(rows).cell(), scr(rows).cell(),
                         _JSON(rows).cell(), location_error_m(rows).cell(".1f"))  # fmt: skip
                lines.append(ResultLine(called(rows[0]), (name,), cells))
            title = column_words(column.mission, column.mode)
            heads = ("n", "TSR %", "SCR %", "JSON %", "LocErr m")
            compared = marked(lines, lower=(4,), only=(1, 2, 3, 4))
            table = ResultTable("prompts", f"{title}: prompts, held-out episodes", ("Prompt",), heads, compared)
            yield FigurePart(
                heading=heading_of(study, evidence, title),
                drawings=(bar_chart(f"{title}: held-out episodes", groups, unit="%", most=100.0),),
                tables=(table,),
            )


def _developed(trial: PromptTrial) -> FigurePart:
    """Return the trajectory of a search on its development episodes."""
    played = [candidate for candidate in trial.candidates if not candidate.fault]
    lost = [f"{candidate.number}" for candidate in trial.candidates if candidate.fault]
    steps = [f"{candidate.number}" for candidate in played]
    wins, done, valid = [], [], []
    lines = []
    for candidate in played:
        episodes = candidate.episodes
        wins.append(share(each.success for each in episodes))
        done.append(mean(each.scr for each in episodes).times(100.0))
        valid.append(pooled((each.valid, each.answers) for each in episodes).times(100.0))
        values = (wins[-1].cell(), done[-1].cell(), valid[-1].cell())
        entries = (ResultCell(str(len(episodes)), len(episodes)), *values, ResultCell(candidate.sha256[:12]))
        lines.append(ResultLine("", (f"revision {candidate.number}" if candidate.number else "start",), entries))
    measured = (("TSR", wins), ("SCR", done), ("JSON", valid))
    series = [ChartSeries(name, tuple(values), number) for number, (name, values) in enumerate(measured)]
    heads = ("n", "TSR %", "SCR %", "JSON %", "SHA-256")
    title = f"{trial.name}: development episodes"
    return FigurePart(
        heading=title,
        drawings=(line_chart(title, steps, series, unit="%", most=100.0, below="revision"),),
        tables=(ResultTable("trajectory", title, ("Prompt",), heads, tuple(lines)),),
        notes=(
            "each revision starts from the best prompt so far, so it may be worse than the one before",
            *([f"no prompt was given in round {', '.join(lost)}"] if lost else []),
        ),
    )


KIND = FigureKind(
    name="prompts",
    title="Prompts",
    source="fig:prompt",
    about="Prompts on the same held-out seeds, and the trajectory of a search for a better one on development seeds.",
    needs="lingjing bench prompts --max-cost USD; lingjing prompts improve ssr --mode broadcast -o P2.txt",
    make=_parts,
)
