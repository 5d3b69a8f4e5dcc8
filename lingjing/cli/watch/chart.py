"""The map of a watched episode in characters.

A cell of the terminal holds two by four braille dots, which are about square. The ground below them is painted in half
blocks, two pixels per cell. Shapes are painted four times as fine and averaged, so that a street narrower than a pixel
is visible. Without colours there is no ground: streets and shores are drawn as dots.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

from PIL import Image, ImageDraw
from rich.color import Color
from rich.segment import Segment
from rich.style import Style

from lingjing.mission.geometry2d import Extent, Vector2
from lingjing.scene.city import City
from lingjing.scene.plan import PlanShape, ground_plan, is_sea
from lingjing.viewer.frames import Ink
from lingjing.viewer.state import EpisodeState, TargetStatus

LAND: Ink = (30, 32, 36)
"""RGB colour of land. The colours of this module are chosen."""

_GREEN: Ink = (30, 48, 33)
_PAVED: Ink = (40, 42, 46)
GROUND: dict[str, Ink] = {
    "water": (18, 44, 66), "land": LAND, "slab": (36, 38, 42), "path": (50, 52, 56), "road": (84, 88, 96),
    "solid": (48, 50, 54), "bridge": (96, 98, 102), "building": (66, 58, 52), "pipe": (120, 100, 70),
    "sand": (58, 53, 40), "park": _GREEN, "grass": _GREEN, "forest": _GREEN, "pitch": _GREEN, "plaza": _PAVED,
    "sidewalk": _PAVED, "parking": _PAVED, "asphalt": _PAVED, "concrete": _PAVED,
}  # fmt: skip
"""Colour of each layer or surface of the plan; a layer without a colour is not painted."""

ASSETS: tuple[Ink, ...] = (
    (86, 180, 255), (255, 158, 94), (190, 150, 255), (94, 226, 200), (240, 214, 96), (255, 130, 190), (160, 226, 96),
    (200, 208, 220),
)  # fmt: skip
"""Colours of the assets, in their order; they repeat."""

REGION: Ink = (70, 150, 170)
"""Colour of the outlines of regions."""

TARGET_SIGNS: dict[TargetStatus, tuple[str, Ink]] = {
    "completed": ("●", (60, 220, 120)),
    "found": ("◆", (255, 180, 50)),
    "known": ("○", (210, 215, 220)),
    "truth": ("◇", (230, 90, 110)),
}
"""Sign and colour of a target by its status."""

ARROWS = "↑↗→↘↓↙←↖"
"""Signs of headings, clockwise from north in steps of 45°."""

FRESH_TICKS = 8
"""Ticks after which a part of a trail is dimmed. Chosen."""
FINE = 4
"""Subpixels of the ground per pixel and axis. Chosen."""

_DOTS = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80))
"""Bits of the Unicode braille patterns (U+2800) by row and column of a cell."""

_MARGIN = 1.1
"""Ratio of the window's size to the extent of its points. Chosen."""


def asset_ink(place: int) -> Ink:
    """Return the colour of the n-th asset."""
    return ASSETS[place % len(ASSETS)]


@dataclass(frozen=True, slots=True)
class _ChartWindow:
    """The shown part of the world."""

    west: float
    """East coordinate of the left edge, metres."""
    north: float
    """North coordinate of the upper edge, metres."""
    dot_m: float
    """Side of a braille dot, metres."""
    columns: int
    """Cells of a row."""
    rows: int
    """Rows of cells."""

    @property
    def bounds(self) -> Extent:
        """West, south, east and north edges, metres."""
        wide, high = self.columns * 2 * self.dot_m, self.rows * 4 * self.dot_m
        return self.west, self.north - high, self.west + wide, self.north

    def dot(self, point: Vector2) -> tuple[int, int]:
        """Return column and row of the dot at a point, also outside the window."""
        return math.floor((point[0] - self.west) / self.dot_m), math.floor((self.north - point[1]) / self.dot_m)

    def holds(self, point: Vector2) -> bool:
        """Return whether a point lies in the window."""
        x, y = self.dot(point)
        return 0 <= x < self.columns * 2 and 0 <= y < self.rows * 4


def window_around(points: Sequence[Vector2], columns: int, rows: int) -> _ChartWindow:
    """Return the smallest window with a margin that shows all points, at least 100 m wide and high."""
    xs, ys = [x for x, _ in points] or [0.0], [y for _, y in points] or [0.0]
    wide, high = max(100.0, (max(xs) - min(xs)) * _MARGIN), max(100.0, (max(ys) - min(ys)) * _MARGIN)
    dot_m = max(wide / (columns * 2), high / (rows * 4))
    middle = (min(xs) + max(xs)) / 2, (min(ys) + max(ys)) / 2
    return _ChartWindow(middle[0] - columns * dot_m, middle[1] + rows * 2 * dot_m, dot_m, columns, rows)


