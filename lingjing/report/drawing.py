"""A drawing: marks in a box, top left first, in units that are about pixels of a page; what they are drawn by is
`vector` or `raster`.

Colours are tones: names of the palette, so that a page may show them light or dark.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import msgspec

SERIES = 8
"""So many tones tell series apart; later ones begin again with another marker and dashes."""

LIGHT: Mapping[str, str] = {
    "ink": "#1c2733", "faint": "#5f6b78", "rule": "#d5dce3", "paper": "#ffffff", "panel": "#f3f5f8",
    "good": "#1a8f4b", "bad": "#c42b43", "heat": "#0072b2",
    "s0": "#0072b2", "s1": "#d55e00", "s2": "#007a5a", "s3": "#aa4499", "s4": "#8c6d00", "s5": "#2e8fbf",
    "s6": "#666666", "s7": "#882255",
}  # fmt: skip
"""The tones on paper. Series are those of Okabe and Ito and of Tol for colour-blind readers, the light ones darkened
to a contrast of 3 : 1 with white."""

DARK: Mapping[str, str] = {
    "ink": "#e6ebf1", "faint": "#9aa8b6", "rule": "#38434f", "paper": "#12171d", "panel": "#1b222a",
    "good": "#4bd08a", "bad": "#ff7a88", "heat": "#56b4e9",
    "s0": "#5ab4f0", "s1": "#ff9a52", "s2": "#3fcfa0", "s3": "#e58bd0", "s4": "#e0bc4a", "s5": "#9ad7ff",
    "s6": "#b4bcc6", "s7": "#f08da8",
}  # fmt: skip

SHAPES = ("circle", "square", "triangle", "diamond", "cross")
"""Markers, one after the other."""

FlatPoint = tuple[float, float]


class PaneMark(msgspec.Struct, frozen=True, kw_only=True):
    """A rectangle; `told` is what a pointer over it is told."""

    x: float
    y: float
    width: float
    height: float
    tone: str
    opacity: float = 1.0
    told: str = ""


class StrokeMark(msgspec.Struct, frozen=True, kw_only=True):
    """A line through points, or what it encloses where it is `filled`."""

    points: tuple[FlatPoint, ...]
    tone: str
    width: float = 1.5
    dashed: bool = False
    filled: bool = False
    opacity: float = 1.0


class SpotMark(msgspec.Struct, frozen=True, kw_only=True):
    """A marker around a point."""

    x: float
    y: float
    tone: str
    radius: float = 4.0
    shape: str = "circle"
    told: str = ""

    def corners(self) -> tuple[FlatPoint, ...]:
        """The outline of a marker that is no circle."""
        r = self.radius
        places: tuple[FlatPoint, ...]
        match self.shape:
            case "square":
                places = ((-r, -r), (r, -r), (r, r), (-r, r))
            case "triangle":
                places = ((0.0, -1.25 * r), (1.15 * r, 0.85 * r), (-1.15 * r, 0.85 * r))
            case "diamond":
                places = ((0.0, -1.3 * r), (1.3 * r, 0.0), (0.0, 1.3 * r), (-1.3 * r, 0.0))
            case _:  # a cross
                a, b = 0.42 * r, 1.2 * r
                turned = ((-a, -b), (a, -b), (a, -a), (b, -a), (b, a), (a, a), (a, b), (-a, b), (-a, a), (-b, a),
                          (-b, -a), (-a, -a))  # fmt: skip
                c = math.sqrt(0.5)
                places = tuple((c * (x - y), c * (x + y)) for x, y in turned)
        return tuple((self.x + x, self.y + y) for x, y in places)


class WordsMark(msgspec.Struct, frozen=True, kw_only=True):
    """A line of text on its base line; `anchor` says where `x` is: `start`, `middle` or `end`."""

    x: float
    y: float
    text: str
    size: float = 11.0
    anchor: str = "start"
    tone: str = "ink"
    bold: bool = False


class PictureMark(msgspec.Struct, frozen=True, kw_only=True):
    """A picture (JPEG or PNG) stretched over a box."""

    x: float
    y: float
    width: float
    height: float
    data: bytes

    @property
    def media_type(self) -> str:
        """`image/png` or `image/jpeg`."""
        return "image/png" if self.data.startswith(b"\x89PNG") else "image/jpeg"


DrawnMark = PaneMark | StrokeMark | SpotMark | WordsMark | PictureMark


class Drawing(msgspec.Struct, frozen=True, kw_only=True):
    """Marks in a box of `width` by `height`, later ones over earlier ones.

    `title` stands above it and names it for readers who do not see it; `description` says in words what it shows. A
    `wide` one is not made narrower than it can be read: pages let it be moved sideways.
    """

    title: str
    description: str
    width: float
    height: float
    marks: tuple[DrawnMark, ...]
    wide: bool = False


def shape_of(series: int) -> str:
    """The marker of the n-th series."""
    return SHAPES[series % len(SHAPES)]


def tone_of(series: int) -> str:
    """The tone of the n-th series."""
    return f"s{series % SERIES}"


__all__ = [
    "DARK", "LIGHT", "Drawing", "DrawnMark", "PaneMark", "PictureMark", "SpotMark", "StrokeMark", "WordsMark",
    "shape_of", "tone_of",
]  # fmt: skip
