"""Charts as drawings: lines over steps, bars, stacked bars, a grid of shares. Each is as wide as a phone; several stand
beside each other where there is room.

Series differ by tone, marker and dashes alike, values stand beside their marks, and intervals are whiskers.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import NamedTuple

from lingjing.analysis.fonts import font, lacking
from lingjing.report.drawing import (
    SERIES,
    Drawing,
    DrawnMark,
    PaneMark,
    SpotMark,
    StrokeMark,
    WordsMark,
    shape_of,
    tone_of,
)
from lingjing.report.estimates import BoundedEstimate

WIDE = 360.0
"""The width of a chart: a phone's, so that letters are read there as on a desk."""

FEW = 3
"""More series of bars than this have their names beside them."""

_SMALL, _USUAL = 10.0, 11.0
_NAME = 92.0
_ROW, _BAR = 17.0, 12.0


class ChartSeries(NamedTuple):
    """A named series: an estimate for each step, and the number that its tone and marker have in all charts."""

    name: str
    values: tuple[BoundedEstimate, ...]
    number: int


class ChartBar(NamedTuple):
    """One bar: its name among those of its group, the tone's number, the value."""

    name: str
    series: int
    value: BoundedEstimate


class BarGroup(NamedTuple):
    """Bars under one heading; `most` is the value of a whole width, nan for that of all groups."""

    name: str
    bars: tuple[ChartBar, ...]
    spec: str = ".0f"
    most: float = math.nan


class ShareBar(NamedTuple):
    """A bar that is divided: its name, how many it is over, the share (0..1) of each part in order."""

    name: str
    number: int
    shares: tuple[float, ...]


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
    """Series over steps that stand at equal distances, or at `places` (numbers that rise).

    `below` says what the steps are, `unit` is that of values; the scale goes from 0 to `most`, or as far as it must.
    """
    highest = max((_top(value) for one in series for value in one.values), default=1.0)
    scale = _rounded(highest) if most is None else most
    marks, top = legend([(one.number, one.name) for one in series], 12.0)
    left, right, high = 44.0, WIDE - 14.0, 150.0
    bottom = top + 12.0 + high
    marks += _grid(left, right, bottom, high, scale, unit)
    where = _places(len(steps), places, left + 14.0, right - 14.0)

    def height(value: float) -> float:
        return bottom - high * min(value, scale) / scale

    for at, one in enumerate(series):
        shift = (at - (len(series) - 1) / 2) * min(5.0, 24.0 / len(series))  # whiskers beside each other
        marks += _line(one, [x + shift for x in where], height, unit)
    names, end = _steps(steps, where, bottom + 15.0)
    marks += names
    if below:
        end += 14.0
        marks.append(
            WordsMark(x=(left + right) / 2, y=end - 5.0, text=below, size=_SMALL, anchor="middle", tone="faint")
        )
    return Drawing(title=title, description=_series_words(steps, series, unit), width=WIDE, height=end, marks=(*marks,))


def bar_chart(
    title: str, groups: Sequence[BarGroup], *, unit: str = "", most: float | None = None, lone: bool = False
) -> Drawing:
    """Bars of groups under each other, all with their values and intervals. Of more than `FEW` series each bar has its
    name beside it, so that no colour must be told from many others. A `lone` series is named too, which is of use where
    neither title nor groups say whose bars they are."""
    series = _names(groups, lone=lone)
    marks, y = legend(series if len(series) <= FEW else [], 12.0)
    y += 4.0
    bars = [(bar, group.spec) for group in groups for bar in group.bars]
    whole = max((_top(bar.value) for bar, _ in bars), default=0.0) or 1.0 if most is None else most
    left = 2.0
    if len(series) > FEW:
        left += min(max(text_width(name, _SMALL) for _, name in series), _NAME) + 6.0
    room = max((text_width(bar.value.text(spec), _SMALL) for bar, spec in bars), default=0.0) + 12.0
    for group in groups:
        y += 16.0
        marks.append(WordsMark(x=2.0, y=y, text=fitting(group.name, WIDE - 4.0), size=_USUAL))
        y += 5.0
        limit = whole if math.isnan(group.most) else group.most or 1.0
        for bar in group.bars:
            if left > 2.0:
                marks.append(WordsMark(x=2.0, y=y + 10.0, text=fitting(bar.name, _NAME, _SMALL), size=_SMALL))
            marks += _bar(bar, group.spec, y, (left, WIDE - room), limit, unit)
            y += _ROW - 2.0
    words = "; ".join(_group_words(group, unit) for group in groups)
    return Drawing(title=title, description=words, width=WIDE, height=y + 6.0, marks=(*marks,))


