"""Widths of text, and text cut or broken to a width.

Widths are those of DejaVu Sans. A letter that it lacks counts as a square, as Chinese letters are, so that a layout is
the same whichever fonts a machine has.
"""

from __future__ import annotations

from lingjing.analysis.fonts import font, missing_letters
from lingjing.terminal import visible

USUAL = 11.0
"""Size of text in a drawing, in units."""

SMALL = 10.0
"""Size of numbers and labels in a drawing, in units."""

_FINE = 4
"""Text is measured at this many times its size, since a font has a whole number of pixels."""


def text_width(text: str, size: float, *, bold: bool = False) -> float:
    """Return the width of one line of text in units."""
    other = set(missing_letters(text))
    own = "".join(letter for letter in text if letter not in other)
    return font(round(_FINE * size), bold=bold).getlength(own) / _FINE + size * (len(text) - len(own))


def fitting(text: str, width: float, size: float = USUAL, *, bold: bool = False) -> str:
    """Return the text as one line without control characters, with an ellipsis where it would exceed the width."""
    line = " ".join(visible(text).split())
    if text_width(line, size, bold=bold) <= width:
        return line
    while line and text_width(f"{line}…", size, bold=bold) > width:
        line = line[:-1]
    return f"{line}…"


def wrapped(text: str, width: float, size: float = USUAL, *, bold: bool = False) -> list[str]:
    """Return the text as lines of at most that width, broken between words; a longer word is cut."""
    lines = [""]
    for word in visible(text).split():
        longer = f"{lines[-1]} {word}".strip()
        if text_width(longer, size, bold=bold) <= width:
            lines[-1] = longer
        else:
            lines.append(fitting(word, width, size, bold=bold))
    return [line for line in lines if line]


__all__ = ["SMALL", "USUAL", "fitting", "text_width", "wrapped"]
