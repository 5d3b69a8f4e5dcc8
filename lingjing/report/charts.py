"""Charts as drawings: lines over steps, bars, divided bars, a grid of shares. Each is as wide as a phone.

Series differ by tone, marker and dashes, values are written beside their bars, and intervals are whiskers.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import accumulate, pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from lingjing.report.drawing import LIGHT, SERIES, WIDE, Drawing, colour_of, marker_of
from lingjing.report.estimates import BoundedEstimate
from lingjing.report.text_layout import SMALL, USUAL, fitting, text_width

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from lingjing.report.painting import Canvas

FEW = 3
"""Most series of bars that share one legend; more have their names beside each bar, since more colours are hard
to tell apart."""

MARKER_SIZE = 9.0
"""Diameter of a marker in units."""

_NAME_WIDTH = 92.0
"""Largest width of the names beside bars, a quarter of a chart."""

_BAR_HEIGHT, _BAR_STEP = 12.0, 15.0
_HEADING_BASE, _HEADING_STEP = 16.0, 21.0
"""From the top of a group to the base line of its heading, and to its first bar."""
_PLOT_HEIGHT = 150.0
_CELL_WIDTH, _CELL_HEIGHT = 46.0, 24.0
_LABEL_WIDTH = 24.0
"""Narrower parts of a divided bar have no percentage."""
_LEGEND_LINE = 14.0
_DASHES = (0, (3.0, 2.0))
"""Line style of series beyond the number of tones, in multiples of the line's width."""


class ChartSeries(NamedTuple):
    """A series of a line chart."""

    name: str
    """Its name in the legend."""

    values: tuple[BoundedEstimate, ...]
    """An estimate for each step; an undefined one leaves a gap in the line."""

    number: int
    """Number of its tone and marker, the same in all charts of a study."""


class ChartBar(NamedTuple):
    """One bar of a group."""

    name: str
    """Name of its series."""

    series: int
    """Number of the tone of its series."""

    value: BoundedEstimate
    """Its length and its whisker."""


class BarGroup(NamedTuple):
    """Bars under one heading."""

    name: str
    """The heading."""

    bars: tuple[ChartBar, ...]
    """Its bars from top to bottom."""

    spec: str = ".0f"
    """Format of the values beside the bars."""

    most: float = math.nan
    """Value of a bar of full width; nan for the value that all groups share."""


class ShareBar(NamedTuple):
    """A bar that is divided into parts."""

    name: str
    """Its heading."""

    number: int
    """Number of things that it divides."""

    shares: tuple[float, ...]
    """Share (0 to 1) of each part, in the order of the parts."""


class Legend:
    """Names of numbered series beside their markers, in as many lines as the width of a chart requires."""

    def __init__(self, names: Sequence[tuple[int, str]], *, squares: bool = False) -> None:
        self._squares = squares
        self._entries: list[tuple[float, float, int, str]] = []
        x, y = 2.0, 12.0
        for number, name in names:
            text = fitting(name, WIDE - 24.0, SMALL)
            width = text_width(text, SMALL) + 26.0
            if x > 2.0 and x + width - 10.0 > WIDE:
                x, y = 2.0, y + _LEGEND_LINE
            self._entries.append((x, y, number, text))
            x += width
        self.height = y if names else 4.0
        """Height in units."""

    def paint(self, canvas: Canvas, axes: Axes) -> None:
        """Paint it at the top of a canvas, on axes that begin there."""
        for x, y, number, text in self._entries:
            marker = "s" if self._squares else marker_of(number)
            axes.plot([x + 5.0], [y - 4.0], marker, color=colour_of(number), markersize=MARKER_SIZE, clip_on=False)
            canvas.text(x + 13.0, y, text, size=SMALL)


# -- charts


