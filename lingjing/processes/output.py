"""The output of a process, read from a pipe whenever its caller waits."""

from __future__ import annotations

import os
import select
from collections import deque

_TAIL_BYTES = 16_384
"""The end of the output that is kept. Chosen: a traceback of a hundred lines."""


class OutputTail:
    """The end of the standard output and error of a process and its forks. `descriptor`: the pipe, which it owns."""

    def __init__(self, descriptor: int) -> None:
        os.set_blocking(descriptor, False)
        self._descriptor = descriptor
        self._chunks: deque[bytes] = deque()

    def fileno(self) -> int:
        """The pipe's descriptor, -1 when all writers have closed it."""
        return self._descriptor

    def drain(self) -> None:
        """Read what has come, without waiting."""
        while self._descriptor >= 0:
            try:
                chunk = os.read(self._descriptor, 65_536)
            except BlockingIOError:
                return
            if not chunk:
                self.close()
            self._keep(chunk)

    def wait(self, timeout_s: float) -> bool:
        """Wait at most so long for output, and read it; True if there was some."""
        if self._descriptor < 0:
            return False
        poller = select.poll()  # not `select`, which cannot watch descriptors from 1024 on
        poller.register(self._descriptor, select.POLLIN)
        ready = bool(poller.poll(int(timeout_s * 1000)))
        self.drain()
        return ready

    def text(self) -> str:
        """The end of the output, with undecodable bytes replaced."""
        return b"".join(self._chunks).decode(errors="replace")

    def close(self) -> None:
        """Close the pipe; the text stays."""
        if self._descriptor >= 0:
            os.close(self._descriptor)
            self._descriptor = -1

    def _keep(self, chunk: bytes) -> None:
        self._chunks.append(chunk[-_TAIL_BYTES:])
        while sum(map(len, self._chunks)) - len(self._chunks[0]) >= _TAIL_BYTES:
            self._chunks.popleft()
