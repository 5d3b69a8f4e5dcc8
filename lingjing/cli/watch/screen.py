"""The whole screen of a watched episode for any size from 40 by 10 cells: heading, map, agents, tickers."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise

from rich.console import Console, ConsoleOptions, RenderResult
from rich.segment import Segment
from rich.style import Style
from rich.text import Text

from lingjing.cli.progress import factor
from lingjing.cli.watch.chart import SIGHTS, Chart, Colour, asset_colour
from lingjing.cli.watch.state import Doing, Line, Watched
from lingjing.terminal import visible

MAP_FROM = (56, 16)
"""Columns and rows from which on there is room for a map."""
_HEADING = 3
_RULE = Style(dim=True)

Row = list[Segment]


class Screen:
    """A rich renderable that fills the terminal with the episode as it stands."""

    def __init__(self, watched: Watched, chart: Chart, title: str, credit: str = "") -> None:
        self._watched = watched
        self._chart = chart
        self._title = title
        self._credit = credit

    def __rich_console__(self, console: Console, options: ConsoleOptions) -> RenderResult:
        width, height = options.max_width, options.height or console.height
        rows = self._rows(width, height, coloured=console.color_system in ("256", "truecolor", "windows"))
        for at, row in enumerate(rows[:height]):
            if at:
                yield Segment.line()
            yield from Segment.adjust_line_length(row, width)

    def _rows(self, width: int, height: int, *, coloured: bool) -> list[Row]:
        heading = [_row(text, width) for text in (self._head(width), self._clock(width), self._stages(width))]
        if width < MAP_FROM[0] or height < MAP_FROM[1]:
            return heading + self._agents(width, height - _HEADING)
        ticker = min(12, max(5, (height - _HEADING) // 4))
        middle = height - _HEADING - ticker
        side = min(56, max(26, round(width * 0.38)))
        chart = self._chart.lines(self._watched, width - side - 1, middle, coloured=coloured)
        beside = self._agents(side, middle)
        body = [[*left, Segment(" "), *right] for left, right in zip(chart, beside, strict=True)]
        return heading + body + self._tickers(width, ticker)

    def _head(self, width: int) -> Text:
        watched = self._watched.instance
        left = Text(visible(f" {watched.title or watched.mission}"), style="bold")
        right = Text(visible(f"{self._title} "), style="dim")
        return _apart(left, right, width)

    def _clock(self, width: int) -> Text:
        watched = self._watched
        count = f" tick {watched.tick}/{watched.ticks} "
        rest = f" t={watched.time_s:.0f} s  {factor(watched.time_s, watched.wall_s)}  score {watched.score:.2f} "
        room = max(4, min(40, width - len(count) - len(rest) - 1))
        full = round(room * watched.tick / watched.ticks) if watched.ticks else 0
        bar = Text("━" * full, style="green").append("━" * (room - full), style="dim")
        return Text(count).append_text(bar).append(rest)

    def _stages(self, width: int) -> Text:
        """How far each stage is; then, as far as there is room, whose map it is and what the signs of targets mean."""
        line = Text(" ")
        for name, done, of in self._watched.stage_counts():
            line.append(f"{name} {done}/{of}  ", style="bold green" if done >= of else "bold" if done else "dim")
        signs = Text(visible(f"{self._credit} "), style="dim")
        for sight, (sign, colour) in SIGHTS.items():
            if sight != "truth" or self._watched.truth:
                signs.append(sign, style=_ink(colour)).append(f" {sight}  ", style="dim")
        return _apart(line, signs, width) if line.cell_len + signs.cell_len <= width else line.append_text(signs)

    def _agents(self, width: int, height: int) -> list[Row]:
        """Two lines an agent where there is room, else one; agents that do not fit are counted."""
        doing = list(self._watched.doing.values())
        each = 2 if len(doing) * 2 <= height else 1
        shown = doing if len(doing) * each <= height else doing[: height - 1]
        rows = [row for one in shown for row in self._agent(one, each, width)]
        if len(shown) < len(doing):
            rows.append(_row(Text(f"… and {len(doing) - len(shown)} more", style="dim"), width))
        return [*rows, *([Segment(" " * width)] for _ in range(height - len(rows)))][:height]

    def _agent(self, one: Doing, lines: int, width: int) -> list[Row]:
        head = Text().append(one.agent, style=_ink(self._colour(one.agent))).append(" ")
        asset, _, what = one.command.partition(".")
        narrow = head.cell_len + len(one.command) > width and len(self._held(one.agent)) == 1
        head.append(visible(what if narrow and asset in self._held(one.agent) else one.command))
        status = Text("  ").append(visible(one.status), style="red" if one.refused else "dim")
        if lines == 1:
            return [_row(head.append_text(status), width)]
        return [_row(head, width), _row(status, width)]

    def _colour(self, agent: str) -> Colour | None:
        """That of the first asset an agent controls."""
        names = [asset.id for asset in self._watched.assets]
        held = next((names.index(name) for name in self._held(agent) if name in names), None)
        return None if held is None else asset_colour(held)

    def _held(self, agent: str) -> tuple[str, ...]:
        """The assets that it controls; where there is but one, narrow lines need not name it."""
        return next(spec.controls for spec in self._watched.instance.agents if spec.id == agent)

    def _tickers(self, width: int, height: int) -> list[Row]:
        left = width * 3 // 5
        right = width - left - 1
        columns = (
            _ticker("messages", self._watched.messages, left, height),
            _ticker("events", self._watched.events, right, height),
        )
        return [[*a, Segment(" "), *b] for a, b in zip(*columns, strict=True)]


def _ticker(name: str, lines: Iterable[Line], width: int, height: int) -> list[Row]:
    """A rule with a name, then the latest lines, the newest at the bottom."""
    rule = [Segment(f"─ {name} ".ljust(width, "─")[:width], _RULE)]
    latest = list(lines)[-(height - 1) :] if height > 1 else []
    rows = [_row(_said(line), width) for line in latest]
    return [rule, *rows, *([Segment(" " * width)] for _ in range(height - 1 - len(rows)))]


def _said(line: Line) -> Text:
    return (
        Text()
        .append(f"{line.tick:>3} ", style="dim")
        .append(visible(line.text), style="bold green" if line.good else "")
    )


def _apart(left: Text, right: Text, width: int) -> Text:
    """Both ends of a line; the left one gives way."""
    left.truncate(max(0, width - right.cell_len - 1), overflow="ellipsis")
    return left.append(" " * max(1, width - left.cell_len - right.cell_len)).append_text(right)


def _ink(colour: Colour | None) -> Style:
    return Style(bold=True) if colour is None else Style(bold=True, color=f"rgb({colour[0]},{colour[1]},{colour[2]})")


def _row(text: Text, width: int) -> Row:
    """Exactly `width` cells: cut with an ellipsis, or padded."""
    text.truncate(width, overflow="ellipsis", pad=True)
    base, spans = Style.null(), []
    for span in text.spans:
        style = Style.parse(span.style) if isinstance(span.style, str) else span.style
        spans.append((span.start, span.end, style))
    whole = Style.parse(text.style) if isinstance(text.style, str) else text.style
    return _segments(text.plain, base + whole, spans)


def _segments(plain: str, base: Style, spans: Sequence[tuple[int, int, Style]]) -> Row:
    """The text cut where a style begins or ends."""
    cuts = sorted({0, len(plain), *(at for start, end, _ in spans for at in (start, end) if at <= len(plain))})
    row = []
    for start, end in pairwise(cuts):
        style = base
        for first, last, own in spans:
            if first <= start and end <= last:
                style = style + own
        row.append(Segment(plain[start:end], style))
    return row