def line_chart(
    title: str,
    steps: Sequence[str],
    series: Sequence[ChartSeries],
    *,
    below: str = "",
    unit: str = "",
    most: float | None = None,
    places: Sequence[float] = (),
) -> Drawing:
    """Return a chart of series over steps, which stand at equal distances or at `places` (rising numbers).

    `below` names the steps, and `unit` is that of the values. The scale ends at `most`, or above the highest value.
    """
    highest = max((_top(value) for line in series for value in line.values), default=0.0) if most is None else most
    ticks = _ticks(highest or 1.0)
    labels = [f"{tick:g} {unit}".strip() for tick in ticks]
    legend = Legend([(line.number, line.name) for line in series])
    top = legend.height + 12.0
    left = max(44.0, *(text_width(label, SMALL) + 8.0 for label in labels))
    width = WIDE - 14.0 - left
    positions = _positions(len(steps), places, 14.0, width - 14.0)
    names, lines = _step_names(steps, positions)
    height = top + _PLOT_HEIGHT + 11.0 + 11.0 * lines + (14.0 if below else 0.0)

    def paint(canvas: Canvas) -> None:
        legend.paint(canvas, canvas.axes(0.0, 0.0, WIDE, legend.height))
        axes = canvas.axes(left, top, width, _PLOT_HEIGHT)
        axes.set_ylim(0.0, ticks[-1])
        axes.set_yticks(ticks, labels)
        axes.grid(axis="y")
        for place, (x, name) in enumerate(zip(positions, names, strict=True)):
            half = text_width(name, SMALL) / 2
            middle = min(max(left + x, half + 1.0), WIDE - half - 1.0)
            down = 11.0 * (place % lines)
            canvas.text(middle, top + _PLOT_HEIGHT + 15.0 + down, name, size=SMALL, tone="faint", anchor="center")
        canvas.text(left + width / 2, height - 5.0, below, size=SMALL, tone="faint", anchor="center")
        for place, line in enumerate(series):
            shift = (place - (len(series) - 1) / 2) * min(5.0, 24.0 / len(series))  # keeps whiskers side by side
            xs, ys = [x + shift for x in positions], [value.value for value in line.values]
            dashes = _DASHES if line.number >= SERIES else "solid"
            axes.plot(xs, ys, color=colour_of(line.number), linewidth=2.0, linestyle=dashes, clip_on=False)
            lows, highs = ([end for _, end in each] for each in (_ends(line, "low"), _ends(line, "high")))
            axes.vlines([xs[at] for at, _ in _ends(line, "low")], lows, highs, colors=colour_of(line.number),
                        linewidth=1.2, alpha=0.55, clip_on=False)  # fmt: skip
            for x, value in zip(xs, line.values, strict=True):
                if value.known:
                    (marker,) = axes.plot([x], [value.value], marker_of(line.number), color=colour_of(line.number),
                                          markersize=MARKER_SIZE, clip_on=False)  # fmt: skip
                    canvas.tooltip(marker, _value_words(line.name, value.number, value.text(".4g"), unit))

    words = _series_words(steps, series, unit)
    return Drawing(title=title, description=words, width=WIDE, height=height, paint=paint)


def bar_chart(
    title: str, groups: Sequence[BarGroup], *, unit: str = "", most: float | None = None, lone: bool = False
) -> Drawing:
    """Return a chart of horizontal bars with their values and intervals, in groups one below the other.

    A bar of full width is worth `most`, or the highest value of all. More than `FEW` series are named beside their
    bars. A single series is named if it is `lone`, for charts with titles and headings that do not name it.
    """
    series = _names(groups, lone=lone)
    legend = Legend(series if len(series) <= FEW else [])
    bars = [(bar, group.spec) for group in groups for bar in group.bars]
    whole = (max((_top(bar.value) for bar, _ in bars), default=0.0) if most is None else most) or 1.0
    left = 2.0
    if len(series) > FEW:
        left += min(max(text_width(name, SMALL) for _, name in series), _NAME_WIDTH) + 6.0
    right = WIDE - max((text_width(bar.value.text(spec), SMALL) for bar, spec in bars), default=0.0) - 12.0
    placed, height = _placed_bars(groups, legend.height + 4.0, whole)

    def paint(canvas: Canvas) -> None:
        axes = canvas.axes(0.0, 0.0, WIDE, height)
        legend.paint(canvas, axes)
        y = legend.height + 4.0
        for group in groups:
            canvas.text(2.0, y + _HEADING_BASE, fitting(group.name, WIDE - 4.0))
            y += _HEADING_STEP + _BAR_STEP * len(group.bars)
        for each in placed:
            if left > 2.0:
                canvas.text(2.0, each.y + 10.0, fitting(each.bar.name, _NAME_WIDTH, SMALL), size=SMALL)
            x, tone = (right + 6.0, "ink") if each.bar.value.known else (left + 2.0, "faint")
            canvas.text(x, each.y + 10.0, each.text, size=SMALL, tone=tone)
        _paint_bars(canvas, axes, (left, right), [each for each in placed if each.bar.value.known], unit)

    words = "; ".join(_group_words(group, unit) for group in groups)
    return Drawing(title=title, description=words, width=WIDE, height=height, paint=paint)