def share_chart(title: str, parts: Sequence[str], bars: Sequence[ShareBar]) -> Drawing:
    """Bars that are divided into parts, percentages written where there is room."""
    marks, y = legend(list(enumerate(parts)), 12.0, squares=True)
    y += 4.0
    for bar in bars:
        y += 16.0
        marks.append(WordsMark(x=2.0, y=y, text=fitting(f"{bar.name}, n = {bar.number}", WIDE - 4.0), size=_USUAL))
        y += 5.0
        x = 2.0
        for number, share in enumerate(bar.shares):
            wide = (WIDE - 4.0) * share
            if wide <= 0.0:
                continue
            told = f"{bar.name}: {parts[number]} {100 * share:.0f} %"
            marks.append(PaneMark(x=x, y=y, width=max(wide - 1.0, 0.5), height=18.0, tone=tone_of(number), told=told))
            if wide > 24.0:
                percent = f"{100 * share:.0f}"
                marks.append(WordsMark(x=x + wide / 2, y=y + 13.0, text=percent, size=_SMALL, anchor="middle",
                                       tone="paper", bold=True))  # fmt: skip
            x += wide
        y += 22.0
    words = "; ".join(
        f"{bar.name}, {bar.number}: " + ", ".join(f"{name} {100 * share:.0f} %"
                                                for name, share in zip(parts, bar.shares, strict=True) if share)
        for bar in bars
    )  # fmt: skip
    return Drawing(title=title, description=words, width=WIDE, height=y + 4.0, marks=(*marks,))


def share_grid(title: str, heads: Sequence[str], lines: Sequence[tuple[str, Sequence[float]]]) -> Drawing:
    """Percentages in a grid, the deeper the colour the higher; nan is a dash."""
    left = min(max((text_width(name, _USUAL) for name, _ in lines), default=0.0) + 12.0, 190.0)
    wide, high = 46.0, 24.0
    marks: list[DrawnMark] = [
        WordsMark(x=left + wide * (at + 0.5), y=16.0, text=head.replace("^", " "), size=_SMALL, anchor="middle",
                  tone="faint")
        for at, head in enumerate(heads)
    ]  # fmt: skip
    for row, (name, values) in enumerate(lines):
        y = 24.0 + row * high
        marks.append(WordsMark(x=2.0, y=y + 16.0, text=fitting(name, left - 8.0), size=_USUAL))
        for at, value in enumerate(values):
            x, known = left + at * wide, not math.isnan(value)
            deep = 0.06 + 0.5 * value / 100 if known else 0.0
            told = f"{name}, {heads[at]}: {f'{value:.0f} %' if known else 'not played'}"
            marks.append(PaneMark(x=x + 1, y=y, width=wide - 2, height=high - 2, tone="heat" if known else "panel",
                                  opacity=deep or 1.0, told=told))  # fmt: skip
            marks.append(WordsMark(x=x + wide / 2, y=y + 15.0, text=f"{value:.0f}" if known else "–", size=_USUAL,
                                   anchor="middle", tone="ink" if known else "faint"))  # fmt: skip
    words = "; ".join(
        f"{name}: " + ", ".join(f"{head} {value:.0f} %" for head, value in zip(heads, values, strict=True)
                                if not math.isnan(value))
        for name, values in lines
    )  # fmt: skip
    width = left + wide * len(heads) + 4.0
    height = 24.0 + high * len(lines) + 4.0
    return Drawing(title=title, description=words, width=width, height=height, marks=(*marks,), wide=width > WIDE)


# -- parts of charts


