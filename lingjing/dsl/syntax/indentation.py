"""How deep the lines of a text are indented: where braces do not balance, that tells which block was meant."""

from __future__ import annotations

import re

_BLANK = re.compile(r"[ \t]*")
_NEXT_CODE = re.compile(r"(?:[ \t]*(?:\#[^\r\n]*)?[\r\n])*(?P<depth>[ \t]*)(?=[^\s\#])")
_OPENED = re.compile(r"^(?P<outside>[ \t]*)[^\s\#][^\r\n]*\{[ \t]*[\r\n]+(?P<inside>[ \t]*)(?=[^\s}])", re.MULTILINE)


class Indentation:
    """The indentation of one text, looked up where it is asked for."""

    def __init__(self, text: str) -> None:
        self.text = text

    def line_start(self, offset: int) -> int:
        """Where the line of an offset begins."""
        return max(self.text.rfind("\n", 0, offset), self.text.rfind("\r", 0, offset)) + 1

    def depth_of_line(self, offset: int) -> int:
        """Indentation of an offset's line, in characters."""
        begin = self.line_start(offset)
        return _BLANK.match(self.text, begin).end() - begin  # type: ignore[union-attr]

    def depth(self, begin: int) -> int | None:
        """Indentation of the line that begins there or, if there is only a comment, of the next; None at the end."""
        match = _NEXT_CODE.match(self.text, begin)
        return None if match is None else len(match["depth"])

    def is_kept(self) -> bool:
        """Whether the author indents what stands in a block."""
        opened = deeper = 0
        for match in _OPENED.finditer(self.text):
            opened += 1
            deeper += len(match["inside"]) > len(match["outside"])
        return opened > 0 and deeper >= 0.9 * opened
