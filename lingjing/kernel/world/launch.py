"""Starting a worker process: its command, its standard error, and what its caller holds of it.

Rules learnt by trying: `Popen` over a socket pair, because `multiprocessing` breaks scripts
without a main guard, or a fork server; what chooses code by processor and thread counts fixed in the environment before
any import; a process group of its own, so that a terminal's Ctrl-C reaches the caller alone.
"""

from __future__ import annotations

import fcntl
import os
import socket
import subprocess
import sys
from dataclasses import dataclass
from typing import Literal, Protocol

import msgspec

from lingjing.errors import InfrastructureError
from lingjing.kernel.world.shared import progress_memory
from lingjing.processes.fork_client import ForkServerClient, environment, start_to_last
from lingjing.processes.fork_requests import Template
from lingjing.processes.output import OutputTail

WorkerPlace = Literal["world", "camera"]

_PIPE_BYTES = 1_048_576
"""Room for the output of one worker while the caller waits for the other one. The most that Linux grants a user by
default (`/proc/sys/fs/pipe-max-size`)."""

_FUNCTIONS = {
    "world": "lingjing.kernel.world.worker:serve_as_world",
    "camera": "lingjing.kernel.world.worker:serve_as_camera",
}
_PLACED = "lingjing.kernel.world.worker:placed_template"


class WorkerSettings(msgspec.Struct, frozen=True):
    """The plug-ins of a worker; see `lingjing.kernel.world.open_world` for the meaning."""

    plugins: tuple[str, ...] = ()
    paths: tuple[str, ...] = ()
    installed: bool = True


class WorkerProcess(Protocol):
    """A process that a worker runs in: a `subprocess.Popen`, or a `ForkedProcess`."""

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
    words: OutputTail
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
    ours, theirs = socket.socketpair()
    progress = progress_memory()
    reading, writing = os.pipe2(os.O_CLOEXEC)
    fcntl.fcntl(writing, fcntl.F_SETPIPE_SZ, _PIPE_BYTES)
    try:
        if fork_server is not None:
            forked = fork_server.start_function(
                _FUNCTIONS[place],
                (theirs.fileno(), progress),
                writing,
                argument=msgspec.msgpack.encode(settings),
                here=False,
                reuse=place == "camera",
                template=Template(_PLACED, start) if start else None,
            )
            return Launched(forked, os.dup(forked.pidfd), ours, progress, OutputTail(reading), place == "camera")
        process = _started(place, settings, (theirs.fileno(), progress), writing)
        return Launched(process, os.pidfd_open(process.pid), ours, progress, OutputTail(reading))
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
    ends = ["--fd", str(descriptors[0]), "--progress", str(descriptors[1]), "--parent", str(os.getpid())]
    options = [] if settings.installed else ["--bare"]
    options += [part for plugin in settings.plugins for part in ("--plugin", plugin)]
    return start_to_last([*python, *ends, *options, "--place", place], environment(settings.paths), descriptors, output)
