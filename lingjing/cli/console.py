"""The rich console of the command line: control characters of foreign text are printed as escapes."""

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
    """A console that replaces control characters in text; styles and rich's own controls are kept."""

    def render(self, renderable: RenderableType, options: ConsoleOptions | None = None) -> Iterable[Segment]:
        """Yield rich's segments with control characters replaced."""
        for segment in super().render(renderable, options):
            yield segment if segment.control else Segment(visible(segment.text), segment.style)


def console(stream: TextIO | None = None) -> VisibleConsole:
    """Return a console on `stream` (default: standard output)."""
    return VisibleConsole(file=unguarded(stream or sys.stdout))


class _EscapedStream(io.TextIOBase):
    """A stream that escapes control characters and writes to a stream of rich. Rich would interpret escape sequences
    in text that is printed during a display.
    """

    def __init__(self, inner: TextIO | FileProxy) -> None:
        self._inner = inner

    def write(self, text: str) -> int:
        """Write the text with control characters replaced."""
        self._inner.write(visible(text))
        return len(text)

    def flush(self) -> None:
        """Flush the inner stream."""
        self._inner.flush()

    def fileno(self) -> int:
        """Return the descriptor of the inner stream."""
        return self._inner.fileno()

    def isatty(self) -> bool:
        """Return whether the inner stream is a terminal."""
        return self._inner.isatty()


def spell_proxies() -> None:
    """Wrap the proxies that rich has put on the standard streams. Rich restores the original streams itself."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if isinstance(stream, FileProxy):
            setattr(sys, name, _EscapedStream(stream))
