"""The caller's side of a fork server: `ForkServer` starts one, `ForkServerClient` requests a `ForkedProcess` from it.

A `ForkServer` belongs to one command. It imports modules, and runs a module as `python -m` does (`run_module`) in a
fork of itself. That module has a `ForkServerClient`, through which it starts its own processes (`start_function`).
"""

from __future__ import annotations

import os
import select
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Mapping, Sequence
from concurrent.futures import Future
from pathlib import Path
from typing import Self

import msgspec

from lingjing.errors import InfrastructureError
from lingjing.numerics import worker_environment
from lingjing.processes.channel import Channel, ChannelClosedError, NoMemoryError
from lingjing.processes.fork_requests import (
    CallFunction,
    ForkRequest,
    KeepResult,
    RunModule,
    StartFunction,
    Surroundings,
    Template,
)
from lingjing.processes.kept_results import keep_result
from lingjing.processes.walls.file_system import SCRATCH

HASH_SEED = "0"
"""`PYTHONHASHSEED` of every started process: the iteration order of a set of strings is the same in each of them."""

CLEAN_VARIABLES = ("LANG", "LC_ALL", "LC_CTYPE", "TZ", "PYTHONDONTWRITEBYTECODE", "LINGJING_POLICY_MEMORY_GB")
"""The variables of the caller that a fork server for foreign code has."""

_MODULE = "lingjing.processes.fork_server"
"""The module that a fork server runs."""


class ForkedProcess:
    """A process that a fork server has started, with a part of the interface of `subprocess.Popen`.

    The server sends the process id with a pidfd, and at the end the wait status. Raises `InfrastructureError` if the
    server ends first, or cannot fork.
    """

    LOST = 255
    """The return code of a process that outlived its server."""

    def __init__(self, reports: Channel) -> None:
        self._reports = reports
        self.returncode: int | None = None
        try:
            started = reports.receive()
        except ChannelClosedError:
            reports.close()
            raise InfrastructureError(
                "the process that starts others has ended, or cannot start more",
                hint="see its messages on standard error, and `ulimit -u`",
                cause="fork-server",
            ) from None
        (self.pidfd,) = started.descriptors
        self.pid = _pid_here(self.pidfd) or int.from_bytes(started.payload, "little")

    def poll(self) -> int | None:
        """Return the return code; None while the process runs."""
        return self.returncode if self.returncode is not None else self._poll(0)

    def wait(self, timeout: float | None = None) -> int:
        """Return the return code. Raises `subprocess.TimeoutExpired` after `timeout` seconds."""
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
        """Close the descriptors. The process continues."""
        self._reports.close()
        os.close(self.pidfd)

    def _poll(self, timeout_s: float | None) -> int | None:
        # The pidfd shows the end; the server sends the status a moment later, or has ended.
        milliseconds = None if timeout_s is None else int(timeout_s * 1000)
        for descriptor in (self.pidfd, self._reports.fileno()):
            poller = select.poll()
            poller.register(descriptor, select.POLLIN)
            if not poller.poll(milliseconds):
                return None
        try:
            status = int.from_bytes(self._reports.receive().payload, "little")
        except ChannelClosedError:
            self.returncode = self.LOST
        else:
            self.returncode = os.waitstatus_to_exitcode(status)
        return self.returncode

    def _signal(self, number: signal.Signals) -> None:
        signal.pidfd_send_signal(self.pidfd, number)


class ForkServerClient:
    """A connection to a fork server, for requests. `descriptor`: its socket, which this object owns."""

    def __init__(self, descriptor: int) -> None:
        self._channel = Channel(socket.socket(fileno=descriptor))

    def start_function(
        self,
        function: str,
        ends: Sequence[int],
        output: int,
        *,
        argument: bytes = b"",
        here: bool = True,
        reuse: bool = False,
        template: Template | None = None,
        layer: str = "",
    ) -> ForkedProcess:
        """Start a process that calls a function (`module:name`) with the argument and copies of the descriptors `ends`.

        `output` receives its standard output and error. It is killed with its descendants when this process ends. With
        `here` it has the working folder and the environment of this process, otherwise those of the server. For
        `reuse`, `template` and `layer` see `StartFunction`.
        """
        own = os.pidfd_open(os.getpid())
        surroundings = _own_surroundings() if here else None
        request = StartFunction(function, argument, surroundings, reuse, template, layer)
        try:
            return _start(self._channel, request, (*ends, output, own))
        finally:
            os.close(own)

    def keep_result(self, key: bytes, result: bytes) -> None:
        """Keep a result in this process, and in the server for its later forks (`kept_results.find_result`)."""
        keep_result(key, result)
        send_request(self._channel, KeepResult(key, result), ())

    def fileno(self) -> int:
        """Return the descriptor of the connection."""
        return self._channel.fileno()

    def close(self) -> None:
        """Close this end."""
        self._channel.close()


