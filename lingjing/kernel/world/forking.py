"""Processes that begin with everything imported: what is asked of a fork server (`fork_server`), and what it starts.

A `ForkServer` belongs to one command. It runs a module as `python -m` would (`run_module`), in a fork of a process that
has imported the modules it was started with. What runs there has a `ForkServerClient`, through which it gets its world
process and its camera process. The server tells of each process that it has started its pid, with a descriptor of the
process, and at the end its status.
"""

from __future__ import annotations

import os
import select
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Sequence
from concurrent.futures import Future
from pathlib import Path
from typing import Literal, Self

import msgspec

from lingjing.errors import InfrastructureError
from lingjing.numerics import worker_environment

WorkerPlace = Literal["world", "camera"]

_QUIET = {"MUJOCO_GL": "disable", "JSBSIM_DEBUG": "0"}
"""MuJoCo would load a windowing library, which a process that is to be forked must not hold; JSBSim is loud."""

HASH_SEED = "0"
"""`PYTHONHASHSEED` of every process that is started here: the order of a set of texts is the same in each of them."""

_MODULE = "lingjing.kernel.world.fork_server"
_TOLD = 4
"""Bytes of a pid and of a status."""


class WorkerSettings(msgspec.Struct, frozen=True):
    """How the workers of a world are started; see `lingjing.kernel.world.open_world` for the meaning."""

    plugins: tuple[str, ...] = ()
    paths: tuple[str, ...] = ()
    installed: bool = True


class RunModule(msgspec.Struct, frozen=True, tag=True):
    """Run a module with arguments. With it come standard input, output and error, and the socket to tell through.
    The folder and the variables are bytes as the system has them: neither need be UTF-8."""

    module: str
    arguments: tuple[str, ...]
    folder: bytes
    environment: dict[bytes, bytes]


class StartWorker(msgspec.Struct, frozen=True, tag=True):
    """Start a worker, or hand over one that is idle. With it come its channel, its progress memory, what it writes its
    output to, the socket to tell through, and a descriptor of the process that asks: the worker ends with it. `start`
    is the key of the world's start (`placed_worlds`), empty if it is not to be had placed."""

    place: WorkerPlace
    settings: WorkerSettings
    start: bytes = b""


class CallFunction(msgspec.Struct, frozen=True, tag=True):
    """Call a function, `module:name`, with a text, for what later forks shall share."""

    function: str
    argument: str


class StartFunction(msgspec.Struct, frozen=True, tag=True):
    """Call a function, `module:name`, with descriptors in a process of its own. With it come those descriptors, what
    it writes its output to, the socket to tell through, and a descriptor of the process that asks: it ends with that.
    """

    function: str
    folder: bytes
    environment: dict[bytes, bytes]


ForkRequest = RunModule | StartWorker | CallFunction | StartFunction


class ForkedProcess:
    """A process that a fork server has started: the part of `subprocess.Popen` that is needed of it. `LOST` is the
    return code of one that ended when its server was gone."""

    LOST = 255

    def __init__(self, told: socket.socket) -> None:
        self._told = told
        self.returncode: int | None = None
        data, descriptors, _, _ = socket.recv_fds(told, _TOLD, 1, socket.MSG_CMSG_CLOEXEC)
        if not descriptors:
            told.close()
            raise InfrastructureError(
                "the process that starts others has ended, or could start no more",
                hint="what it said is on standard error; see also `ulimit -u`",
            )
        self.pid = int.from_bytes(data, "little")
        self.pidfd = descriptors[0]

    def poll(self) -> int | None:
        """The return code, or None while it runs; as `Popen.poll`."""
        return self.returncode if self.returncode is not None else self._poll(0)

    def wait(self, timeout: float | None = None) -> int:
        """The return code; `subprocess.TimeoutExpired` after so many seconds."""
        code = self.returncode if self.returncode is not None else self._poll(timeout)
        if code is None:
            raise subprocess.TimeoutExpired("a forked process", timeout or 0.0)
        return code

    def terminate(self) -> None:
        """Send SIGTERM."""
        self._signal(signal.SIGTERM)

    def kill(self) -> None:
        """Send SIGKILL."""
        self._signal(signal.SIGKILL)

    def close(self) -> None:
        """Let go of it."""
        self._told.close()
        os.close(self.pidfd)

    def _poll(self, timeout_s: float | None) -> int | None:
        # It has ended when its descriptor says so; the server tells the status a moment later, or is gone.
        milliseconds = None if timeout_s is None else int(timeout_s * 1000)
        for waited in (self.pidfd, self._told.fileno()):
            poller = select.poll()
            poller.register(waited, select.POLLIN)
            if not poller.poll(milliseconds):
                return None
        data = self._told.recv(_TOLD)
        self.returncode = os.waitstatus_to_exitcode(int.from_bytes(data, "little")) if data else self.LOST
        return self.returncode

    def _signal(self, number: signal.Signals) -> None:
        signal.pidfd_send_signal(self.pidfd, number)


