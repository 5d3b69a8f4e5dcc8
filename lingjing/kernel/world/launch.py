"""Starting a worker process: its command, its environment, its standard error, and a thread that outlives it.

Rules learnt by trying (DESIGN section 4): `Popen` over a socket pair, because `multiprocessing` breaks scripts
without a main guard; what chooses code by processor and thread counts fixed in the
environment before any import; a process group of its own, so that a
terminal's Ctrl-C reaches the caller alone. A parent-death signal follows the *thread* that started a child, so each
worker is started by a thread that then waits for it to end: it dies with the caller and not with whichever thread
happened to ask for it, and it never stays a zombie.
"""

from __future__ import annotations

import fcntl
import os
import select
import socket
import subprocess
import sys
import threading
from collections import deque
from collections.abc import Sequence
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Literal

from lingjing.errors import InfrastructureError
from lingjing.kernel.world.shared import progress_memory
from lingjing.numerics import worker_environment

WorkerPlace = Literal["world", "camera"]

_TAIL_BYTES = 16_384
_PIPE_BYTES = 1_048_576
_QUIET = {"MUJOCO_GL": "disable", "JSBSIM_DEBUG": "0"}
"""MuJoCo would load a windowing library, which a process that is to be forked must not hold; JSBSim is loud."""


@dataclass(frozen=True, slots=True)
class WorkerSettings:
    """How the workers of a world are started; see `lingjing.kernel.world.open_world` for the meaning."""

    plugins: tuple[str, ...] = ()
    paths: tuple[str, ...] = ()
    installed: bool = True

    def arguments(self, place: WorkerPlace) -> list[str]:
        """The worker's command line but for its descriptors."""
        options = ["--place", place, "--parent", str(os.getpid())]
        options += [] if self.installed else ["--bare"]
        return options + [part for plugin in self.plugins for part in ("--plugin", plugin)]


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


@dataclass(frozen=True, slots=True)
class Launched:
    """A worker that has been started: the caller owns all of it."""

    process: subprocess.Popen[bytes]
    pidfd: int
    end: socket.socket
    progress: int
    words: ErrorOutput


def launch(place: WorkerPlace, settings: WorkerSettings) -> Launched:
    """Start `python -m lingjing.kernel.world.worker`; returns at once, the worker answers when it is up."""
    try:
        return _launch(place, settings)
    except OSError as error:
        raise InfrastructureError(f"the {place} process cannot be started: {error}") from error


def _launch(place: WorkerPlace, settings: WorkerSettings) -> Launched:
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_STREAM)
    progress = progress_memory()
    reading, writing = os.pipe2(os.O_CLOEXEC)
    # Room for what a worker says while the caller waits for the other one.
    fcntl.fcntl(writing, fcntl.F_SETPIPE_SZ, _PIPE_BYTES)
    descriptors = (theirs.fileno(), progress)
    try:
        command = [*_command(descriptors), *settings.arguments(place)]
        process, pidfd = _started(command, _environment(settings.paths), descriptors, writing)
    except BaseException:
        ours.close()
        os.close(progress)
        os.close(reading)
        raise
    finally:
        theirs.close()
        os.close(writing)
    return Launched(process, pidfd, ours, progress, ErrorOutput(reading))


def _command(descriptors: tuple[int, int]) -> list[str]:
    # -P: the worker takes its modules from where the caller does, not from the folder it happens to run in.
    python = [sys.executable, "-P", "-m", "lingjing.kernel.world.worker"]
    return [*python, "--fd", str(descriptors[0]), "--progress", str(descriptors[1])]


def _environment(paths: Sequence[str]) -> dict[str, str]:
    search = [*paths, *(path or os.getcwd() for path in sys.path)]  # noqa: PTH109 - an entry of PYTHONPATH
    fixed = {**_QUIET, "PYTHONPATH": os.pathsep.join(dict.fromkeys(search)), "PYTHONUNBUFFERED": "1"}
    return worker_environment({**os.environ, **fixed})


def _started(
    command: list[str], environment: dict[str, str], descriptors: tuple[int, ...], output: int
) -> tuple[subprocess.Popen[bytes], int]:
    outcome: Future[tuple[subprocess.Popen[bytes], int]] = Future()

    def start_and_wait() -> None:
        try:
            process = subprocess.Popen(
                command,
                env=environment,
                pass_fds=descriptors,
                stdin=subprocess.DEVNULL,
                stdout=output,
                stderr=output,
                process_group=0,
            )
        except OSError as error:
            outcome.set_exception(error)
            return
        try:
            outcome.set_result((process, os.pidfd_open(process.pid)))
        except OSError as error:
            process.kill()
            outcome.set_exception(error)
        process.wait()

    threading.Thread(target=start_and_wait, name=f"lingjing-{command[-1]}", daemon=True).start()
    return outcome.result()
