"""The screen of a watched episode from 40 by 10 cells on: heading, map, agents, messages and events."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from rich.console import Console, ConsoleOptions, Group, RenderResult
from rich.layout import Layout
from rich.padding import Padding
from rich.rule import Rule
from rich.segment import Segment, Segments
from rich.style import Style
from rich.table import Table
from rich.text import Text

from lingjing.cli.progress import factor
from lingjing.cli.watch.chart import TARGET_SIGNS, Chart, asset_ink
from lingjing.terminal import visible
from lingjing.viewer.frames import Ink
from lingjing.viewer.state import AgentStatus, EpisodeState, TickerLine

MAP_FROM = (56, 16)
"""The smallest number of columns and rows of a terminal with a map. Chosen."""
_HEADING = 3


class Screen:
    """A rich renderable that fills the terminal with the state of the episode."""

    def __init__(self, watched: EpisodeState, chart: Chart, title: str, credit: str = "") -> None:
        self._watched = watched
        self._chart = chart
        self._title = title
        self._credit = credit

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        width, height = options.max_width, options.height or console.height
        layout = Layout()
        heading = Layout(Group(self._head(), self._clock(width), self._stages(width)), size=_HEADING)
        if width < MAP_FROM[0] or height < MAP_FROM[1]:
            layout.split_column(heading, Layout(self._agents(width, height - _HEADING)))
            return [layout]
        below = min(12, max(5, (height - _HEADING) // 4))
        middle, side = height - _HEADING - below, min(56, max(26, round(width * 0.38)))
        coloured = console.color_system in ("256", "truecolor", "windows")
        chart = self._chart.lines(self._watched, width - side - 1, middle, coloured=coloured)
        body, news = Layout(), Layout(size=below)
        body.split_row(Layout(_joined(chart)), Layout(self._agents(side, middle), size=side))
        left = width * 3 // 5 + 1
        news.split_row(
            Layout(Padding(_latest("messages", self._watched.messages, below), (0, 1, 0, 0)), size=left),
            Layout(_latest("events", self._watched.events, below)),
        )
        layout.split_column(heading, body, news)
        return [layout]

    def _head(self) -> Table:
        watched = self._watched.instance
        left = Text(visible(f" {watched.title or watched.mission}"), style="bold", no_wrap=True, overflow="ellipsis")
        return _apart(left, Text(visible(f"{self._title} "), style="dim", no_wrap=True))

    def _clock(self, width: int) -> Text:
        watched = self._watched
        count = f" tick {watched.tick}/{watched.ticks} "
        rest = f" t={watched.time_s:.0f} s  {factor(watched.time_s, watched.wall_s)}  score {watched.score:.2f} "
        room = max(4, min(40, width - len(count) - len(rest) - 1))
        full = round(room * watched.tick / watched.ticks) if watched.ticks else 0
        bar = Text("━" * full, style="green").append("━" * (room - full), style="dim")
        return _line(Text(count), bar, Text(rest))

    def _stages(self, width: int) -> Table | Text:
        """Return the progress of the stages and, if there is room, the map's attribution and the meaning of the target
        signs.
        """
        line = Text(" ", no_wrap=True)
        for name, done, of in self._watched.stage_counts():
            line.append(f"{name} {done}/{of}  ", style="bold green" if done >= of else "bold" if done else "dim")
        signs = Text(visible(f"{self._credit} "), style="dim", no_wrap=True)
        for sight, (sign, ink) in TARGET_SIGNS.items():
            if sight != "truth" or self._watched.truth:
                signs.append(sign, style=_bold(ink)).append(f" {sight}  ", style="dim")
        return _apart(line, signs) if line.cell_len + signs.cell_len <= width else _line(line, signs)

    def _agents(self, width: int, height: int) -> Group:
        """Return two lines per agent if there is room, else one; agents that do not fit are counted."""
        agents = list(self._watched.agents.values())
        each = 2 if len(agents) * 2 <= height else 1
        shown = agents if len(agents) * each <= height else agents[: height - 1]
        rows = [line for agent in shown for line in self._agent(agent, each, width)]
        if len(shown) < len(agents):
            rows.append(Text(f"… and {len(agents) - len(shown)} more", style="dim"))
        return Group(*rows)

    def _agent(self, agent: AgentStatus, lines: int, width: int) -> list[Text]:
        held = next(spec.controls for spec in self._watched.instance.agents if spec.id == agent.agent)
        names = [asset.id for asset in self._watched.assets]
        ink = next((asset_ink(names.index(name)) for name in held if name in names), None)
        head = Text().append(agent.agent, style=_bold(ink)).append(" ")
        asset, _, verb = agent.command.partition(".")
        narrow = head.cell_len + len(agent.command) > width and len(held) == 1  # a single asset need not be named
        head.append(visible(verb if narrow and asset in held else agent.command))
        status = Text("  ").append(visible(agent.status), style="red" if agent.refused else "dim")
        return [_line(head, status)] if lines == 1 else [_line(head), _line(status)]


def _latest(name: str, notices: Iterable[TickerLine], height: int) -> Group:
    """Return a rule with a name, then the latest lines, the newest at the bottom."""
    latest = list(notices)[-(height - 1) :] if height > 1 else []
    lines = (
        _line(
            Text(f"{notice.tick:>3} ", style="dim"),
            Text(visible(notice.text), style="bold green" if notice.good else ""),
        )
        for notice in latest
    )
    return Group(Rule(f"─ {name}", align="left", style="dim"), *lines)


def _joined(lines: Sequence[Sequence[Segment]]) -> Segments:
    return Segments([part for line in lines for part in (*line, Segment.line())][:-1])


def _line(*parts: Text) -> Text:
    """Return one line, which ends in an ellipsis if it is too long."""
    line = Text(no_wrap=True, overflow="ellipsis")
    for part in parts:
        line.append_text(part)
    return line


def _apart(left: Text, right: Text) -> Table:
    """Return a line with text at both ends; the left text is shortened if there is no room."""
    table = Table.grid(expand=True)
    table.add_column(ratio=1, no_wrap=True, overflow="ellipsis")
    table.add_column(justify="right", no_wrap=True)
    table.add_row(left, right)
    return table


def _bold(ink: Ink | None) -> Style:
    return Style(bold=True) if ink is None else Style(bold=True, color=f"rgb({ink[0]},{ink[1]},{ink[2]})")
