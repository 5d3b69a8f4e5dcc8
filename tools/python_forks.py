"""Python processes of tests as forks of one process that has imported this project, so that they need not import it.

`python -m lingjing.cli.main run` spends two seconds of processor time on imports: those of the command, of the process
from which policies are forked, of the world and of the camera. A fork of a process that has imported all of them is
ready in milliseconds. That process starts once for each process of tests, at the first use, and ends with it.

- `run_python` is `subprocess.run` for a command `python -m MODULE …` or `python -c CODE …`, `start_python` is
  `subprocess.Popen`, and `PipedFork` the same with pipes for its output.
- `forked_starts` makes forks of the processes that this project itself starts: worlds, cameras, fork servers and the
  branches of a trace.

A fork has the arguments, the environment, the working folder, the standard streams, the search path, the exit code and
the process group of a started interpreter. It differs in these points, so tests about them start an interpreter:

- All modules of this project and their libraries are imported, and strings have the hash seed 0.
- The encodings of the streams, and other settings that an interpreter reads as it starts, are those of the tests.
- Its parent is the process that forks, and it is killed when the process that requested it ends.
"""

from __future__ import annotations

import fcntl
import functools
import gc
import os
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from importlib.util import find_spec
from pathlib import Path
from typing import IO
from unittest import mock

import msgspec
from PIL import Image

from lingjing import run
from lingjing.bench.rows import code_sha256
from lingjing.bench.version import benchmark_version
from lingjing.causal import branch_host
from lingjing.cli.main import VERBS
from lingjing.decoding import from_msgpack
from lingjing.installed_plugins.entry_points import hold_entries
from lingjing.kernel.world import launch
from lingjing.play.parallel import ENGINE_MODULES, PLAYED_WITH, WITH_EXTRAS
from lingjing.play.policy_processes.preloading import SERVES
from lingjing.processes import fork_client
from lingjing.processes.fork_client import ForkedProcess, ForkServer, ForkServerClient
from lingjing.testing import mission_file, shortened
from tools.forked_python import ABOVE, PythonStart, run_start

WORKERS = frozenset(
    {"lingjing.processes.fork_server", "lingjing.kernel.world.worker", "lingjing.causal.branch_process"}
)
"""The modules that this project runs in processes of its own."""

_IMPORTED = (
    *PLAYED_WITH, *SERVES, *(f"lingjing.cli.{verb.name}" for verb in VERBS), *WORKERS, *ENGINE_MODULES,
    *(module for package, module in WITH_EXTRAS if find_spec(package)),
    "lingjing.bench.running", "lingjing.bench.tables", "lingjing.causal.branching", "lingjing.mission.feasibility",
    "lingjing.play.preparation", "lingjing.trace.reader", "lingjing.testing", "lingjing.dsl.checking.checker",
    "lingjing.dsl.feasibility.playability", "lingjing.mission.feasibility.wide", "lingjing.mission.trial",
    "lingjing.scene.districts.district", "lingjing_agents.oracle.policy", "lingjing_agents.heuristic.policy",
)  # fmt: skip
"""The modules that forks need not import."""

_PYTHON = sys.executable
"""The interpreter of the forks. A test may replace `sys.executable`: then its processes are no forks."""

_VARIABLES = {**launch.ENGINE_VARIABLES, "PYDANTIC_DISABLE_PLUGINS": "__all__"}
"""Variables that libraries read as they are imported. The command sets pydantic's itself."""

_start_to_last = fork_client.start_to_last
"""The start of a worker as an interpreter."""

_inherited: list[int] = []
"""In a fork: a descriptor of the connection to the process that forks."""


class PythonFork:
    """A fork, with a part of the interface of `subprocess.Popen`. It needs no `close`."""

    def __init__(self, process: ForkedProcess) -> None:
        self._process = process
        self.pid = process.pid
        self.poll, self.wait = process.poll, process.wait

    def terminate(self) -> None:
        """Send SIGTERM, unless the process has ended."""
        with suppress(ProcessLookupError):
            self._process.terminate()

    def kill(self) -> None:
        """Send SIGKILL, unless the process has ended."""
        with suppress(ProcessLookupError):
            self._process.kill()

    def __del__(self) -> None:
        self._process.close()


