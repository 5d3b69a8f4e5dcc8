"""The start of a worker process: its command, its standard error, and the caller's handles.

Design, each point found by experiment:

- `Popen` over a socket pair, or a fork server: `multiprocessing` breaks scripts without a main guard.
- Instruction sets and thread counts are fixed in the environment before any import: libraries read them once.
- A process group of its own: Ctrl-C in a terminal reaches the caller alone.
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
"""The kind of a worker process."""

_PIPE_BYTES = 1_048_576
"""Capacity for the output of one worker while the caller waits for the other. The largest that Linux grants a user by
default (`/proc/sys/fs/pipe-max-size`).
"""

_FUNCTIONS = {
    "world": "lingjing.kernel.world.worker:serve_as_world",
    "camera": "lingjing.kernel.world.worker:serve_as_camera",
}
ENGINES = "engines"
"""The layer of a fork server that has imported engines."""

ENGINE_VARIABLES = {"MUJOCO_GL": "disable", "JSBSIM_DEBUG": "0"}
"""Variables that libraries of engines read as they are imported. MuJoCo would load a windowing library otherwise, which
a process that is to be forked must not hold; JSBSim would print a banner."""

_PLACED = "lingjing.kernel.world.worker:placed_template"


class WorkerSettings(msgspec.Struct, frozen=True):
    """The plug-ins of a worker; see `lingjing.kernel.world.open_world` for the fields."""

    plugins: tuple[str, ...] = ()
    paths: tuple[str, ...] = ()
    installed: bool = True


class WorkerProcess(Protocol):
    """The process of a worker: a `subprocess.Popen` or a `ForkedProcess`."""

    pid: int

    def wait(self, timeout: float | None = None) -> int:
        """Return the exit code. Raises `subprocess.TimeoutExpired` after `timeout` seconds."""
        ...


@dataclass(frozen=True, slots=True)
class _Launched:
    """A started worker. The caller owns all its handles."""

    process: WorkerProcess
    """The process."""
    pidfd: int
    """A descriptor of the process, for signals and waiting."""
    end: socket.socket
    """The caller's end of the channel."""
    progress: int
    """A descriptor of the memory of `shared.CallMonitor`."""
    output: OutputTail
    """The standard output and error of the worker."""
    lent: bool = False
    """True if the process belongs to the fork server and outlives its use."""


def launch(
    place: WorkerPlace, settings: WorkerSettings, fork_server: ForkServerClient | None, start: bytes = b""
) -> _Launched:
    """Start a worker: `python -m lingjing.kernel.world.worker`, or through the fork server.

    A fork server may have a world with the key `start` at its boundary 0 already. Raises `InfrastructureError` if the
    process cannot be started.
    """
    try:
        return _launch(place, settings, fork_server, start)
    except OSError as error:
        raise InfrastructureError(f"the {place} process cannot be started: {error}") from error


def _launch(
    place: WorkerPlace, settings: WorkerSettings, fork_server: ForkServerClient | None, start: bytes
) -> _Launched:
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
                layer=ENGINES,
            )
            return _Launched(forked, os.dup(forked.pidfd), ours, progress, OutputTail(reading), place == "camera")
        process = _started(place, settings, (theirs.fileno(), progress), writing)
        return _Launched(process, os.pidfd_open(process.pid), ours, progress, OutputTail(reading))
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
    # -P: the worker must import the caller's modules, not those in its working directory.
    python = [sys.executable, "-P", "-m", "lingjing.kernel.world.worker"]
    ends = ["--fd", str(descriptors[0]), "--progress", str(descriptors[1]), "--parent", str(os.getpid())]
    options = [] if settings.installed else ["--bare"]
    options += [part for plugin in settings.plugins for part in ("--plugin", plugin)]
    variables = environment(settings.paths, ENGINE_VARIABLES)
    return start_to_last([*python, *ends, *options, "--place", place], variables, descriptors, output)
