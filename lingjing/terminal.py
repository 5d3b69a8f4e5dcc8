"""Output to a terminal: control characters and characters that reorder text are shown as escapes.

Names, messages and errors come from missions, policies, services and models. `visible` escapes their control characters
(C0 except newline and tab, DEL, C1) and the marks that hide or reorder text. `Visible` is a stream that does so with
all its output; `guard_streams` replaces the standard streams by it. Our own colours and rich's drawing go through
`write_styled` and `unguarded`, data through `write_data`. Traces, files and JSON values keep the original text.

`lingjing.play.policy_processes.output` passes the output of policy processes through `visible`. A policy in the
caller's process (`lingjing.run`) can write to the descriptors directly; its ordinary prints and logs are escaped too.
"""

from __future__ import annotations

import io
import sys
from collections.abc import Sequence
from contextlib import suppress
from typing import TextIO

_KEPT = "\n\t"
"""Control characters that are not escaped."""
_CONTROLS = (*range(0x20), *range(0x7F, 0xA0))
"""Code points of control characters."""
_MARKS = (
    0x00AD, 0x061C, 0x180E, *range(0x200B, 0x200C), *range(0x200E, 0x2010), *range(0x2028, 0x202F),
    *range(0x2060, 0x2070), 0xFEFF, *range(0xFFF9, 0xFFFC), *range(0xE0000, 0xE0080),
)  # fmt: skip
"""Code points of invisible, reordering or line-breaking characters: bidirectional marks, zero-width spaces, separators,
tags. The joiners that scripts and emoji need (U+200C, U+200D) are not escaped.
"""


def _spelled(code: int) -> str:
    if code < 0x20:
        return f"\\x{code:02x}"
    units = chr(code).encode("utf-16-be")
    return "".join(f"\\u{units[at]:02x}{units[at + 1]:02x}" for at in range(0, len(units), 2))


_SPELLED = {code: _spelled(code) for code in (*_CONTROLS, *_MARKS) if chr(code) not in _KEPT}


def visible(text: str) -> str:
    """Return `text` with hexadecimal escapes for all characters that control a terminal."""
    if text.isascii() and text.isprintable():
        return text
    return text.replace("\r\n", "\n").translate(_SPELLED)


def cells(text: str) -> int:
    """Return the columns of a text on a terminal: two for wide characters, none for combining ones."""
    if text.isascii():
        return len(text)
    from unicodedata import combining, east_asian_width

    return sum(0 if combining(c) else 2 if east_asian_width(c) in "WF" else 1 for c in text)


def aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """Return a line for each row, with its cells in columns two spaces apart."""
    sizes = [[cells(visible(cell)) for cell in row] for row in rows]
    widths = [max(column) for column in zip(*sizes, strict=True)]
    padded = (
        (cell + " " * (width - size) for cell, size, width in zip(row, own, widths, strict=True))
        for row, own in zip(rows, sizes, strict=True)
    )
    return ["  ".join(row).rstrip() for row in padded]


class Visible(io.TextIOWrapper):
    """A text stream that writes `visible` text."""

    def write(self, text: str) -> int:
        """Write the text with escapes. Return its length."""
        super().write(visible(text))
        return len(text)

    def write_exactly(self, text: str) -> int:
        """Write the text unchanged."""
        return super().write(text)


class _Unguarded:
    """A view of a `Visible` stream that escapes nothing, for a library that draws."""

    def __init__(self, stream: Visible) -> None:
        self._stream = stream
        self.encoding = stream.encoding

    def write(self, text: str) -> int:
        return self._stream.write_exactly(text)

    def flush(self) -> None:
        self._stream.flush()

    def isatty(self) -> bool:
        return self._stream.isatty()

    def fileno(self) -> int:
        return self._stream.fileno()


def guard_streams() -> None:
    """Make standard output and standard error `Visible`."""
    for name in ("stdout", "stderr"):
        guarded = _guarded(getattr(sys, name))
        setattr(sys, name, guarded)
        setattr(sys, f"__{name}__", guarded)


def _guarded(stream: TextIO) -> TextIO:
    if type(stream) is not io.TextIOWrapper:
        return stream  # a stream of a test or a notebook, or guarded already
    with suppress(OSError, ValueError):
        stream.flush()
    buffered, encoding = stream.line_buffering, stream.encoding
    return Visible(stream.detach(), encoding=encoding, errors="backslashreplace", line_buffering=buffered)


def write_styled(stream: TextIO, text: str) -> None:
    """Write text with our own escape sequences and no foreign text."""
    (stream.write_exactly if isinstance(stream, Visible) else stream.write)(text)


def write_data(text: str) -> None:
    """Write data to standard output: unchanged, unless that is a terminal."""
    stream = sys.stdout
    (stream.write_exactly if isinstance(stream, Visible) and not stream.isatty() else stream.write)(text)


def unguarded(stream: TextIO) -> TextIO:
    """Return the stream for a library that draws and escapes foreign text itself."""
    return _Unguarded(stream) if isinstance(stream, Visible) else stream  # type: ignore[return-value]
