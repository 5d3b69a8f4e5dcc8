"""Several episodes: one after another in this process, or several at a time in processes of their own."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import AbstractContextManager, suppress
from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from typing import IO, TYPE_CHECKING, NamedTuple, Self

import msgspec

from lingjing.decoding import from_json
from lingjing.errors import (
    AbortCause,
    ExitCode,
    ForeignCodeError,
    InfrastructureError,
    LingjingError,
    UsageError,
    error_of,
    hint_of,
)
from lingjing.kernel.world.launch import ENGINE_VARIABLES, ENGINES
from lingjing.mission.model import Mission
from lingjing.play.folders import release_if_empty
from lingjing.play.options import PlayOptions, compiled
from lingjing.play.policy_processes.preloading import PRELOAD, SERVES
from lingjing.play.policy_processes.servers import (
    NO_WALLS,
    WALLS_FROM,
    OpenServer,
    PolicyServer,
    WalledServer,
    walls_of,
)
from lingjing.play.report import (
    ABORTED,
    INTERRUPTED,
    POLICY_FAILED,
    SERVER_KILLED,
    SIGNALLED,
    EpisodeError,
    EpisodeReport,
    end_without_result,
)
from lingjing.processes.descendants import adopting, continue_stopped
from lingjing.processes.fork_client import ForkedProcess, ForkServer, ForkServerClient
from lingjing.processes.walls.offer import check_strict, offered_walls

if TYPE_CHECKING:
    from lingjing.kernel.episode import Progress

    Watch = Callable[[str], AbstractContextManager[Callable[[Progress], None]]]

CONTINUED_S = 1.0
"""Seconds between two looks for stopped processes. Chosen: shorter than any time limit of engines."""

GRACE_S = 300.0
"""The longest time that an interrupted episode has to close its workers, seconds of wall clock. Chosen."""


def play_here(
    options: PlayOptions,
    places: Iterable[tuple[int, Path | None]],
    watch: Watch,
    mission: Mission | None = None,
    fork_server: ForkServerClient | None = None,
    policy_server: PolicyServer | None = None,
) -> Iterator[EpisodeReport]:
    """Play (seed, folder) pairs in order with the same workers, and yield their reports.

    A folder of None is a new one under `runs/`. `watch` opens a progress display for each episode. `fork_server` starts
    the workers (`lingjing.processes.fork_client`), `policy_server` the processes of policies; without it policies run
    here. An interrupted episode is the last one. A policy that fails before its episode begins loses it.
    """
    from lingjing.play.episode import EpisodeInterrupted, Session

    mission = mission or compiled(options)
    with Session(fork_server=fork_server, policy_server=policy_server) as session:
        for seed, folder in places:
            try:
                with watch(f"{mission.name} seed {seed}") as progress:
                    report = session.play(
                        msgspec.structs.replace(options, seed=seed), mission, out=folder, progress=progress
                    )
            except EpisodeInterrupted as interrupt:
                yield interrupt.report
                return
            except InfrastructureError as error:
                session.close()
                report = _unrecorded(options, mission, seed, folder, error)
            except ForeignCodeError as error:
                report = msgspec.structs.replace(
                    _unrecorded(options, mission, seed, folder, error),
                    reason=POLICY_FAILED,
                    family="unattributed",
                    trace="",
                )
            finally:
                if folder is not None:
                    release_if_empty(folder)
            yield report


def _unrecorded(
    options: PlayOptions, mission: Mission, seed: int, folder: Path | None, error: LingjingError
) -> EpisodeReport:
    """Return the report of an episode without a record."""
    task = EpisodeTask(msgspec.structs.replace(options, seed=seed), folder or Path())
    mode = options.mode or mission.modes.default
    report = without_result(task, str(error), error.cause if isinstance(error, InfrastructureError) else "")
    return msgspec.structs.replace(report, mission=mission.name, mode=mode, hint=hint_of(error))


class EpisodeServers(NamedTuple):
    """The servers from which an episode starts its processes."""

    workers: ForkServerClient | None
    """Forks the processes of engines; None to start them anew."""
    policies: PolicyServer | None
    """Forks the processes of policies; None where policies run in the caller's process."""


