"""Character offsets ↔ the protocol's lines and columns, which count code units of the negotiated encoding."""

from __future__ import annotations

from bisect import bisect_right
from dataclasses import dataclass

from lingjing.dsl.source.text import SourceText

ENCODINGS = ("utf-16", "utf-8", "utf-32")
"""Encodings that the protocol defines."""


@dataclass(frozen=True, slots=True)
class TextPosition:
    """A position of the protocol."""

    line: int
    """Line, counted from 0."""
    character: int
    """Code unit in the line, counted from 0."""


class Positions:
    """Converts positions of one text."""

    def __init__(self, source: SourceText, encoding: str = "utf-16") -> None:
        self.text = source.text
        self.starts = source.line_starts()
        self.encoding = encoding if encoding in ENCODINGS else "utf-16"

    def place(self, offset: int) -> TextPosition:
        """The position of an offset."""
        offset = max(0, min(offset, len(self.text)))
        line = bisect_right(self.starts, offset) - 1
        return TextPosition(line, self._units(self.text[self.starts[line] : offset]))

    def offset(self, place: TextPosition) -> int:
        """The offset of a position. A position beyond the line's end gives its end; one inside a character gives its
        start.
        """
        if place.line < 0:
            return 0
        if place.line >= len(self.starts):
            return len(self.text)
        start = self.starts[place.line]
        end = self.starts[place.line + 1] if place.line + 1 < len(self.starts) else len(self.text)
        line = self.text[start:end].rstrip("\r\n")
        if line.isascii() or self.encoding == "utf-32":
            return start + max(0, min(place.character, len(line)))
        units = 0
        for index, character in enumerate(line):
            units += self._units(character)
            if units > place.character:
                return start + index
        return start + len(line)

    def _units(self, text: str) -> int:
        if text.isascii() or self.encoding == "utf-32":
            return len(text)
        if self.encoding == "utf-8":
            return len(text.encode("utf-8", "surrogatepass"))
        return len(text) + sum(character > "\uffff" for character in text)