def share_chart(title: str, parts: Sequence[str], bars: Sequence[ShareBar]) -> Drawing:
    """Return a chart of bars that are divided into parts, with percentages in the parts that have room for them."""
    legend = Legend(list(enumerate(parts)), squares=True)
    whole, height = WIDE - 4.0, legend.height + 8.0 + 43.0 * len(bars)

    def paint(canvas: Canvas) -> None:
        axes = canvas.axes(0.0, 0.0, WIDE, height)
        legend.paint(canvas, axes)
        for number, bar in enumerate(bars):
            y = legend.height + 4.0 + 43.0 * number
            canvas.text(2.0, y + _HEADING_BASE, fitting(f"{bar.name}, n = {bar.number}", WIDE - 4.0))
            edges = [2.0 + whole * share for share in (0.0, *accumulate(bar.shares))]
            for at, (part, share) in enumerate(zip(parts, bar.shares, strict=True)):
                if share <= 0.0:
                    continue
                (patch,) = axes.barh(y + 30.0, whole * share, 18.0, left=edges[at], color=colour_of(at),
                                     edgecolor=LIGHT["paper"], linewidth=1.0)  # fmt: skip
                canvas.tooltip(patch, f"{bar.name}: {part} {100 * share:.0f} %")
                if whole * share > _LABEL_WIDTH:
                    middle, label = edges[at] + whole * share / 2, f"{100 * share:.0f}"
                    canvas.text(middle, y + 34.0, label, size=SMALL, tone="paper", anchor="center", bold=True)

    words = "; ".join(f"{bar.name}, {bar.number}: {_share_words(parts, bar)}" for bar in bars)
    return Drawing(title=title, description=words, width=WIDE, height=height, paint=paint)


def share_grid(title: str, heads: Sequence[str], lines: Sequence[tuple[str, Sequence[float]]]) -> Drawing:
    """Return a grid of percentages; the higher one is, the deeper its colour. A dash stands for nan."""
    left = min(max((text_width(name, USUAL) for name, _ in lines), default=0.0) + 12.0, 190.0)
    width, height = left + _CELL_WIDTH * len(heads) + 4.0, 28.0 + _CELL_HEIGHT * len(lines)

    def paint(canvas: Canvas) -> None:
        for column, head in enumerate(heads):
            middle = left + _CELL_WIDTH * (column + 0.5)
            canvas.text(middle, 16.0, fitting(head.replace("^", " "), _CELL_WIDTH, SMALL), size=SMALL, tone="faint",
                        anchor="center")  # fmt: skip
        axes = canvas.axes(left, 0.0, width - left, height)
        for row, (name, values) in enumerate(lines):
            y = 24.0 + _CELL_HEIGHT * row
            canvas.text(2.0, y + 16.0, fitting(name, left - 8.0))
            middles = [_CELL_WIDTH * (column + 0.5) for column in range(len(values))]
            colours = [LIGHT["panel"] if math.isnan(value) else (colour_of(0), 0.06 + 0.5 * value / 100)
                       for value in values]  # fmt: skip
            cells = axes.bar(middles, _CELL_HEIGHT - 2.0, _CELL_WIDTH - 2.0, bottom=y, color=colours)
            for head, value, x, cell in zip(heads, values, middles, cells, strict=True):
                known = not math.isnan(value)
                canvas.tooltip(cell, f"{name}, {head}: {f'{value:.0f} %' if known else 'not played'}")
                canvas.text(left + x, y + 15.0, f"{value:.0f}" if known else "–", tone="ink" if known else "faint",
                            anchor="center")  # fmt: skip

    words = "; ".join(f"{name}: {_known_words(heads, values)}" for name, values in lines)
    return Drawing(title=title, description=words, width=width, height=height, paint=paint, wide=width > WIDE)


# -- parts of charts


class _PlacedBar(NamedTuple):
    """A bar of a chart of bars, with its upper edge at y. `whole` is the value of a bar of full width."""

    bar: ChartBar
    y: float
    text: str
    whole: float


def _placed_bars(groups: Sequence[BarGroup], y: float, whole: float) -> tuple[list[_PlacedBar], float]:
    """Return all bars from y downwards, below the headings of their groups, and the height of the chart."""
    placed = []
    for group in groups:
        y += _HEADING_STEP
        for bar in group.bars:
            own = whole if math.isnan(group.most) else group.most or 1.0
            placed.append(_PlacedBar(bar, y, bar.value.text(group.spec), own))
            y += _BAR_STEP
    return placed, y + 6.0


