"""The output of a process, read from a pipe whenever its caller waits."""

from __future__ import annotations

import os
import select
from collections import deque

_PIECE_BYTES = 1 << 16
"""The most bytes of one read: the default capacity of a pipe (pipe(7))."""

_TAIL_BYTES = 16_384
"""The kept end of the output, bytes. Chosen: a traceback of a hundred lines."""


class OutputPipe:
    """The reading end of a pipe for the output of processes. `descriptor`: the pipe, which this object owns.

    A subclass defines `_take`. `most_pieces` limits one `drain`, so that a process which never stops printing does not
    delay its reader; 0 is no limit.
    """

    def __init__(self, descriptor: int, most_pieces: int = 0) -> None:
        os.set_blocking(descriptor, False)
        self._descriptor = descriptor
        self._most_pieces = most_pieces

    def fileno(self) -> int:
        """Return the pipe's descriptor; -1 once all writers have closed it."""
        return self._descriptor

    def drain(self) -> None:
        """Read the available output, without waiting."""
        pieces = 0
        while self._descriptor >= 0 and (pieces < self._most_pieces or not self._most_pieces):
            try:
                data = os.read(self._descriptor, _PIECE_BYTES)
            except BlockingIOError:
                return
            self._take(data)
            pieces += 1
            if not data:
                self.close()

    def close(self) -> None:
        """Close the pipe."""
        if self._descriptor >= 0:
            os.close(self._descriptor)
            self._descriptor = -1

    def _take(self, data: bytes) -> None:
        """Use a piece of the output; it is empty at the end."""
        raise NotImplementedError


class OutputTail(OutputPipe):
    """The end of the output of a process and its forks. The text remains when the pipe is closed."""

    def __init__(self, descriptor: int) -> None:
        super().__init__(descriptor)
        self._chunks: deque[bytes] = deque()

    def wait(self, timeout_s: float) -> bool:
        """Wait at most `timeout_s` seconds for output, and read it. Returns True if there was some."""
        if self._descriptor < 0:
            return False
        poller = select.poll()  # not `select`, which cannot watch descriptors from 1024 on
        poller.register(self._descriptor, select.POLLIN)
        ready = bool(poller.poll(int(timeout_s * 1000)))
        self.drain()
        return ready

    def text(self) -> str:
        """Return the end of the output. Undecodable bytes are replaced."""
        return b"".join(self._chunks).decode(errors="replace")

    def _take(self, data: bytes) -> None:
        self._chunks.append(data[-_TAIL_BYTES:])
        while sum(map(len, self._chunks)) - len(self._chunks[0]) >= _TAIL_BYTES:
            self._chunks.popleft()


__all__ = ["OutputPipe", "OutputTail"]