@contextlib.contextmanager
def episode_servers(
    options: PlayOptions, descriptor: int | None = None, walled_descriptor: int | None = None
) -> Iterator[EpisodeServers]:
    """Yield the servers for episodes with these options.

    `descriptor` leads to an existing server, `walled_descriptor` to one with walls; None starts a new one. Policies run
    in the caller's process with inline engines, and on systems other than Linux. Raises `UsageError` for walls there.
    """
    if options.world == "inline" or sys.platform != "linux":
        if options.isolate != "no":
            raise UsageError(NO_WALLS, hint=WALLS_FROM)
        yield EpisodeServers(None, None)
        return
    with contextlib.ExitStack() as stack:
        workers = None
        if descriptor is not None:
            workers = stack.enter_context(contextlib.closing(ForkServerClient(descriptor)))
        if options.isolate != "no":
            walls = walls_of(options)
            client = _client(stack, options, walled_descriptor, walls=True)
            if options.isolate == "strict" and walled_descriptor is None:
                check_strict(offered_walls(client))
            opened = cache(lambda: workers or _client(stack, options, None, walls=False))
            yield EpisodeServers(workers, WalledServer(client, walls, workers, opened))
        else:
            yield EpisodeServers(workers, OpenServer(workers or _client(stack, options, None, walls=False)))


def _client(
    stack: contextlib.ExitStack, options: PlayOptions, descriptor: int | None, *, walls: bool
) -> ForkServerClient:
    """Return a connection to the server of this descriptor, or to a new one."""
    if descriptor is not None:
        return stack.enter_context(contextlib.closing(ForkServerClient(descriptor)))
    stack.enter_context(adopting())
    server = stack.enter_context(ForkServer(SERVES, walls=walls))
    server.call(PRELOAD, _policy_names(options))
    return stack.enter_context(contextlib.closing(server.client()))


def _policy_names(options: PlayOptions) -> str:
    """Return the names of the policies as a JSON list."""
    return msgspec.json.encode([*dict.fromkeys((options.policy, *options.policies_for.values()))]).decode()


_CLI = "lingjing.cli.main"
_PYTHON = [sys.executable, "-m", _CLI]

PLAYED_WITH = (
    "lingjing.cli.parser", "lingjing.cli.run", "lingjing.cli.progress", "lingjing.cli.files",
    "lingjing.processes.signals",
    "lingjing.kernel.world.process", "lingjing.kernel.evaluation", "lingjing.play.episode", "lingjing.play.sharing",
    "lingjing.play.policy_processes.loading", "lingjing.play.policy_processes.examination",
    "lingjing.dsl.compilation", "lingjing.scene.bay", "lingjing.scene.districts", "lingjing.builtin",
)  # fmt: skip
"""Modules that the process of an episode imports. No module of a policy or an engine is among them."""

ENGINE_MODULES = (
    "lingjing.kernel.world.worker", "lingjing.engines.camera.engine",
    "lingjing.engines.city.engine", "lingjing.engines.fixed_wing.aeroplane", "lingjing.engines.multirotor.drone",
    "lingjing.engines.satellite.engine", "lingjing.engines.vessel.engine",
)  # fmt: skip
"""Modules that the processes of engines import."""

SHARE = "lingjing.play.sharing:share"
"""The function that prepares the process from which episodes are forked, once for each kind of episode."""

WITH_EXTRAS = (("libsumo", "lingjing.engines.road.engine"), ("mujoco", "lingjing.engines.quadruped.engine"))
"""Modules of further engines, each with the package that must be installed for it."""


class EpisodeTask(NamedTuple):
    """An episode to play in a process of its own."""

    options: PlayOptions
    folder: Path
    """The folder of the run."""
    repeated: bool = True
    """True if other episodes may begin with the same instance."""
    reports_failure: bool = False
    """True if a policy that fails before the episode begins gives a lost episode. Otherwise its error is raised for
    all."""

    def command(self) -> list[str]:
        """Return the command that plays it. It reads the options from standard input and prints the report as JSON."""
        return [*_PYTHON, "run", "--options", "-", "--json-error", "-o", str(self.folder), "--json"]


_MUTE_HINT = "check for free space in the folder of temporary files (TMPDIR), which holds its messages"
"""The hint for a child that failed without a message."""


@dataclass(frozen=True, slots=True)
class _Worker:
    """A running episode. `output` and `errors` are the files of its standard streams."""

    task: EpisodeTask
    process: subprocess.Popen[bytes] | ForkedProcess
    output: IO[bytes]
    errors: IO[bytes]


