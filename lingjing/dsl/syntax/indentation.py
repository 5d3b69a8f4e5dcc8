"""Indentation of a text's lines. Where braces do not balance, it shows the intended blocks."""

from __future__ import annotations

import re

from lingjing.patterns import pattern

_BLANK = pattern(r"[ \t]*")
_NEXT_CODE = pattern(r"(?:[ \t]*(?:\#[^\r\n]*)?[\r\n])*(?P<depth>[ \t]*)(?=[^\s\#])")
_OPENED = pattern(r"^(?P<outside>[ \t]*)[^\s\#][^\r\n]*[{:][ \t]*[\r\n]+(?P<inside>[ \t]*)(?=[^\s}])", re.MULTILINE)


class Indentation:
    """The indentation of one text, computed on demand."""

    def __init__(self, text: str) -> None:
        self.text = text

    def line_start(self, offset: int) -> int:
        """Offset at which the line of an offset begins."""
        return max(self.text.rfind("\n", 0, offset), self.text.rfind("\r", 0, offset)) + 1

    def depth_of_line(self, offset: int) -> int:
        """Indentation of an offset's line, in characters."""
        begin = self.line_start(offset)
        return _BLANK.match(self.text, begin).end() - begin  # type: ignore[union-attr]

    def depth(self, begin: int) -> int | None:
        """Indentation of the line at `begin` or, for a blank or comment line, of the next code line; None at the
        end."""
        match = _NEXT_CODE.match(self.text, begin)
        return None if match is None else len(match["depth"])

    def is_kept(self) -> bool:
        """True if the author indents the content of blocks (at least nine in ten)."""
        opened = deeper = 0
        for match in _OPENED.finditer(self.text):
            opened += 1
            deeper += len(match["inside"]) > len(match["outside"])
        return opened > 0 and deeper >= 0.9 * opened
