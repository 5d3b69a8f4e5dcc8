"""Communication traces: the messages of one episode of each mission, tick by tick.

Agents are lanes and ticks go from left to right. A marker stands at the sender, and a line leads to the recipients. The
lowest lane has the events of the episode.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import msgspec

from lingjing.analysis.completion import completion_ticks
from lingjing.analysis.incidents import incidents
from lingjing.analysis.messages import admitted_messages
from lingjing.analysis.search_marks import discoveries
from lingjing.bench.table_cells import ResultCell, ResultLine, ResultTable, plain
from lingjing.report.charts import Legend
from lingjing.report.chosen import chosen_episodes
from lingjing.report.drawing import LIGHT, WIDE, Drawing, colour_of, marker_of
from lingjing.report.evidence import ReportEvidence, TracedEpisode
from lingjing.report.figure import FigureKind, FigurePart, called
from lingjing.report.text_layout import SMALL, fitting, text_width
from lingjing.trace.admitted_messages import AdmittedMessage
from lingjing.trace.reader import Trace, read_trace

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from lingjing.report.painting import Canvas

CATEGORIES = ("report", "assignment", "target_status", "other")
"""Categories of messages, in the order of their tones."""

SHOWN_MESSAGES = 12
"""Messages of an episode in its table, which a reader takes in at a glance."""

FEW = 3
"""Most recipients of a message that are named; if there are more, their number is shown (chosen)."""

BODY_LENGTH = 160
"""Characters of a message's body in the table: two lines on a desk."""

_LANE = 18.0
_MOST_NAME_WIDTH = 110.0
_SPREAD = 0.8
"""Part of a tick's width over which the messages of one tick are spread."""


class _EpisodeEvent(NamedTuple):
    """A marker in the lane of events."""

    tick: float
    tone: str
    marker: str
    tooltip: str


def _parts(evidence: ReportEvidence) -> Iterator[FigurePart]:
    for mission, episodes in chosen_episodes(evidence).items():
        traces = [(episode, read_trace(episode.path)) for episode in episodes]
        shown = [(episode, trace) for episode, trace in traces if admitted_messages(trace)]
        if shown:
            yield FigurePart(
                heading=mission.upper(),
                drawings=tuple(_lanes(episode, trace) for episode, trace in shown),
                tables=(
                    _compared([episode for episode, _ in shown]),
                    *(_message_table(episode, trace) for episode, trace in shown),
                ),
            )


def _lanes(episode: TracedEpisode, trace: Trace) -> Drawing:
    agents = [agent.id for agent in trace.header.instance.agents]
    left = min(max(text_width(name, SMALL) for name in agents) + 10.0, _MOST_NAME_WIDTH)
    ticks = max(trace.boundaries[-1].tick, 1)
    legend = Legend([(number, name.replace("_", " ")) for number, name in enumerate(CATEGORIES)])
    top, width, height = legend.height + 7.0, WIDE - 8.0 - left, _LANE * (len(agents) + 1)
    messages = _spread(admitted_messages(trace))
    events = list(_events(trace))

    def paint(canvas: Canvas) -> None:
        legend.paint(canvas, canvas.axes(0.0, 0.0, WIDE, legend.height))
        axes = canvas.axes(left, top, width, height)
        axes.set(xlim=(0.0, ticks + 0.5), ylim=(len(agents) + 0.5, -0.5))
        axes.set_yticks(range(len(agents) + 1), [fitting(name, left - 6.0, SMALL) for name in (*agents, "events")])
        axes.grid(axis="y")
        axes.set_xticks(_tick_numbers(ticks))
        axes.set_xlabel("tick")
        _paint_messages(canvas, axes, messages, {name: lane for lane, name in enumerate(agents)})
        for event in events:
            (marker,) = axes.plot([event.tick], [len(agents)], event.marker, color=LIGHT[event.tone], markersize=7.0,
                                  clip_on=False)  # fmt: skip
            canvas.tooltip(marker, event.tooltip)

    row = episode.row
    words = (
        f"{len(agents)} agents, {len(messages)} messages in {ticks} ticks; a line goes from the sender's mark to the "
        "recipients. In the row of events a diamond is a discovery, a square something completed, a cross an incident."
    )
    return Drawing(
        title=f"{row.mission.upper()} {row.mode}, seed {row.seed}, {called(row, row.condition)}: {_ending(episode)}",
        description=words, width=WIDE, height=top + height + 34.0, paint=paint,
    )  # fmt: skip


def _tick_numbers(ticks: int) -> list[int]:
    """Return about five multiples of 1, 2 or 5 times a power of ten, from 0 to the last tick."""
    from matplotlib.ticker import MaxNLocator

    numbers = MaxNLocator(5, steps=[1, 2, 5, 10], integer=True).tick_values(0, ticks)
    return [int(number) for number in numbers if 0 <= number <= ticks]