def _line(one: ChartSeries, places: Sequence[float], height: Callable[[float], float], unit: str) -> list[DrawnMark]:
    tone, marks = tone_of(one.number), list[DrawnMark]()
    runs: list[list[tuple[float, float]]] = [[]]
    for x, value in zip(places, one.values, strict=True):
        if value.known:
            runs[-1].append((x, height(value.value)))
        elif runs[-1]:
            runs.append([])
    for run in runs:
        if len(run) > 1:
            marks.append(StrokeMark(points=tuple(run), tone=tone, width=2.0, dashed=one.number >= SERIES))
    for x, value in zip(places, one.values, strict=True):
        if value.known and not math.isnan(value.low):
            ends = ((x, height(max(value.low, 0.0))), (x, height(value.high)))
            marks.append(StrokeMark(points=ends, tone=tone, width=1.2, opacity=0.55))
    for x, value in zip(places, one.values, strict=True):
        if value.known:
            told = f"{one.name}: {value.text('.4g')} {unit} (n = {value.number})".replace("  ", " ")
            marks.append(SpotMark(x=x, y=height(value.value), tone=tone, shape=shape_of(one.number), told=told))
    return marks


def _bar(bar: ChartBar, spec: str, y: float, ends: tuple[float, float], whole: float, unit: str) -> list[DrawnMark]:
    """A bar on its track, which reaches from the one end to the other."""
    value, tone, (left, right) = bar.value, tone_of(bar.series), ends
    text = value.text(spec)
    if not value.known:
        return [WordsMark(x=left + 2.0, y=y + 10.0, text=text, size=_SMALL, tone="faint")]

    def place(number: float) -> float:
        return left + (right - left) * min(max(number, 0.0), whole) / whole

    told = f"{bar.name}: {text} {unit} (n = {value.number})".replace("  ", " ")
    long = max(place(value.value) - left, 1.0)
    marks: list[DrawnMark] = [
        PaneMark(x=left, y=y, width=right - left, height=_BAR, tone="panel"),
        PaneMark(x=left, y=y, width=long, height=_BAR, tone=tone, told=told),
    ]
    if not math.isnan(value.low):
        low, high, middle = place(value.low), place(value.high), y + _BAR / 2
        marks += [
            StrokeMark(points=((low, middle), (high, middle)), tone="ink", width=1.2),
            *(StrokeMark(points=((x, middle - 3.0), (x, middle + 3.0)), tone="ink", width=1.2) for x in (low, high)),
        ]
    marks.append(WordsMark(x=right + 6.0, y=y + 10.0, text=text, size=_SMALL))
    return marks


def _grid(left: float, right: float, bottom: float, high: float, scale: float, unit: str) -> list[DrawnMark]:
    marks: list[DrawnMark] = []
    for part in range(5):
        y, value = bottom - high * part / 4, scale * part / 4
        marks.append(StrokeMark(points=((left, y), (right, y)), tone="rule", width=1.0))
        text = f"{value:.3g}" + (f" {unit}" if part == 4 and unit else "")
        marks.append(WordsMark(x=left - 4.0, y=y + 4.0, text=text, size=_SMALL, anchor="end", tone="faint"))
    return marks


def _steps(steps: Sequence[str], where: Sequence[float], y: float) -> tuple[list[DrawnMark], float]:
    """The names of steps, in two lines where they would touch; and where they end."""
    apart = min((after - before for before, after in pairwise(where)), default=WIDE)
    longest = max((text_width(step, _SMALL) for step in steps), default=0.0)
    crowded = longest > apart - 4.0
    marks: list[DrawnMark] = []
    for number, (step, x) in enumerate(zip(steps, where, strict=True)):
        text = fitting(step, 2 * apart - 6.0 if crowded else max(apart - 2.0, 20.0), _SMALL)
        half = text_width(text, _SMALL) / 2
        middle = min(max(x, half + 1.0), WIDE - half - 1.0)
        down = 11.0 if crowded and number % 2 else 0.0
        marks.append(WordsMark(x=middle, y=y + down, text=text, size=_SMALL, anchor="middle", tone="faint"))
    return marks, y + (18.0 if crowded else 7.0)


