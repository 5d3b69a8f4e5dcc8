"""The output of a policy's process: spelled out on standard error, up to a limit.

Both descriptors 1 and 2 of the process lead into one pipe. The player reads it while it waits for the process, so a
policy that prints blocks on nothing, and what it prints can neither steer a terminal nor fill a disk.
"""

from __future__ import annotations

import codecs
import sys
from contextlib import suppress

from lingjing.processes.output import OutputPipe
from lingjing.terminal import visible

MOST_BYTES = 1_000_000
"""The most that is shown of the output of one process. What it prints beyond that is read and left out."""

_PIECES_MOST = 16
"""Pieces that are read at a time: a process that never stops printing does not hold up the player. Chosen."""


class PolicyOutput(OutputPipe):
    """The player's end of the pipe of one agent's process."""

    def __init__(self, agent: str, descriptor: int) -> None:
        super().__init__(descriptor, _PIECES_MOST)
        self._agent = agent
        self._left = MOST_BYTES
        self._text = codecs.getincrementaldecoder("utf-8")("backslashreplace")

    def _take(self, data: bytes) -> None:
        """Write a piece to standard error."""
        if self._left <= 0:
            return
        kept, self._left = data[: self._left], self._left - len(data)
        text = self._text.decode(kept, final=not data)
        if self._left <= 0:
            text += f"\n[the policy of {self._agent} has printed {MOST_BYTES} bytes: the rest is left out]\n"
        with suppress(OSError, ValueError):  # a terminal that is gone
            sys.stderr.write(visible(text))
            sys.stderr.flush()