def _paint_messages(
    canvas: Canvas, axes: Axes, messages: Sequence[tuple[AdmittedMessage, float]], lanes: Mapping[str, int]
) -> None:
    for message, tick in messages:
        if message.sender not in lanes:
            continue
        number = CATEGORIES.index(message.category if message.category in CATEGORIES else CATEGORIES[-1])
        colour, sender = colour_of(number), lanes[message.sender]
        recipients = [lanes[name] for name in message.recipients if name in lanes]
        axes.vlines(tick, min(sender, *recipients, sender), max(sender, *recipients, sender), colors=colour,
                    linewidth=1.0, alpha=0.6)  # fmt: skip
        axes.plot([tick] * len(recipients), recipients, "_", color=colour, markersize=4.0, markeredgewidth=1.5)
        (marker,) = axes.plot([tick], [sender], marker_of(number), color=colour, markersize=6.0, clip_on=False)
        recipient_names = ", ".join(message.recipients) or "no agent"
        canvas.tooltip(marker, f"tick {message.tick}: {message.sender} to {recipient_names}: {message.kind}")


def _events(trace: Trace) -> Iterator[_EpisodeEvent]:
    tick_s = trace.header.instance.clock.tick_s
    for name, tick in sorted(discoveries(trace).items()):
        yield _EpisodeEvent(tick, "s4", "D", f"tick {tick}: {name} found")
    for name, tick in sorted(completion_ticks(trace).items()):
        yield _EpisodeEvent(tick, "good", "s", f"tick {tick}: {name} completed")
    for incident in incidents(trace):
        place = incident.time_s / tick_s
        yield _EpisodeEvent(place, "bad", "X", f"tick {place:.0f}: {incident.kind}")


def _spread(messages: Iterable[AdmittedMessage]) -> list[tuple[AdmittedMessage, float]]:
    """Return messages and their places on the axis of ticks: those of one tick stand side by side."""
    by_tick: dict[int, list[AdmittedMessage]] = {}
    for message in messages:
        by_tick.setdefault(message.tick, []).append(message)
    return [
        (message, tick + _SPREAD * ((place + 0.5) / len(together) - 0.5))
        for tick, together in by_tick.items()
        for place, message in enumerate(together)
    ]


def _ending(episode: TracedEpisode) -> str:
    report = episode.row.report
    return "won" if report.success else f"lost ({report.reason}, SCR {report.scr:.2f})"


def _compared(episodes: Sequence[TracedEpisode]) -> ResultTable:
    lines = []
    for episode in episodes:
        metrics = episode.row.report.metrics
        if metrics is None:
            continue
        rep = None if metrics.rep is None else 100 * metrics.rep
        values = (
            (metrics.messages, ".0f"),
            (metrics.kilobytes, ".1f"),
            (metrics.rounds, ".0f"),
            (metrics.gap, ".0f"),
            (rep, ".0f"),
        )
        cells = [plain(float("nan") if value is None else float(value), spec) for value, spec in values]
        label = (episode.row.mode, str(episode.row.seed))
        lines.append(ResultLine("", label, (ResultCell(_ending(episode)), *cells)))
    heads = ("Ended", "Msg", "KB", "Rnd", "Gap %", "Rep %")
    return ResultTable("episodes", "The episodes that are shown", ("Mode", "Seed"), heads, tuple(lines))


def _message_table(episode: TracedEpisode, trace: Trace) -> ResultTable:
    """Return the first assignments and target states of an episode, or its first messages if it has neither."""
    messages = admitted_messages(trace)
    selected = [message for message in messages if message.category in ("assignment", "target_status")]
    kinds = "assignments and target states" if selected else "messages"
    selected = selected or list(messages)
    lines = []
    for message in selected[:SHOWN_MESSAGES]:
        body = json.dumps(_rounded(msgspec.to_builtins(dict(message.body))), ensure_ascii=False)
        named = ", ".join(message.recipients) or "no agent"
        recipients = named if len(message.recipients) <= FEW else f"{len(message.recipients)} agents"
        short = body if len(body) <= BODY_LENGTH else f"{body[: BODY_LENGTH - 1]}…"
        lines.append(ResultLine("", (str(message.tick), message.sender, recipients, message.kind, short), ()))
    count = f"{len(lines)} of {len(selected)} {kinds}, of {len(messages)} messages; lingjing view shows all"
    notes = (count,) if len(lines) < len(messages) else ()
    title = f"Messages in {episode.row.mode}"
    return ResultTable("said", title, ("Tick", "From", "To", "Kind", "Body"), (), tuple(lines), notes)


def _rounded(value: object) -> object:
    """Return a message's body with numbers to two places, which is all that a reader needs."""
    match value:
        case float():
            return round(value, 2)
        case dict():
            return {name: _rounded(content) for name, content in value.items()}
        case list() | tuple():
            return [_rounded(content) for content in value]
    return value


KIND = FigureKind(
    name="conversations",
    title="Communication traces",
    source="fig:logistics-process (a), fig:sea-process (a)",
    about="One seed of each mission, in both modes if it was played in both. A mark is a "
    "message at its sender, a line goes to its recipients.",
    needs="lingjing bench modes --keep (or: lingjing run ufr --seed 1 --mode star, and --mode broadcast)",
    make=_parts,
)