class EpisodeProcesses:
    """Starts the processes of episodes; a context manager. Several calls of `play` share it.

    They are forks of a process that has imported their modules; it starts with the first episode. A foreign command,
    and every episode on a system without the fork server, is a process of its own.
    """

    def __init__(self) -> None:
        self._server: ForkServer | None = None
        self._walled: ForkServer | None = None
        self._shared: set[bytes] = set()
        self._preloaded: set[str] = set()
        self._walled_preloaded: set[str] = set()
        self._is_strict = False

    def play(self, tasks: Iterable[EpisodeTask], jobs: int) -> Generator[tuple[EpisodeTask, EpisodeReport]]:
        """Play in child processes, `jobs` at a time, and yield reports in order of completion; see `play_apart`."""
        return _play_all(self, iter(tasks), jobs)

    def start(self, task: EpisodeTask) -> _Worker:
        """Start the process of an episode.

        It has a process group of its own: Ctrl-C in a terminal reaches the caller alone, which then ends each child
        once.
        """
        output, errors = tempfile.TemporaryFile(), tempfile.TemporaryFile()  # noqa: SIM115 - the child outlives this
        command = task.command()
        with tempfile.TemporaryFile() as options:
            options.write(msgspec.json.encode(task.options))
            options.seek(0)
            if command[: len(_PYTHON)] == _PYTHON and sys.platform == "linux":
                streams = options.fileno(), output.fileno(), errors.fileno()
                return _Worker(task, self._forked(task, command[len(_PYTHON) :], streams), output, errors)
            ending = ["--end-with", str(os.getpid())]
            process = subprocess.Popen(
                [*command, *ending], stdin=options, stdout=output, stderr=errors, process_group=0
            )
        return _Worker(task, process, output, errors)

    def close(self) -> None:
        """End the process from which episodes are forked."""
        for server in (self._server, self._walled):
            if server is not None:
                server.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _forked(self, task: EpisodeTask, arguments: list[str], streams: tuple[int, int, int]) -> ForkedProcess:
        if self._server is not None:
            try:
                return self._run_in(self._server, task, arguments, streams)
            except InfrastructureError:  # the server was killed: start another one
                self._server.close()
                self._shared.clear()
                self._preloaded.clear()
        engines = [*ENGINE_MODULES, *(module for package, module in WITH_EXTRAS if find_spec(package))]
        self._server = ForkServer([*PLAYED_WITH, *SERVES], {ENGINES: engines}, ENGINE_VARIABLES)
        return self._run_in(self._server, task, arguments, streams)

    def _run_in(
        self, server: ForkServer, task: EpisodeTask, arguments: list[str], streams: tuple[int, int, int]
    ) -> ForkedProcess:
        """Prepare the server for this kind of episode, once, and start the episode."""
        start = msgspec.json.encode({"options": _instance_options(task.options), "repeated": task.repeated})
        if start not in self._shared:
            self._shared.add(start)
            server.call(SHARE, start.decode(), in_layers=True)
        if (names := _policy_names(task.options)) not in self._preloaded:
            self._preloaded.add(names)
            server.call(PRELOAD, names)
        further = {}
        if task.options.isolate != "no":
            walled = self._walled_server(names)
            further = {"--walled-server": walled.descriptor}
            if task.options.isolate == "strict" and not self._is_strict:
                with contextlib.closing(walled.client()) as client:
                    check_strict(offered_walls(client))
                self._is_strict = True
        return server.run_module(_CLI, arguments, streams, further)

    def _walled_server(self, names: str) -> ForkServer:
        """Return the server of the policies behind walls, a new one if it has ended. `names`: the policies."""
        if self._walled is None or self._walled.has_ended:
            self._walled = ForkServer(SERVES, walls=True)
            self._walled_preloaded.clear()
        if names not in self._walled_preloaded:
            self._walled_preloaded.add(names)
            self._walled.call(PRELOAD, names)
        return self._walled


def _instance_options(options: PlayOptions) -> PlayOptions:
    """Return the options that decide the instance, without those of policies."""
    return PlayOptions(
        mission=options.mission,
        seed=options.seed,
        salt=options.salt,
        mode=options.mode,
        tier=options.tier,
        language=options.language,
        settings=options.settings,
        engine_args=options.engine_args,
    )


def play_apart(tasks: Iterable[EpisodeTask], jobs: int) -> Iterator[tuple[EpisodeTask, EpisodeReport]]:
    """Play in child processes, `jobs` at a time, and yield reports in order of completion.

    A child that fails without a result raises its own error, and the others are ended. A policy that fails before the
    episode begins raises too, unless its task reports it. A child that was killed, or interrupted by another process,
    is an infrastructure abort of its episode. At an interrupt the children end as interrupted commands do, and their
    reports are yielded before `KeyboardInterrupt` is raised.
    """
    with EpisodeProcesses() as processes:
        yield from processes.play(tasks, jobs)