class ForkServerClient:
    """Where a process that was started by a fork server asks it for workers: a socket of packets, by descriptor."""

    def __init__(self, descriptor: int) -> None:
        self._socket = socket.socket(fileno=descriptor)

    def start_worker(
        self, place: WorkerPlace, settings: WorkerSettings, ends: tuple[int, int, int], start: bytes = b""
    ) -> ForkedProcess:
        """A worker at the far side of its channel, progress memory and output; with the key of an announced start, one
        that is placed already."""
        own = os.pidfd_open(os.getpid())
        try:
            return _asked(self._socket, StartWorker(place, settings, start), (*ends, own))
        finally:
            os.close(own)

    def start_function(self, function: str, ends: Sequence[int], output: int) -> ForkedProcess:
        """A process that calls `module:name` with these descriptors, in the working folder and the environment of this
        process. What it prints goes to `output`; it is killed, with all that it started, when this process ends."""
        own = os.pidfd_open(os.getpid())
        request = StartFunction(function, os.fsencode(Path.cwd()), dict(os.environb))
        try:
            return _asked(self._socket, request, (*ends, output, own))
        finally:
            os.close(own)

    def close(self) -> None:
        """Let go of the server."""
        self._socket.close()


class ForkServer:
    """The caller's end of a fork server; a context manager. It and everything that it has started end with the caller.

    `imports` are modules that it imports before it forks. Raises `InfrastructureError` where it cannot be started.
    """

    def __init__(self, imports: Sequence[str]) -> None:
        ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        self._socket = ours
        command = [sys.executable, "-P", "-m", _MODULE, "--fd", str(theirs.fileno()), "--parent", str(os.getpid())]
        try:
            self._process = started_to_last([*command, *imports], environment(()), (theirs.fileno(),), None)
        except OSError as error:
            ours.close()
            raise InfrastructureError(f"the process that starts episodes cannot be started: {error}") from error
        finally:
            theirs.close()

    @property
    def pid(self) -> int:
        """Its process id."""
        return self._process.pid

    def run_module(self, module: str, arguments: Sequence[str], streams: tuple[int, int, int]) -> ForkedProcess:
        """Run `python -m module arguments` with these descriptors as its standard streams, in the working folder and
        the environment of this process. It gets SIGTERM when the server ends."""
        request = RunModule(module, tuple(arguments), os.fsencode(Path.cwd()), dict(os.environb))
        return _asked(self._socket, request, streams)

    def client(self) -> ForkServerClient:
        """Another caller's end of this server, for processes that this process works with; closed by its user."""
        return ForkServerClient(os.dup(self._socket.fileno()))

    def call(self, function: str, argument: str) -> None:
        """Have it call a function, `module:name`, before it forks again. An error of it is nobody's: what a fork does
        not find, it does itself, and tells what is wrong."""
        send_request(self._socket, CallFunction(function, argument), ())

    def close(self) -> None:
        """End it, with what still runs."""
        self._socket.close()
        self._process.wait()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def environment(paths: Sequence[str]) -> dict[str, str]:
    """The environment of a worker process: modules from `paths` and from where the caller has them, what chooses code
    by processor fixed, one thread for every library."""
    search = [*paths, *(path or os.getcwd() for path in sys.path)]  # noqa: PTH109 - an entry of PYTHONPATH
    fixed = {"PYTHONPATH": os.pathsep.join(dict.fromkeys(search)), "PYTHONUNBUFFERED": "1"}
    return worker_environment({**os.environ, **_QUIET, **fixed, "PYTHONHASHSEED": HASH_SEED})


def started_to_last(
    command: list[str], variables: dict[str, str], descriptors: tuple[int, ...], output: int | None
) -> subprocess.Popen[bytes]:
    """A process that no thread's end takes with it, and that is never a zombie.

    A parent-death signal follows the *thread* that started a child, so the thread that starts it waits for its end.
    """
    outcome: Future[subprocess.Popen[bytes]] = Future()

    def start_and_wait() -> None:
        # Held back in what starts, which says what it does with SIGINT as soon as it can and lets it come.
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            process = subprocess.Popen(
                command,
                env=variables,
                pass_fds=descriptors,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL if output is None else output,
                stderr=output,
                process_group=0,
            )
        except OSError as error:
            outcome.set_exception(error)
            return
        outcome.set_result(process)
        process.wait()

    threading.Thread(target=start_and_wait, name=f"lingjing-{command[-1]}", daemon=True).start()
    return outcome.result()


def _asked(asking: socket.socket, request: ForkRequest, descriptors: Sequence[int]) -> ForkedProcess:
    ours, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_STREAM)
    try:
        with theirs:
            send_request(asking, request, (*descriptors, theirs.fileno()))
    except InfrastructureError:
        ours.close()
        raise
    return ForkedProcess(ours)


def send_request(asking: socket.socket, request: ForkRequest, descriptors: Sequence[int]) -> None:
    """Send a request with its descriptors. Raises `InfrastructureError` if the other end is gone."""
    letter = os.memfd_create("lingjing-request", os.MFD_CLOEXEC)  # of any size, which a packet is not
    try:
        with open(letter, "wb") as file:  # noqa: PTH123 - a descriptor
            file.write(msgspec.msgpack.encode(request))
            file.flush()
            socket.send_fds(asking, [b"r"], [letter, *descriptors])
    except OSError as error:
        raise InfrastructureError(f"the process that starts others is gone: {error}") from error