class ForkServer:
    """A fork server and the connection to it; a context manager. All its processes end with the caller.

    `imports` are modules that it imports before it forks; `layers` are the further modules of each layer, by name.
    `variables` are set in its environment before the imports. With `walls` it has none of the caller's variables but
    `CLEAN_VARIABLES`, and its forks can build walls around themselves (`lingjing.processes.walls`). Raises
    `InfrastructureError` if it cannot be started.
    """

    def __init__(
        self,
        imports: Sequence[str],
        layers: Mapping[str, Sequence[str]] | None = None,
        variables: Mapping[str, str] | None = None,
        *,
        walls: bool = False,
    ) -> None:
        ours, theirs = socket.socketpair()
        command = [sys.executable, "-P", "-m", _MODULE, "--fd", str(theirs.fileno()), "--parent", str(os.getpid())]
        try:
            further = [f"--layer={name}={','.join(modules)}" for name, modules in (layers or {}).items()]
            environ = clean_environment() if walls else environment((), variables or {})
            further += ["--walls"] if walls else []
            self._process = start_to_last([*command, *further, *imports], environ, (theirs.fileno(),), None)
        except OSError as error:
            ours.close()
            raise InfrastructureError(f"the process that starts episodes cannot be started: {error}") from error
        finally:
            theirs.close()
        self._channel = Channel(ours)

    @property
    def pid(self) -> int:
        """The process id of the server."""
        return self._process.pid

    @property
    def descriptor(self) -> int:
        """The descriptor of the connection. Several processes may send requests through it."""
        return self._channel.fileno()

    @property
    def has_ended(self) -> bool:
        """True if the server has ended."""
        return self._process.poll() is not None

    def run_module(
        self,
        module: str,
        arguments: Sequence[str],
        streams: tuple[int, int, int],
        further: Mapping[str, int] | None = None,
    ) -> ForkedProcess:
        """Run `python -P -m module arguments` with these descriptors as its standard streams.

        `further` are descriptors that the process receives as well, by the option that names each. It has the working
        folder and the environment of this process, and receives SIGTERM when the server ends.
        """
        names, descriptors = tuple(further or {}), tuple((further or {}).values())
        request = RunModule(module, tuple(arguments), _own_surroundings(), names)
        return _start(self._channel, request, (*streams, *descriptors))

    def client(self) -> ForkServerClient:
        """Return another connection to this server, for processes that this process works with. The caller closes
        it."""
        return ForkServerClient(os.dup(self._channel.fileno()))

    def call(self, function: str, argument: str, *, in_layers: bool = False) -> None:
        """Let the server call a function (`module:name`) before its next fork, and its layers too with `in_layers`.

        Errors of the function are not reported. A fork without the result does the work itself, and reports the error.
        """
        send_request(self._channel, CallFunction(function, argument, in_layers), ())

    def close(self) -> None:
        """End the server and all its processes."""
        self._channel.close()
        self._process.wait()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def environment(paths: Sequence[str], variables: Mapping[str, str]) -> dict[str, str]:
    """Return the environment of a started process: that of this process, with `variables`.

    Modules are found in `paths` and on this process's path. Variables that select code by processor are fixed, and
    every library uses one thread.
    """
    search = [*paths, *(path or os.getcwd() for path in sys.path)]  # noqa: PTH109 - an entry of PYTHONPATH
    fixed = {"PYTHONPATH": os.pathsep.join(dict.fromkeys(search)), "PYTHONUNBUFFERED": "1"}
    return worker_environment({**os.environ, **variables, **fixed, "PYTHONHASHSEED": HASH_SEED})


def clean_environment() -> dict[str, str]:
    """Return the environment of a process for foreign code: no key, no home and no folder of the caller."""
    kept = {name: os.environ[name] for name in CLEAN_VARIABLES if name in os.environ}
    search = [path for path in sys.path if os.path.isabs(path)]  # noqa: PTH117
    fixed = {"PYTHONPATH": os.pathsep.join(search), "PYTHONUNBUFFERED": "1", "HOME": SCRATCH, "TMPDIR": SCRATCH}
    fixed["LINGJING_UNTRIED_PLUGINS"] = "1"  # a trial of a plug-in would need a process
    return worker_environment({**kept, **fixed, "PYTHONHASHSEED": HASH_SEED})


def start_to_last(
    command: list[str], variables: dict[str, str], descriptors: tuple[int, ...], output: int | None
) -> subprocess.Popen[bytes]:
    """Start a process that survives the end of the calling thread, and that is reaped when it ends.

    A parent-death signal follows the *thread* that has started a child (prctl(2)). So a thread of its own starts the
    child and waits for its end.
    """
    outcome: Future[subprocess.Popen[bytes]] = Future()

    def start_and_wait() -> None:
        # The child inherits the mask. It unblocks SIGINT after it has set its handler.
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


def send_request(server: Channel, request: ForkRequest, descriptors: Sequence[int]) -> None:
    """Send a request with its descriptors. Raises `InfrastructureError` if the server has ended."""
    try:
        server.send_in_memory(msgspec.msgpack.encode(request), descriptors)
    except NoMemoryError as error:
        message = f"the process that starts others cannot receive a request: {error}"
        raise InfrastructureError(message, cause="fork-server") from error
    except ChannelClosedError as error:
        message = f"the process that starts others has ended: {error}"
        raise InfrastructureError(message, cause="fork-server") from error


def _pid_here(pidfd: int) -> int:
    """Return the process id behind a pidfd in the namespace of this process; 0 if it has none or `/proc` is missing."""
    try:
        lines = Path(f"/proc/self/fdinfo/{pidfd}").read_text().splitlines()
    except OSError:
        return 0
    return max(0, next((int(line[4:]) for line in lines if line.startswith("Pid:")), 0))


def _start(server: Channel, request: ForkRequest, descriptors: Sequence[int]) -> ForkedProcess:
    ours, theirs = socket.socketpair()
    reports = Channel(ours)
    try:
        with theirs:
            send_request(server, request, (*descriptors, theirs.fileno()))
    except InfrastructureError:
        reports.close()
        raise
    return ForkedProcess(reports)


def _own_surroundings() -> Surroundings:
    return Surroundings(os.fsencode(Path.cwd()), dict(os.environb))


__all__ = [
    "HASH_SEED", "ForkServer", "ForkServerClient", "ForkedProcess", "environment", "send_request", "start_to_last",
]  # fmt: skip
