"""The output of a policy's process: printed on standard error with escapes, up to a limit.

Descriptors 1 and 2 of the process lead into one pipe, which the player reads while it waits for the process. So a
policy that prints never blocks, and its output can neither control a terminal nor fill a disk.
"""

from __future__ import annotations

import codecs
import sys
from contextlib import suppress

from lingjing.processes.output import OutputPipe
from lingjing.terminal import visible

MOST_BYTES = 1_000_000
"""The longest shown output of one process, bytes. The rest is read and dropped. Chosen."""

_PIECES_MOST = 16
"""The most pieces of one read. Chosen: a process that never stops printing does not delay the player."""


class PolicyOutput(OutputPipe):
    """The player's end of the output pipe of one agent's process."""

    def __init__(self, agent: str, descriptor: int) -> None:
        super().__init__(descriptor, _PIECES_MOST)
        self._agent = agent
        self._left = MOST_BYTES
        self._text = codecs.getincrementaldecoder("utf-8")("backslashreplace")

    def _take(self, data: bytes) -> None:
        """Write a piece of the output to standard error."""
        if self._left <= 0:
            return
        kept, self._left = data[: self._left], self._left - len(data)
        text = self._text.decode(kept, final=not data)
        if self._left <= 0:
            text += f"\n[the policy of {self._agent} has printed {MOST_BYTES} bytes: the rest is left out]\n"
        with suppress(OSError, ValueError):  # the terminal is closed
            sys.stderr.write(visible(text))
            sys.stderr.flush()