class PipedFork:
    """A command of `run_python` in a fork with a pipe each for its standard output and its standard error, as
    `subprocess.Popen` with `PIPE` and `text`. Its standard input is empty."""

    def __init__(self, command: Sequence[str], cwd: str | os.PathLike[str] | None = None) -> None:
        self.args = list(command)
        self.returncode: int | None = None
        with ExitStack() as stack:
            empty = stack.enter_context(open(os.devnull, "rb"))  # noqa: PTH123
            ends = []
            for _ in range(2):
                reading, writing = os.pipe()
                stack.callback(os.close, writing)
                ends.append((open(reading, encoding="utf-8", errors="replace"), writing))  # noqa: PTH123, SIM115
            (self.stdout, out), (self.stderr, err) = ends
            self._process = start_python(command, (empty.fileno(), out, err), cwd=cwd)
        self.pid = self._process.pid
        self.terminate, self.kill = self._process.terminate, self._process.kill

    def poll(self) -> int | None:
        """Return the exit code, or None while the process runs."""
        self.returncode = self._process.poll()
        return self.returncode

    def wait(self, timeout: float | None = None) -> int:
        """Wait for the end and return the exit code. Raises `subprocess.TimeoutExpired` after `timeout` seconds."""
        self.returncode = self._process.wait(timeout)
        return self.returncode

    def communicate(self, timeout: float | None = None) -> tuple[str, str]:
        """Return the rest of both outputs after the end. Raises `subprocess.TimeoutExpired` after `timeout` seconds."""
        texts = {}
        readers = [
            threading.Thread(target=lambda name=name, pipe=pipe: texts.update({name: pipe.read()}), daemon=True)
            for name, pipe in (("out", self.stdout), ("err", self.stderr))
        ]
        for reader in readers:
            reader.start()
        self.wait(timeout)
        for reader in readers:
            reader.join(timeout)
            if reader.is_alive():
                raise subprocess.TimeoutExpired(self.args, timeout or 0.0)
        self.stdout.close()
        self.stderr.close()
        return texts["out"], texts["err"]


def run_python(
    command: Sequence[str | bytes | os.PathLike[str]],
    *,
    cwd: str | bytes | os.PathLike[str] | None = None,
    env: Mapping[str, str] | None = None,
    input: str = "",  # noqa: A002 - the name in `subprocess.run`
    timeout: float = 900.0,
    check: bool = False,
) -> subprocess.CompletedProcess[str]:
    """Run `python [-P] -m MODULE …` or `python [-P] -c CODE …` in a fork, and return its exit code and its output.

    The arguments are those of `subprocess.run` with `capture_output` and `text`. Raises `ValueError` for another
    command, `subprocess.TimeoutExpired` after `timeout` seconds, and `subprocess.CalledProcessError` with `check`.
    """
    words = [os.fsdecode(word) for word in command]
    with ExitStack() as stack:
        streams = [stack.enter_context(tempfile.TemporaryFile()) for _ in range(3)]
        streams[0].write(input.encode())
        streams[0].seek(0)
        process = start_python(words, [stream.fileno() for stream in streams], cwd=cwd, env=env)
        try:
            code = process.wait(timeout)
        except subprocess.TimeoutExpired:
            process.kill()
            raise
        done = subprocess.CompletedProcess(words, code, _text(streams[1]), _text(streams[2]))
    if check:
        done.check_returncode()
    return done


def start_python(
    command: Sequence[str],
    streams: Sequence[int],
    *,
    cwd: str | bytes | os.PathLike[str] | None = None,
    env: Mapping[str, str] | None = None,
) -> PythonFork:
    """Start a command of `run_python` with these descriptors as its standard streams, and return its process."""
    start = _start_of(command, os.fsdecode(cwd or Path.cwd()), os.environ if env is None else env)
    return PythonFork(_fork(start, streams))


@contextmanager
def forked_starts() -> Iterator[None]:
    """Let the workers that this process starts within the block be forks.

    The process that forks starts here. At its first use it could be started by a command of a test that ends before
    that process is ready, and it would end with the command.
    """
    _server(os.getpid())
    with _starting_with(_start_fork):
        yield


@contextmanager
def true_starts() -> Iterator[None]:
    """Let the workers that this process starts within the block be interpreters, also within `forked_starts`."""
    with _starting_with(_start_to_last):
        yield


