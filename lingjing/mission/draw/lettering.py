"""How wide text is without asking a font: close enough, and never too narrow, for common sans-serif faces. Pixels."""

from __future__ import annotations

from unicodedata import combining, east_asian_width

_NARROW = frozenset("iljtfrI.,:;|'!()[]{}/\\ -")
_BROAD = frozenset("mwMW@%×…→↔≥≤")


def width(text: str, size: float, *, bold: bool = False) -> float:
    """The width of one line at a font size."""
    return sum(map(_share, text)) * size * (1.08 if bold else 1.0)


def fitted(text: str, size: float, room: float, *, bold: bool = False) -> str:
    """The text, cut with an ellipsis where it is wider than the room."""
    if width(text, size, bold=bold) <= room:
        return text
    kept = text
    while kept and width(kept + "…", size, bold=bold) > room:
        kept = kept[:-1]
    return kept.rstrip() + "…"


def _share(letter: str) -> float:
    """A letter's width as a share of the font size."""
    if combining(letter):
        return 0.0
    if east_asian_width(letter) in "WF":
        return 1.05
    if letter in _NARROW:
        return 0.38
    if letter in _BROAD:
        return 0.95
    return 0.70 if letter.isupper() else 0.60