def _paint_bars(canvas: Canvas, axes: Axes, ends: tuple[float, float], placed: Sequence[_PlacedBar], unit: str) -> None:
    """Paint bars on tracks between two ends, with whiskers; all of a chart at once, which matplotlib does faster."""
    left, width = ends[0], ends[1] - ends[0]
    values = np.array([each.bar.value[:3] for each in placed], dtype=np.float64).reshape(-1, 3)
    wholes = np.array([each.whole for each in placed], dtype=np.float64).reshape(-1, 1)
    value, low, high = (width * np.clip(values / wholes, 0.0, 1.0)).T
    middles = [each.y + _BAR_HEIGHT / 2 for each in placed]
    colours = [colour_of(each.bar.series) for each in placed]
    axes.barh(middles, width, _BAR_HEIGHT, left=left, color=LIGHT["panel"])
    patches = axes.barh(middles, np.maximum(value, 1.0), _BAR_HEIGHT, left=left, color=colours)
    for each, patch in zip(placed, patches, strict=True):
        canvas.tooltip(patch, _value_words(each.bar.name, each.bar.value.number, each.text, unit))
    axes.errorbar(left + value, middles, xerr=np.maximum([value - low, high - value], 0.0), fmt="none",
                  ecolor=LIGHT["ink"], elinewidth=1.2, capthick=1.2, clip_on=False)  # fmt: skip


def _ends(series: ChartSeries, end: str) -> Iterator[tuple[int, float]]:
    """Yield the index and one end of each interval, those below 0 as 0."""
    for at, value in enumerate(series.values):
        if value.known and not math.isnan(value.low):
            yield at, max(getattr(value, end), 0.0)


def _ticks(highest: float) -> list[float]:
    """Return about five round numbers from 0 to the highest value or just above it."""
    from matplotlib.ticker import MaxNLocator

    ticks = MaxNLocator(4, steps=[1, 2, 2.5, 5, 10]).tick_values(0.0, highest)
    return [float(tick) for tick in ticks if tick >= 0.0]


def _step_names(steps: Sequence[str], positions: Sequence[float]) -> tuple[list[str], int]:
    """Return the names of steps as they fit, and in how many lines they stand: two if they would touch in one."""
    apart = min((after - before for before, after in pairwise(positions)), default=WIDE)
    lines = 1 + (max((text_width(step, SMALL) for step in steps), default=0.0) > apart - 4.0)
    room = max(lines * apart - 4.0, 20.0)
    return [fitting(step, room, SMALL) for step in steps], lines


def _positions(count: int, places: Sequence[float], left: float, right: float) -> list[float]:
    """Return where steps stand between two ends: at equal distances, or in proportion to their places."""
    if count == 1:
        return [(left + right) / 2]
    values = places or [float(number) for number in range(count)]
    low, high = min(values, default=0.0), max(values, default=1.0)
    return [left + (right - left) * (value - low) / (high - low or 1.0) for value in values]


def _names(groups: Sequence[BarGroup], *, lone: bool) -> list[tuple[int, str]]:
    """Return the numbers and names of the series, none if there is a single one that needs no name."""
    names = {bar.series: bar.name for group in groups for bar in group.bars}
    return sorted(names.items()) if lone or len(names) > 1 else []


def _top(value: BoundedEstimate) -> float:
    return max((end for end in (value.value, value.high) if not math.isnan(end)), default=0.0)


# -- charts in words


def _value_words(name: str, number: int, text: str, unit: str) -> str:
    return f"{name}: {f'{text} {unit}'.strip()} (n = {number})"


def _series_words(steps: Sequence[str], series: Sequence[ChartSeries], unit: str) -> str:
    return "; ".join(
        f"{line.name}: " + ", ".join(f"{step} {value.text('.4g')} {unit}".rstrip()
                                    for step, value in zip(steps, line.values, strict=True))
        for line in series
    )  # fmt: skip


def _group_words(group: BarGroup, unit: str) -> str:
    values = ", ".join(f"{bar.name} {bar.value.text(group.spec)} {unit}".strip() for bar in group.bars)
    return f"{group.name}: {values}"


def _share_words(parts: Sequence[str], bar: ShareBar) -> str:
    return ", ".join(f"{part} {100 * share:.0f} %" for part, share in zip(parts, bar.shares, strict=True) if share)


def _known_words(heads: Sequence[str], values: Sequence[float]) -> str:
    pairs = zip(heads, values, strict=True)
    return ", ".join(f"{head} {value:.0f} %" for head, value in pairs if not math.isnan(value))


__all__ = [
    "BarGroup", "ChartBar", "ChartSeries", "Legend", "ShareBar", "bar_chart", "line_chart", "share_chart", "share_grid",
]  # fmt: skip