class Chart:
    """The painter of the map. Ground and window are kept until the size changes or an asset leaves the window."""

    def __init__(self, city: City) -> None:
        self._city = city
        self._window: _ChartWindow | None = None
        self._shapes: tuple[PlanShape, ...] = ()
        self._ground: list[list[Ink]] = []

    def lines(self, watched: EpisodeState, columns: int, rows: int, *, coloured: bool) -> list[list[Segment]]:
        """Return the map as `rows` lines of `columns` cells."""
        window = self._fit(watched, columns, rows, coloured)
        canvas = _CellCanvas(window, self._ground if coloured else [])
        if not coloured:
            for shape in self._shapes:
                if shape.layer == "water" or (shape.layer in ("road", "bridge") and shape.width_m > 0):
                    canvas.path(shape.points, GROUND["road"])
        _draw(canvas, watched)
        return [list(line) for line in canvas.lines()]

    def _fit(self, watched: EpisodeState, columns: int, rows: int, coloured: bool) -> _ChartWindow:
        window = self._window
        states = [watched.states[asset.id] for asset in watched.assets if asset.id in watched.states]
        here = [(state.position[0], state.position[1]) for state in states]
        same = window is not None and (window.columns, window.rows) == (columns, rows)
        if window is None or not same or not all(window.holds(point) for point in here):
            window = self._window = window_around(self._extent(watched, here), columns, rows)
            self._shapes = ground_plan(self._city, window.bounds)
            self._ground = _paint(self._shapes, window) if coloured else []
        return window

    def _extent(self, watched: EpisodeState, here: list[Vector2]) -> list[Vector2]:
        points = [corner for region in watched.instance.regions if not region.hidden for corner in region.polygon]
        points += [place for _, place, _ in watched.visible_targets()]
        points += [point for asset in watched.assets for _, point in watched.trails.get(asset.id, ())]
        return points + here


def _draw(canvas: _CellCanvas, watched: EpisodeState) -> None:
    for region in watched.instance.regions:
        if not region.hidden and region.polygon:
            canvas.path((*region.polygon, region.polygon[0]), REGION, dashed=True)
    colours = {asset.id: asset_ink(place) for place, asset in enumerate(watched.assets)}
    for name, route in watched.routes.items():
        canvas.path(route, _dimmed(colours.get(name, REGION)), dashed=True)
    for name, colour in colours.items():
        trail = watched.trails.get(name, [])
        old = [point for tick, point in trail if tick <= watched.tick - FRESH_TICKS]
        new = [point for tick, point in trail if tick > watched.tick - FRESH_TICKS]
        canvas.path(old + new[:1], _dimmed(colour))
        canvas.path(old[-1:] + new, colour)
    for _, place, sight in watched.visible_targets():
        canvas.glyph(place, *TARGET_SIGNS[sight])
    for name, colour in colours.items():
        state = watched.states.get(name)
        if state is not None:
            canvas.glyph(state.position[:2], ARROWS[round(state.heading_deg / 45.0) % 8], colour, bold=True)
    for name, colour in colours.items():
        if name in watched.states:
            canvas.label(watched.states[name].position[:2], name, colour)


