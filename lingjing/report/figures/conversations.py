"""Who told whom what, tick by tick, in an episode of each mission: the paper's communication traces."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence

import msgspec

from lingjing.analysis.completion import completion_ticks
from lingjing.analysis.incidents import incidents
from lingjing.analysis.messages import admitted
from lingjing.analysis.search_marks import discoveries
from lingjing.bench.table_cells import ResultCell, ResultLine, ResultTable, plain
from lingjing.report.charts import WIDE, fitting, legend, text_width
from lingjing.report.chosen import chosen_episodes
from lingjing.report.drawing import Drawing, DrawnMark, SpotMark, StrokeMark, WordsMark
from lingjing.report.evidence import ReportEvidence, TracedEpisode
from lingjing.report.figure import FigureKind, FigurePart, called
from lingjing.trace.admitted import AdmittedMessage
from lingjing.trace.reader import Trace, read_trace

CATEGORIES = ("report", "assignment", "target_status", "other")
"""Categories of messages, in the order of their tones."""

SAID = 12
"""Messages of an episode that are told in words."""

FEW = 3
"""More recipients than this are counted, not named."""

_LANE, _SIZE = 18.0, 10.0


def _parts(evidence: ReportEvidence) -> Iterator[FigurePart]:
    for mission, episodes in chosen_episodes(evidence).items():
        traces = [(one, read_trace(one.path)) for one in episodes]
        told = [(one, trace) for one, trace in traces if admitted(trace)]
        if told:
            yield FigurePart(
                heading=mission.upper(),
                drawings=tuple(_lanes(one, trace) for one, trace in told),
                tables=(_compared([one for one, _ in told]), *(_words(one, trace) for one, trace in told)),
            )


def _lanes(one: TracedEpisode, trace: Trace) -> Drawing:
    agents = [agent.id for agent in trace.header.instance.agents]
    left = min(max(text_width(name, _SIZE) for name in agents) + 10.0, 110.0)
    right, ticks = WIDE - 8.0, max(trace.boundaries[-1].tick, 1)
    marks, top = legend([(at, name.replace("_", " ")) for at, name in enumerate(CATEGORIES)], 12.0)
    top += 16.0
    lanes = {name: top + _LANE * at for at, name in enumerate(agents)}
    floor = top + _LANE * len(agents)

    def place(tick: float) -> float:
        return left + (right - left) * tick / (ticks + 0.5)

    for name, y in [*lanes.items(), ("events", floor)]:
        marks.append(StrokeMark(points=((left, y), (right, y)), tone="rule", width=1.0))
        marks.append(WordsMark(x=2.0, y=y + 3.5, text=fitting(name, left - 6.0, _SIZE), size=_SIZE, tone="faint"))
    spread = _spread(admitted(trace))
    for said, tick in spread:
        marks += _message(said, place(tick), lanes)
    marks += _events(trace, place, floor)
    for tick in range(0, ticks + 1, _step(ticks)):
        marks.append(
            WordsMark(x=place(tick), y=floor + 20.0, text=str(tick), size=_SIZE, anchor="middle", tone="faint")
        )
    marks.append(
        WordsMark(x=(left + right) / 2, y=floor + 33.0, text="tick", size=_SIZE, anchor="middle", tone="faint")
    )
    row = one.row
    title = f"{row.mission.upper()} {row.mode}, seed {row.seed}, {called(row, row.condition)}: {_ending(one)}"
    words = (
        f"{len(agents)} agents, {len(spread)} messages in {ticks} ticks; a line goes from the sender's mark to the "
        "recipients. In the row of events a diamond is a discovery, a square something completed, a cross an incident."
    )
    return Drawing(title=title, description=words, width=WIDE, height=floor + 40.0, marks=tuple(marks))


def _step(ticks: int) -> int:
    """Ticks between two numbers of the axis, of which there are five or six at most: 1, 2 or 5 times a power of ten."""
    found = (step * unit for unit in (1, 10, 100, 1000, 10_000) for step in (1, 2, 5) if 5 * step * unit >= ticks)
    return next(found, ticks)


def _message(said: AdmittedMessage, x: float, lanes: Mapping[str, float]) -> Iterator[DrawnMark]:
    if said.sender not in lanes:
        return
    number = CATEGORIES.index(said.category) if said.category in CATEGORIES else len(CATEGORIES) - 1
    tone, shape = f"s{number}", ("circle", "square", "triangle", "diamond")[number]
    ends = [lanes[said.sender], *(lanes[name] for name in said.recipients if name in lanes)]
    yield StrokeMark(points=((x, min(ends)), (x, max(ends))), tone=tone, width=1.0, opacity=0.6)
    for y in ends[1:]:
        yield StrokeMark(points=((x - 2.0, y), (x + 2.0, y)), tone=tone, width=1.5)
    told = f"tick {said.tick}: {said.sender} to {', '.join(said.recipients) or 'nobody'}: {said.kind}"
    yield SpotMark(x=x, y=ends[0], tone=tone, shape=shape, radius=3.0, told=told)


def _events(trace: Trace, place: Callable[[float], float], floor: float) -> Iterator[DrawnMark]:
    tick_s = trace.header.instance.clock.tick_s
    for name, tick in sorted(discoveries(trace).items()):
        yield SpotMark(
            x=place(tick), y=floor, tone="s4", shape="diamond", radius=3.5, told=f"tick {tick}: {name} found"
        )
    for name, tick in sorted(completion_ticks(trace).items()):
        told = f"tick {tick}: {name} completed"
        yield SpotMark(x=place(tick), y=floor, tone="good", shape="square", radius=3.5, told=told)
    for each in incidents(trace):
        at = each.time_s / tick_s
        yield SpotMark(x=place(at), y=floor, tone="bad", shape="cross", told=f"tick {at:.0f}: {each.kind}")


def _spread(messages: Sequence[AdmittedMessage]) -> list[tuple[AdmittedMessage, float]]:
    """Messages of one tick side by side instead of on top of each other."""
    by_tick: dict[int, list[AdmittedMessage]] = {}
    for said in messages:
        by_tick.setdefault(said.tick, []).append(said)
    return [
        (said, tick + 0.8 * ((at + 0.5) / len(some) - 0.5))
        for tick, some in by_tick.items()
        for at, said in enumerate(some)
    ]


def _ending(one: TracedEpisode) -> str:
    report = one.row.report
    return "won" if report.success else f"lost ({report.reason}, SCR {report.scr:.2f})"


def _compared(episodes: Sequence[TracedEpisode]) -> ResultTable:
    lines = []
    for one in episodes:
        found = one.row.report.metrics
        if found is None:
            continue
        cells = [ResultCell(_ending(one))]
        rep = None if found.rep is None else 100 * found.rep
        told = (
            (found.messages, ".0f"),
            (found.kilobytes, ".1f"),
            (found.rounds, ".0f"),
            (found.gap, ".0f"),
            (rep, ".0f"),
        )
        for value, spec in told:
            cells.append(plain(float("nan") if value is None else float(value), spec))
        lines.append(ResultLine("", (one.row.mode, str(one.row.seed)), tuple(cells)))
    heads = ("Ended", "Msg", "KB", "Rnd", "Gap %", "Rep %")
    return ResultTable("episodes", "The episodes that are shown", ("Mode", "Seed"), heads, tuple(lines))


def _words(one: TracedEpisode, trace: Trace) -> ResultTable:
    """What was said: assignments and states of targets first, in the order of ticks."""
    messages = admitted(trace)
    first = [said for said in messages if said.category in ("assignment", "target_status")]
    what = "assignments and target states" if first else "messages"
    first = first or list(messages)
    lines = []
    for said in first[:SAID]:
        body = json.dumps(_rounded(msgspec.to_builtins(dict(said.body))), ensure_ascii=False)
        many = len(said.recipients) > FEW
        to = f"{len(said.recipients)} agents" if many else ", ".join(said.recipients) or "nobody"
        short = body if len(body) <= 160 else f"{body[:159]}…"
        lines.append(ResultLine("", (str(said.tick), said.sender, to, said.kind, short), ()))
    more = f"{len(lines)} of {len(first)} {what}, of {len(messages)} messages; lingjing view shows all"
    notes = (more,) if len(lines) < len(messages) else ()
    title = f"What was said in {one.row.mode}"
    return ResultTable("said", title, ("Tick", "From", "To", "Kind", "Body"), (), tuple(lines), notes)


def _rounded(value: object) -> object:
    """The same with numbers to two places, as far as anybody reads them."""
    match value:
        case float():
            return round(value, 2)
        case dict():
            return {name: _rounded(one) for name, one in value.items()}
        case list() | tuple():
            return [_rounded(one) for one in value]
    return value


KIND = FigureKind(
    name="conversations",
    title="Communication traces",
    source="fig:logistics-process (a), fig:sea-process (a)",
    about="One seed of each mission in both modes, where there are, best one that ended differently. A mark is a "
    "message at its sender, a line goes to its recipients.",
    needs="lingjing bench modes --keep (or: lingjing run ufr --seed 1 --mode star, and --mode broadcast)",
    make=_parts,
)
