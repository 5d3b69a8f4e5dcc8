"""What a policy's process prints: spelled out on standard error, up to a limit.

Both descriptors 1 and 2 of the process lead into one pipe. The player reads it while it waits for the process, so a
policy that prints blocks on nothing, and what it prints can neither steer a terminal nor fill a disk.
"""

from __future__ import annotations

import codecs
import os
import sys
from contextlib import suppress

from lingjing.terminal import visible

MOST_BYTES = 1_000_000
"""Of one process. What it prints beyond that is read and left out."""

_PIECE = 1 << 16
_PIECES_MOST = 16
"""So many are read at a time: a process that never stops printing keeps the player from nothing else."""


class PolicyOutput:
    """The player's end of the pipe of one agent's process."""

    def __init__(self, agent: str, descriptor: int) -> None:
        os.set_blocking(descriptor, False)
        self._agent = agent
        self._descriptor = descriptor
        self._left = MOST_BYTES
        self._text = codecs.getincrementaldecoder("utf-8")("backslashreplace")

    def fileno(self) -> int:
        """The descriptor to wait on, -1 when nothing more comes."""
        return self._descriptor

    def drain(self) -> None:
        """Write what has come to standard error; never waits for more."""
        with suppress(BlockingIOError):
            for _ in range(_PIECES_MOST):
                if self._descriptor < 0:
                    return
                data = os.read(self._descriptor, _PIECE)
                self._pass_on(data)
                if not data:
                    self.close()

    def close(self) -> None:
        """Read no more of it."""
        if self._descriptor >= 0:
            os.close(self._descriptor)
            self._descriptor = -1

    def _pass_on(self, data: bytes) -> None:
        if self._left <= 0:
            return
        kept, self._left = data[: self._left], self._left - len(data)
        text = self._text.decode(kept, final=not data)
        if self._left <= 0:
            text += f"\n[the policy of {self._agent} has printed {MOST_BYTES} bytes: the rest is left out]\n"
        with suppress(OSError, ValueError):  # a terminal that is gone
            sys.stderr.write(visible(text))
            sys.stderr.flush()
