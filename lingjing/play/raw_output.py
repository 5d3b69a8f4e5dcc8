"""What policies write past their streams, to descriptors 1 and 2 of their process: spelled out like what they print.

A policy may call `os.write(2, …)`, and a program that it starts writes where it was started. Both descriptors of the
child that plays lead to its parent, which passes on what comes (`lingjing.terminal.visible`) to standard error; our own
streams and displays there keep theirs. The child has no terminal of its own to open (`/dev/tty`), and reads alone from
one that it was given as descriptor 0. Code that looks for the device of its user's terminal finds it: in the caller's
account a policy is trusted.
"""

from __future__ import annotations

import codecs
import fcntl
import os
import sys
import termios
from contextlib import suppress

from lingjing.terminal import Visible, visible

_PIECE = 1 << 16

_PIECES_MOST = 64
"""So many are passed on at a time: who never stops writing keeps the parent from nothing else."""


class RawOutput:
    """A pipe from a child that is about to be forked."""

    def __init__(self) -> None:
        self._reading, self._writing = os.pipe2(os.O_CLOEXEC)
        self._text = codecs.getincrementaldecoder("utf-8")("backslashreplace")

    def lead_here(self) -> None:
        """In the child: turn the descriptors; `sys.stderr` goes on to where standard error leads."""
        os.close(self._reading)
        with suppress(OSError, ValueError, AttributeError):  # a stream without a descriptor
            if sys.stderr.fileno() == 2:
                sys.stderr.flush()
                behind = open(os.dup(2), "wb")  # noqa: PTH123, SIM115 - the stream around it closes it
                sys.stderr = Visible(behind, encoding="utf-8", errors="backslashreplace", line_buffering=True)
                sys.__stderr__ = sys.stderr  # type: ignore[misc]
        for number in (1, 2):
            os.dup2(self._writing, number)
        os.close(self._writing)
        _let_go_of_the_terminal()

    def begin(self) -> None:
        """In the parent, after the fork: leave the writing to the child."""
        os.close(self._writing)
        os.set_blocking(self._reading, False)

    @property
    def descriptor(self) -> int | None:
        """What to wait for; None when nothing more comes."""
        return self._reading if self._reading >= 0 else None

    def pass_on(self) -> None:
        """Write what has come to standard error, spelled out; never waits for more."""
        with suppress(BlockingIOError):
            for _ in range(_PIECES_MOST):
                if self._reading < 0:
                    return
                data = os.read(self._reading, _PIECE)
                self._say(self._text.decode(data, final=not data))
                if not data:
                    self.close()

    def close(self) -> None:
        """Hear no more of it."""
        if self._reading >= 0:
            os.close(self._reading)
            self._reading = -1

    @staticmethod
    def _say(text: str) -> None:
        with suppress(OSError, ValueError):  # a terminal that is gone
            sys.stderr.write(visible(text))
            sys.stderr.flush()


def _let_go_of_the_terminal() -> None:
    """The keys for interrupting and stopping go to its process group as before."""
    with suppress(OSError):
        terminal = os.open("/dev/tty", os.O_RDWR | os.O_NOCTTY)
        fcntl.ioctl(terminal, termios.TIOCNOTTY)
        os.close(terminal)
    with suppress(OSError):
        reading = os.open(os.ttyname(0), os.O_RDONLY | os.O_NOCTTY)
        os.dup2(reading, 0)
        os.close(reading)
