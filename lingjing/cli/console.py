"""Rich's console for this command line: whatever it draws, foreign text reaches the terminal spelled out."""

from __future__ import annotations

import io
import sys
from collections.abc import Iterable
from typing import TextIO

from rich.console import Console, ConsoleOptions, RenderableType
from rich.file_proxy import FileProxy
from rich.segment import Segment

from lingjing.terminal import unguarded, visible


class VisibleConsole(Console):
    """A console whose segments hold no control character; styles and rich's own controls stay."""

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterable[Segment]:
        """Rich's segments, spelled out."""
        for segment in super().render(renderable, options):
            yield segment if segment.control else Segment(visible(segment.text), segment.style)


def console(stream: TextIO | None = None) -> VisibleConsole:
    """A console on `stream` (default: standard output)."""
    return VisibleConsole(file=unguarded(stream or sys.stdout))


class EscapedStream(io.TextIOBase):
    """A stream before one of rich's, which would follow the escape sequences in what is printed during a display."""

    def __init__(self, inner: TextIO | FileProxy) -> None:
        self._inner = inner

    def write(self, text: str) -> int:
        """Write the text, spelled out."""
        self._inner.write(visible(text))
        return len(text)

    def flush(self) -> None:
        """Flush the stream behind it."""
        self._inner.flush()

    def fileno(self) -> int:
        """The descriptor of the stream behind it."""
        return self._inner.fileno()

    def isatty(self) -> bool:
        """Whether that is a terminal."""
        return self._inner.isatty()


def spell_proxies() -> None:
    """Put `EscapedStream` before the streams that rich has just taken over; it puts the old ones back by itself."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if isinstance(stream, FileProxy):
            setattr(sys, name, EscapedStream(stream))