def _places(count: int, given: Sequence[float], left: float, right: float) -> list[float]:
    if count == 1:
        return [(left + right) / 2]
    low, high = (min(given), max(given)) if given else (0.0, count - 1.0)
    values = given or [float(number) for number in range(count)]
    return [left + (right - left) * (value - low) / (high - low or 1.0) for value in values]


def legend(names: Sequence[tuple[int, str]], y: float, *, squares: bool = False) -> tuple[list[DrawnMark], float]:
    """What the tones and markers of numbered series mean, in as many lines as it takes; and where it ends."""
    if not names:
        return [], y - 8.0
    marks: list[DrawnMark] = []
    x = 2.0
    for number, name in names:
        text = fitting(name, WIDE - 24.0, _SMALL)
        wide = text_width(text, _SMALL) + 26.0
        if x > 2.0 and x + wide - 10.0 > WIDE:
            x, y = 2.0, y + 14.0
        shape = "square" if squares else shape_of(number)
        marks.append(SpotMark(x=x + 5.0, y=y - 4.0, tone=tone_of(number), shape=shape))
        marks.append(WordsMark(x=x + 13.0, y=y, text=text, size=_SMALL))
        x += wide
    return marks, y


def _names(groups: Sequence[BarGroup], *, lone: bool) -> list[tuple[int, str]]:
    """The series by their numbers, as far as they need a legend."""
    found = {bar.series: bar.name for group in groups for bar in group.bars}
    return sorted(found.items()) if lone or len(found) > 1 else []


def _top(value: BoundedEstimate) -> float:
    return max((each for each in (value.value, value.high) if not math.isnan(each)), default=0.0)


def _rounded(highest: float) -> float:
    """A round number that is at least so high."""
    if highest <= 0.0:
        return 1.0
    unit = 10.0 ** math.floor(math.log10(highest))
    return next(step * unit for step in (1.0, 1.2, 1.6, 2.0, 3.0, 4.0, 6.0, 8.0, 10.0) if step * unit >= highest)


def _series_words(steps: Sequence[str], series: Sequence[ChartSeries], unit: str) -> str:
    return "; ".join(
        f"{one.name}: " + ", ".join(f"{step} {value.text('.4g')} {unit}".rstrip()
                                    for step, value in zip(steps, one.values, strict=True))
        for one in series
    )  # fmt: skip


def _group_words(group: BarGroup, unit: str) -> str:
    told = ", ".join(f"{bar.name} {bar.value.text(group.spec)} {unit}".strip() for bar in group.bars)
    return f"{group.name}: {told}"


def text_width(text: str, size: float, *, bold: bool = False) -> float:
    """How wide a line of text is in DejaVu Sans; letters that it lacks are as wide as Chinese ones, whatever fonts are
    here."""
    other = set(lacking(text))
    own = "".join(letter for letter in text if letter not in other)
    return font(round(4 * size), bold=bold).getlength(own) / 4 + size * (len(text) - len(own))


def fitting(text: str, wide: float, size: float = _USUAL, *, bold: bool = False) -> str:
    """The text in one line, cut where it would be wider."""
    line = " ".join(text.split())
    if text_width(line, size, bold=bold) <= wide:
        return line
    while line and text_width(f"{line}…", size, bold=bold) > wide:
        line = line[:-1]
    return f"{line}…"


def wrapped(text: str, wide: float, size: float = _USUAL, *, bold: bool = False) -> list[str]:
    """The text in lines no wider than that, broken between words where it can be."""
    lines = [""]
    for word in text.split():
        longer = f"{lines[-1]} {word}".strip()
        if text_width(longer, size, bold=bold) <= wide:
            lines[-1] = longer
        else:
            lines.append(fitting(word, wide, size, bold=bold))
    return [line for line in lines if line]


__all__ = [
    "WIDE", "BarGroup", "ChartBar", "ChartSeries", "ShareBar", "bar_chart", "fitting", "legend", "line_chart",
    "share_chart", "share_grid", "text_width", "wrapped",
]  # fmt: skip
