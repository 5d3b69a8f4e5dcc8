"""The alternate screen of the terminal. Other output to standard error is held back until the screen is restored."""

from __future__ import annotations

import io
import os
import signal
import sys
import tempfile
from collections.abc import Callable
from contextlib import suppress
from types import FrameType, TracebackType
from typing import IO, TYPE_CHECKING, Self

from lingjing.terminal import visible

if TYPE_CHECKING:
    from rich.console import Console, RenderableType


_LEFT_ROWS = 30
"""The greatest height of the last picture, in rows. Chosen."""


class AlternateScreen:
    """A context manager for the alternate screen on the terminal of standard error, without a cursor.

    Inside, output of policies, libraries and workers to the terminal goes to a file. The file is printed when the
    screen is restored, on every way out. `resized` is called when the terminal's size changes.
    """

    def __init__(self, resized: Callable[[], None]) -> None:
        self._resized = resized
        self._drawing = False
        self._late = False

    def __enter__(self) -> Self:
        from lingjing.cli.console import VisibleConsole

        _flush()
        self._aside: IO[bytes] = tempfile.TemporaryFile()
        self._kept = {number: os.dup(number) for number in _on_terminal()}
        self._screen = self._kept[_standard_error()]
        for number in self._kept:
            os.dup2(self._aside.fileno(), number)
        self._out: IO[str] = open(self._screen, "w", encoding="utf-8", closefd=False)
        self._console: Console = VisibleConsole(file=self._out, force_terminal=True)
        self._before = self._listen()
        self._console.set_alt_screen(True)
        self._console.show_cursor(False)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._before is not None:
            signal.signal(signal.SIGWINCH, self._before)
        with suppress(OSError):  # a closed terminal needs no restoring
            self._console.show_cursor(True)
            self._console.set_alt_screen(False)
            self._out.flush()
        _flush()
        for number, kept in self._kept.items():
            os.dup2(kept, number)
            os.close(kept)
        self._aside.seek(0)
        with (
            suppress(OSError),
            io.TextIOWrapper(self._aside, encoding="utf-8", errors="backslashreplace") as held_output,
        ):
            for line in held_output:
                sys.stderr.write(visible(line))
            sys.stderr.flush()

    def draw(self, renderable: RenderableType) -> None:
        """Fill the screen at the terminal's current size."""
        self._drawing = True
        self._console.size = os.get_terminal_size(self._screen)
        self._console.update_screen(renderable)
        self._drawing = False
        if self._late:
            self._late = False
            self.draw(renderable)

    @staticmethod
    def leave(renderable: RenderableType) -> None:
        """Print a last picture in the normal screen. Called after the alternate screen was restored."""
        from lingjing.cli.console import console

        shown = console(sys.stderr)
        shown.print(renderable, height=min(_LEFT_ROWS, shown.height - 1), end="\n")

    # -- parts

    def _listen(self) -> Callable[[int, FrameType | None], object] | int | None:
        """Install the handler of size changes. Only the main thread can."""
        with suppress(ValueError):
            return signal.signal(signal.SIGWINCH, self._changed)
        return None

    def _changed(self, number: int, frame: FrameType | None) -> None:
        if self._drawing:  # a second drawing would interleave with this one
            self._late = True
        else:
            self._resized()


def _on_terminal() -> set[int]:
    """Return the descriptors that lead to the terminal: those of our streams and the standard ones.

    Descriptor 2 and its copies are always among them: output written there reaches the terminal in any case
    (`lingjing.play.policy_processes.output`).
    """
    numbers = {1, 2, _standard_error()}
    with suppress(OSError, ValueError, AttributeError):  # a stream without a descriptor
        numbers.add(sys.stdout.fileno())
    return {number for number in numbers if os.isatty(number) or os.path.sameopenfile(number, 2)}


def _standard_error() -> int:
    """Return the descriptor of `sys.stderr`."""
    try:
        return sys.stderr.fileno()
    except (OSError, ValueError, AttributeError):
        return 2


def _flush() -> None:
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError, ValueError):
            stream.flush()