@contextmanager
def _starting_with(start: object) -> Iterator[None]:
    with ExitStack() as stack:
        for module in (fork_client, launch, branch_host):
            stack.enter_context(mock.patch.object(module, "start_to_last", start))
        yield


def _start_of(command: Sequence[str], folder: str, variables: Mapping[str, str]) -> PythonStart:
    is_safe = command[1:2] == ["-P"]
    arguments = command[2 if is_safe else 1 :]
    if command[0] != _PYTHON or not {"-m", "-c"}.intersection(arguments[:1]):
        raise ValueError(f"the command is neither `python -m` nor `python -c`: {command}")
    return PythonStart(
        arguments=tuple(map(os.fsencode, arguments)),
        folder=os.fsencode(folder),
        environment={os.fsencode(name): os.fsencode(value) for name, value in variables.items()},
        places=_places(),
        is_safe=is_safe,
    )


def _text(stream: IO[bytes]) -> str:
    stream.seek(0)
    return stream.read().decode().replace("\r\n", "\n").replace("\r", "\n")  # as `text=True` has it


@functools.cache
def _places() -> tuple[bytes, ...]:
    """Return the search path of an interpreter without variables."""
    code = "import sys; print(*sys.path, sep='\\0', end='')"
    return tuple(
        subprocess.run([sys.executable, "-I", "-c", code], capture_output=True, check=True).stdout.split(b"\0")
    )


@functools.cache
def _server(_process: int) -> ForkServer:
    """Return the process that forks. A copy of this process is another `_process` and needs its own."""
    with true_starts():
        server = ForkServer(_IMPORTED, variables=_VARIABLES)
    server.call("tools.python_forks:warm", "")
    return server


def warm(_argument: str) -> None:
    """In the process that forks: play a tick, so that no fork computes again what an episode needs once.

    An episode of one tick took 0.20 s of processor time in a new process, and 0.08 s after another one (measured).
    """
    with tempfile.TemporaryDirectory() as folder:
        run(shortened(mission_file("ssr"), 1), policy="idle", world="inline", overview=False, out=f"{folder}/run")
    benchmark_version(())  # each suite would compute both, in 1 s
    code_sha256(())
    Image.init()
    hold_entries()
    gc.collect()
    gc.freeze()
    gc.set_threshold(10_000, 10, 10)  # as in the tests' own process


def _fork(start: PythonStart, descriptors: Sequence[int], output: int = 2) -> ForkedProcess:
    """Fork a process for a start with these descriptors. `output` receives its messages before it has begun."""
    client = ForkServerClient(os.dup(_inherited[0])) if _inherited else _server(os.getpid()).client()
    try:
        return client.start_function(
            "tools.python_forks:become_python",
            (*descriptors, client.fileno()),
            output,
            argument=msgspec.msgpack.encode(start),
            here=False,
        )
    finally:
        client.close()


def become_python(argument: bytes, ends: tuple[int, ...]) -> None:
    """In a fork: be the interpreter of a start. `ends`: its descriptors, and the connection to the forking process."""
    *descriptors, server = ends
    _inherited.append(fcntl.fcntl(server, fcntl.F_DUPFD_CLOEXEC, ABOVE))
    os.close(server)
    for module in (fork_client, launch, branch_host):
        mock.patch.object(module, "start_to_last", _start_fork).start()
    run_start(from_msgpack(argument, PythonStart), descriptors)


def _start_fork(
    command: list[str], variables: dict[str, str], descriptors: tuple[int, ...], output: int | None
) -> PythonFork | subprocess.Popen[bytes]:
    """Start a worker as `fork_client.start_to_last` does, in a fork."""
    if command[:3] != [_PYTHON, "-P", "-m"] or command[3] not in WORKERS:
        return _start_to_last(command, variables, descriptors, output)
    start = msgspec.structs.replace(
        _start_of(command, str(Path.cwd()), variables), numbers=(0, 1, 2, *descriptors), is_worker=True
    )
    with open(os.devnull, "r+b", buffering=0) as empty:  # noqa: PTH123
        outputs = (empty.fileno(), empty.fileno()) if output is None else (output, output)
        return PythonFork(_fork(start, (empty.fileno(), *outputs, *descriptors), 2 if output is None else output))


__all__ = [
    "WORKERS", "PipedFork", "PythonFork", "become_python", "forked_starts", "run_python", "start_python",
    "true_starts",
]  # fmt: skip