def _play_all(
    processes: EpisodeProcesses, waiting: Iterator[EpisodeTask], jobs: int
) -> Generator[tuple[EpisodeTask, EpisodeReport]]:
    """Start a task whenever fewer than `jobs` children run, and yield the report of each child that has ended.

    A policy could stop a process of its episode, or the one that starts all others, and the suite would wait forever.
    So stopped processes are continued.
    """
    running: list[_Worker] = []
    continued_s = time.monotonic()
    try:
        while True:
            while len(running) < jobs and (task := next(waiting, None)) is not None:
                running.append(processes.start(task))
            if not running:
                return
            done = [child for child in running if child.process.poll() is not None]
            running = [child for child in running if child not in done]
            for child in done:
                yield child.task, _report_of_ended(child)
            if time.monotonic() - continued_s > CONTINUED_S:
                continue_stopped()
                continued_s = time.monotonic()
            if not done:
                time.sleep(0.05)
    except KeyboardInterrupt:
        stopped, running = running, []
        _end(stopped)
        for child in stopped:
            with suppress(KeyboardInterrupt, LingjingError):  # it had no result yet
                yield child.task, _result_of(child)
        raise
    finally:
        _end(running)


class _ChildInterrupted(KeyboardInterrupt):
    """A child was interrupted before it had a result."""


def _report_of_ended(child: _Worker) -> EpisodeReport:
    """Return the report of a child that ended by itself.

    An interrupted one is an abort, because a policy's process may have sent the signal.
    """
    try:
        report = _result_of(child)
    except _ChildInterrupted:
        return without_result(child.task, SIGNALLED, "episode-process")
    if report.reason != INTERRUPTED:
        return report
    return msgspec.structs.replace(report, reason=ABORTED, detail=SIGNALLED, cause="episode-process")


def _result_of(child: _Worker) -> EpisodeReport:
    """Return the report that a child has printed, or that of an episode without a result.

    Raises the child's own error, by its exit code and its message, and `_ChildInterrupted` for an interrupted child.
    """
    child.output.seek(0)
    child.errors.seek(0)
    printed, complaint = child.output.read(), child.errors.read().decode(errors="replace").strip()
    if isinstance(child.process, ForkedProcess):
        child.process.close()
    if child.process.returncode == ForkedProcess.LOST:
        return without_result(child.task, SERVER_KILLED, "episode-server")
    with suppress(msgspec.DecodeError):  # nothing, or half of it
        report = from_json(printed, EpisodeReport)
        if report.reason == POLICY_FAILED and not child.task.reports_failure:
            raise ForeignCodeError(report.detail, hint=report.hint)
        return report
    release_if_empty(child.task.folder)
    code = child.process.wait()
    if code == ExitCode.INTERRUPTED:
        raise _ChildInterrupted
    if code <= ExitCode.OK:
        return without_result(child.task, end_without_result(code), "episode-process")
    raise _error_of_ended(code, printed, complaint)


def _error_of_ended(code: int, printed: bytes, complaint: str) -> LingjingError:
    """Return the error that a child has printed. A bug, or a foreign command, has only its words on standard error."""
    with suppress(msgspec.DecodeError):
        error = from_json(printed, EpisodeError)
        return error_of(code, error.message, error.hint, error.cause)
    if complaint:
        return error_of(code, complaint.removeprefix("error: "))
    return error_of(code, f"an episode ended with code {code} and without a message", _MUTE_HINT)


def without_result(task: EpisodeTask, why: str, cause: AbortCause) -> EpisodeReport:
    """Return the report of an episode without a result from its process: an abort without a score."""
    trace = next(task.folder.glob("*.part"), task.folder)
    options = task.options
    return EpisodeReport(
        mission=Path(options.mission).stem, seed=options.seed, mode=options.mode or "", policy=options.policy,
        success=False, reason=ABORTED, scr=0.0, ticks=0, digest="", trace=str(trace), metrics=None, detail=why,
        cause=cause, policy_seed=options.policy_seed,
    )  # fmt: skip


def _end(children: list[_Worker]) -> None:
    """Terminate every child as Ctrl-C does, and kill those that do not end within `GRACE_S`."""
    for child in children:
        with suppress(ProcessLookupError):
            child.process.terminate()
    deadline = time.monotonic() + GRACE_S
    for child in children:
        try:
            child.process.wait(max(0.1, deadline - time.monotonic()))
        except subprocess.TimeoutExpired:
            child.process.kill()
            child.process.wait()
        release_if_empty(child.task.folder)
