"""Starting a worker process: its command, its standard error, and what its caller holds of it.

Rules learnt by trying: `Popen` over a socket pair, because `multiprocessing` breaks scripts
without a main guard, or a fork server; what chooses code by processor and thread counts fixed in the environment before
any import; a process group of its own, so that a terminal's Ctrl-C reaches the caller alone.
"""

from __future__ import annotations

import fcntl
import os
import select
import socket
import subprocess
import sys
from collections import deque
from dataclasses import dataclass
from typing import Protocol

from lingjing.errors import InfrastructureError
from lingjing.kernel.world.forking import ForkServerClient, WorkerPlace, WorkerSettings, environment, started_to_last
from lingjing.kernel.world.shared import progress_memory

_TAIL_BYTES = 16_384
_PIPE_BYTES = 1_048_576


class ErrorOutput:
    """The end of what a worker and its forks write to standard output and error, read whenever the caller waits."""

    def __init__(self, descriptor: int) -> None:
        os.set_blocking(descriptor, False)
        self._descriptor = descriptor
        self._chunks: deque[bytes] = deque()

    def fileno(self) -> int:
        """The pipe's descriptor, -1 when all writers are gone."""
        return self._descriptor

    def drain(self) -> None:
        """Read what is there; only the last few kilobytes are kept."""
        while self._descriptor >= 0:
            try:
                chunk = os.read(self._descriptor, 65_536)
            except BlockingIOError:
                return
            if not chunk:
                self.close()
            self._keep(chunk)

    def wait(self, timeout_s: float) -> bool:
        """Wait for something to be written, at most so long, and read it; whether there was something."""
        if self._descriptor < 0:
            return False
        poller = select.poll()  # not `select`, which cannot watch descriptors from 1024 on
        poller.register(self._descriptor, select.POLLIN)
        ready = bool(poller.poll(int(timeout_s * 1000)))
        self.drain()
        return ready

    def text(self) -> str:
        """What was kept."""
        return b"".join(self._chunks).decode(errors="replace")

    def close(self) -> None:
        """Close the pipe; what was read stays."""
        if self._descriptor >= 0:
            os.close(self._descriptor)
            self._descriptor = -1

    def _keep(self, chunk: bytes) -> None:
        self._chunks.append(chunk[-_TAIL_BYTES:])
        while sum(map(len, self._chunks)) - len(self._chunks[0]) >= _TAIL_BYTES:
            self._chunks.popleft()


class WorkerProcess(Protocol):
    """A process that a worker runs in: a `subprocess.Popen`, or a `forking.ForkedProcess`."""

    pid: int

    def wait(self, timeout: float | None = None) -> int:
        """The return code; `subprocess.TimeoutExpired` after so many seconds."""
        ...


@dataclass(frozen=True, slots=True)
class Launched:
    """A worker that has been started: the caller owns all of it. One that is `lent` outlives its use."""

    process: WorkerProcess
    pidfd: int
    end: socket.socket
    progress: int
    words: ErrorOutput
    lent: bool = False


def launch(
    place: WorkerPlace, settings: WorkerSettings, fork_server: ForkServerClient | None, start: bytes = b""
) -> Launched:
    """Start a worker, which answers when it is up: `python -m lingjing.kernel.world.worker`, or by the fork server,
    which may have a world with this `start` placed already."""
    try:
        return _launch(place, settings, fork_server, start)
    except OSError as error:
        raise InfrastructureError(f"the {place} process cannot be started: {error}") from error


def _launch(
    place: WorkerPlace, settings: WorkerSettings, fork_server: ForkServerClient | None, start: bytes
) -> Launched:
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_STREAM)
    progress = progress_memory()
    reading, writing = os.pipe2(os.O_CLOEXEC)
    # Room for what a worker says while the caller waits for the other one.
    fcntl.fcntl(writing, fcntl.F_SETPIPE_SZ, _PIPE_BYTES)
    try:
        if fork_server is not None:
            forked = fork_server.start_worker(place, settings, (theirs.fileno(), progress, writing), start)
            return Launched(forked, os.dup(forked.pidfd), ours, progress, ErrorOutput(reading), place == "camera")
        process = _started(place, settings, (theirs.fileno(), progress), writing)
        return Launched(process, os.pidfd_open(process.pid), ours, progress, ErrorOutput(reading))
    except BaseException:
        ours.close()
        os.close(progress)
        os.close(reading)
        raise
    finally:
        theirs.close()
        os.close(writing)


def _started(
    place: WorkerPlace, settings: WorkerSettings, descriptors: tuple[int, int], output: int
) -> subprocess.Popen[bytes]:
    # -P: the worker takes its modules from where the caller does, not from the folder it happens to run in.
    python = [sys.executable, "-P", "-m", "lingjing.kernel.world.worker"]
    told = ["--fd", str(descriptors[0]), "--progress", str(descriptors[1]), "--parent", str(os.getpid())]
    options = [] if settings.installed else ["--bare"]
    options += [part for plugin in settings.plugins for part in ("--plugin", plugin)]
    return started_to_last(
        [*python, *told, *options, "--place", place], environment(settings.paths), descriptors, output
    )