class _CellCanvas:
    """Cells with dots, glyphs and letters over the ground."""

    def __init__(self, window: _ChartWindow, ground: list[list[Ink]]) -> None:
        self._window = window
        self._ground = ground
        self._dots: dict[tuple[int, int], int] = {}
        self._inks: dict[tuple[int, int], Ink] = {}
        self._glyphs: dict[tuple[int, int], tuple[str, Ink, bool]] = {}

    def path(self, points: Sequence[Vector2], colour: Ink, *, dashed: bool = False) -> None:
        dots = [self._window.dot(point) for point in points]
        for a, b in pairwise(dots):
            for step, (x, y) in enumerate(_between(a, b)):
                if not dashed or step % 3 == 0:
                    self._dot(x, y, colour)

    def glyph(self, point: Sequence[float], sign: str, colour: Ink, *, bold: bool = False) -> None:
        x, y = self._window.dot((point[0], point[1]))
        if self._window.holds((point[0], point[1])):
            self._glyphs[x // 2, y // 4] = (sign, colour, bold)

    def label(self, point: Sequence[float], text: str, colour: Ink) -> None:
        """Write a label to the right or left of a glyph, if no other glyph or label occupies the cells."""
        x, y = self._window.dot((point[0], point[1]))
        column, row = x // 2, y // 4
        for start in (column + 1, column - len(text)):
            cells = [(start + at, row) for at in range(len(text))]
            around = [*cells, (start - 1, row), (start + len(text), row)]
            clear = all(cell == (column, row) or cell not in self._glyphs for cell in around)
            if clear and start >= 0 and start + len(text) <= self._window.columns and 0 <= row < self._window.rows:
                self._glyphs.update({cell: (sign, colour, False) for cell, sign in zip(cells, text, strict=True)})
                return

    def lines(self) -> Iterator[Iterator[Segment]]:
        for row in range(self._window.rows):
            yield self._line(row)

    def _dot(self, x: int, y: int, colour: Ink) -> None:
        if 0 <= x < self._window.columns * 2 and 0 <= y < self._window.rows * 4:
            cell = (x // 2, y // 4)
            self._dots[cell] = self._dots.get(cell, 0) | _DOTS[y % 4][x % 2]
            self._inks[cell] = colour

    def _line(self, row: int) -> Iterator[Segment]:
        """Yield the segments of a row; neighbouring cells of one style share a segment."""
        text, style = "", None
        for column in range(self._window.columns):
            sign, own = self._cell(column, row)
            if own is not style:
                if text:
                    yield Segment(text, style)
                text, style = "", own
            text += sign
        yield Segment(text, style)

    def _cell(self, column: int, row: int) -> tuple[str, Style]:
        cell = (column, row)
        if not self._ground:
            under = None
        else:
            upper, lower = self._ground[2 * row][column], self._ground[2 * row + 1][column]
            if cell not in self._glyphs and cell not in self._dots:
                return (" ", _style(None, upper)) if upper == lower else ("▀", _style(upper, lower))
            under = _mixed(upper, lower)
        if cell in self._glyphs:
            sign, colour, bold = self._glyphs[cell]
            return sign, _style(colour, under, bold)
        if cell in self._dots:
            return chr(0x2800 + self._dots[cell]), _style(self._inks[cell], under)
        return " ", _style(None, None)


def _paint(shapes: Sequence[PlanShape], window: _ChartWindow) -> list[list[Ink]]:
    """Return the ground as two rows of pixels for each row of cells."""
    size = (window.columns * FINE, window.rows * 2 * FINE)
    image = Image.new("RGB", size, GROUND["water"] if is_sea(shapes) else LAND)
    pen = ImageDraw.Draw(image)
    scale = FINE / (2 * window.dot_m)

    def placed(points: Sequence[Vector2]) -> list[Vector2]:
        return [((x - window.west) * scale, (window.north - y) * scale) for x, y in points]

    for shape in shapes:
        colour = GROUND.get(shape.surface, GROUND.get(shape.layer))
        if colour is None:
            continue
        if shape.width_m > 0:
            pen.line(placed(shape.points), fill=colour, width=max(1, round(shape.width_m * scale)))
        elif len(shape.points) > 2:
            pen.polygon(placed(shape.points), fill=colour)
            for hole in shape.holes:
                pen.polygon(placed(hole), fill=LAND)
    pixels = image.resize((window.columns, window.rows * 2), Image.Resampling.BOX).tobytes()
    wide = window.columns * 3
    rows = (pixels[at : at + wide] for at in range(0, len(pixels), wide))
    return [[(row[at], row[at + 1], row[at + 2]) for at in range(0, wide, 3)] for row in rows]


def _between(a: tuple[int, int], b: tuple[int, int]) -> Iterator[tuple[int, int]]:
    """Yield the dots of a straight line, both ends included."""
    steps = max(abs(b[0] - a[0]), abs(b[1] - a[1]), 1)
    for step in range(steps + 1):
        share = step / steps
        yield round(a[0] + (b[0] - a[0]) * share), round(a[1] + (b[1] - a[1]) * share)


def _dimmed(colour: Ink) -> Ink:
    return _mixed(colour, LAND)


def _mixed(a: Ink, b: Ink) -> Ink:
    return (a[0] + b[0]) // 2, (a[1] + b[1]) // 2, (a[2] + b[2]) // 2


@lru_cache(maxsize=4096)
def _style(ink: Ink | None, under: Ink | None, bold: bool = False) -> Style:
    """Return a style; equal arguments give the same object, so that neighbours are compared by identity."""
    return Style(
        color=None if ink is None else Color.from_rgb(*ink),
        bgcolor=None if under is None else Color.from_rgb(*under),
        bold=bold or None,
    )
