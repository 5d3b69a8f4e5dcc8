"""A drawing: a title, a size, and the function that paints it on a canvas of `painting`.

Lengths are units of 1/72 inch, which a browser shows as about one pixel. Colours are tones: names of a palette, so that
a page can show the same drawing light or dark.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

import msgspec

if TYPE_CHECKING:
    from lingjing.report.painting import Canvas

WIDE = 360.0
"""Width of a chart in units: that of a phone, so that its letters have the same size on a phone and on a desk."""

SERIES = 8
"""Number of tones for series. Series beyond them repeat the tones with another marker and a dashed line."""

LIGHT: Mapping[str, str] = {
    "ink": "#1c2733", "faint": "#5f6b78", "rule": "#d5dce3", "paper": "#ffffff", "panel": "#f3f5f8",
    "good": "#1a8f4b", "bad": "#c42b43",
    "s0": "#0072b2", "s1": "#d55e00", "s2": "#007a5a", "s3": "#aa4499", "s4": "#8c6d00", "s5": "#2e8fbf",
    "s6": "#666666", "s7": "#882255",
}  # fmt: skip
"""Tones on white. The tones of series are from the colour-blind palettes of Okabe and Ito and of Tol; the light ones
are darkened to a contrast of 3 : 1 with white."""

DARK: Mapping[str, str] = {
    "ink": "#e6ebf1", "faint": "#9aa8b6", "rule": "#38434f", "paper": "#12171d", "panel": "#1b222a",
    "good": "#4bd08a", "bad": "#ff7a88",
    "s0": "#5ab4f0", "s1": "#ff9a52", "s2": "#3fcfa0", "s3": "#e58bd0", "s4": "#e0bc4a", "s5": "#9ad7ff",
    "s6": "#b4bcc6", "s7": "#f08da8",
}  # fmt: skip
"""Tones on a dark page."""

MARKERS = ("o", "s", "^", "D", "X")
"""Markers of matplotlib for series, in turn: circle, square, triangle, diamond, cross."""


class Drawing(msgspec.Struct, frozen=True, kw_only=True):
    """A picture of a report, before it is rendered as SVG or PNG."""

    title: str
    """Its title, which a page or a sheet writes above it."""

    description: str
    """Its content in words, for screen readers."""

    width: float
    """Width in units."""

    height: float
    """Height in units."""

    paint: Callable[[Canvas], None]
    """Paints it on a canvas of at least that size."""

    wide: bool = False
    """True if it is unreadable on a phone at the width of the screen: a page then lets it be scrolled sideways."""


def marker_of(series: int) -> str:
    """Return the marker of the n-th series, as matplotlib calls it."""
    return MARKERS[series % len(MARKERS)]


def tone_of(series: int) -> str:
    """Return the tone of the n-th series."""
    return f"s{series % SERIES}"


def colour_of(series: int) -> str:
    """Return the colour of the n-th series on white."""
    return LIGHT[tone_of(series)]


__all__ = ["DARK", "LIGHT", "SERIES", "WIDE", "Drawing", "colour_of", "marker_of", "tone_of"]
