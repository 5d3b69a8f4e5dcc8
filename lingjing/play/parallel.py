"""Several episodes: one after another on a warm world here, or a few at a time in processes of their own."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, suppress
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import IO, TYPE_CHECKING, NamedTuple

import msgspec

from lingjing.errors import ExitCode, ForeignCodeError, InfrastructureError, LingjingError, error_of
from lingjing.kernel.world.launch import ENGINE_VARIABLES, ENGINES
from lingjing.mission.model import Mission
from lingjing.play.folders import release_if_empty
from lingjing.play.options import PlayOptions, compiled
from lingjing.play.policy_processes.preloading import PRELOAD, SERVES
from lingjing.play.report import (
    ABORTED,
    INTERRUPTED,
    POLICY_FAILED,
    SERVER_KILLED,
    SIGNALLED,
    EpisodeReport,
    end_without_result,
)
from lingjing.processes.descendants import adopting
from lingjing.processes.fork_client import ForkedProcess, ForkServer, ForkServerClient

if TYPE_CHECKING:
    from lingjing.kernel.episode import Progress

    Watch = Callable[[str], AbstractContextManager[Callable[[Progress], None]]]

GRACE_S = 300.0
"""How long an interrupted episode may take to close its workers."""


def play_here(
    options: PlayOptions,
    places: Iterable[tuple[int, Path | None]],
    watch: Watch,
    mission: Mission | None = None,
    fork_server: ForkServerClient | None = None,
    policy_server: ForkServerClient | None = None,
) -> Iterator[EpisodeReport]:
    """Play (seed, folder) pairs in order on the same warm workers; an interrupted episode is the last one. One that a
    policy's code keeps from beginning is reported as lost.

    A folder of None is a new one under `runs/`. `watch` opens a progress display for each episode. The workers are
    started by the fork server, if there is one (`lingjing.processes.fork_client`), the processes of policies by the
    policy server; without one policies play here.
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
    """The report of an episode of which nothing was recorded."""
    task = EpisodeTask(msgspec.structs.replace(options, seed=seed), folder or Path())
    mode = options.mode or mission.modes.default
    report = without_result(task, str(error))
    return msgspec.structs.replace(report, mission=mission.name, mode=mode, hint=error.hint)


@contextlib.contextmanager
def policy_server(options: PlayOptions, given: int | None = None) -> Iterator[ForkServerClient | None]:
    """The process that the policies of these options are forked from: that behind a descriptor that was `given`, or a
    new one. None where policies play in the caller's process: with the engines, and elsewhere than on Linux."""
    if options.world == "inline" or sys.platform != "linux":
        yield None
    elif given is not None:
        with contextlib.closing(ForkServerClient(given)) as client:
            yield client
    else:
        with adopting(), ForkServer(SERVES) as server, contextlib.closing(server.client()) as client:
            server.call(PRELOAD, _policy_names(options))
            yield client


def _policy_names(options: PlayOptions) -> str:
    """The names of the policies as JSON."""
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
"""What the process of an episode imports, and nothing of policies or engines."""

ENGINE_MODULES = (
    "lingjing.kernel.world.worker", "lingjing.engines.camera.engine",
    "lingjing.engines.city.engine", "lingjing.engines.fixed_wing.aeroplane", "lingjing.engines.multirotor.drone",
    "lingjing.engines.satellite.engine", "lingjing.engines.vessel.engine",
)  # fmt: skip
"""What the processes of engines import."""

SHARE = "lingjing.play.sharing:share"
"""What the process that episodes are forked from is asked to do first for each kind of them."""

WITH_EXTRAS = (("libsumo", "lingjing.engines.road.engine"), ("mujoco", "lingjing.engines.quadruped.engine"))
"""Further engines, each with the package that has to be installed for it."""


class EpisodeTask(NamedTuple):
    """An episode to be played in a process of its own. `repeated` if others may begin with the same instance;
    `reports_failure` if a policy that keeps it from beginning is reported as its loss, and not raised for all."""

    options: PlayOptions
    folder: Path
    repeated: bool = True
    reports_failure: bool = False

    def command(self) -> list[str]:
        """The command line that plays it with the options on its standard input, and prints its report as JSON."""
        return [*_PYTHON, "run", "--options", "-", "-o", str(self.folder), "--json"]


_MUTE_HINT = "see if there is room in the folder of temporary files (TMPDIR), where its messages go"


@dataclass(frozen=True, slots=True)
class _Worker:
    task: EpisodeTask
    process: subprocess.Popen[bytes] | ForkedProcess
    output: IO[bytes]
    errors: IO[bytes]


class _Starter:
    """Starts episodes: as forks of a process that has imported what they need, which is begun with the first of them;
    a command that is not ours, or where nothing can be forked, as a process of its own."""

    def __init__(self) -> None:
        self._server: ForkServer | None = None
        self._shared: set[bytes] = set()
        self._preloaded: set[str] = set()

    def start(self, task: EpisodeTask) -> _Worker:
        """The process of an episode. A process group of its own: a terminal's Ctrl-C reaches the caller alone, who then
        ends each child once."""
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
        """End the process that episodes are forked from."""
        if self._server is not None:
            self._server.close()

    def _forked(self, task: EpisodeTask, arguments: list[str], streams: tuple[int, int, int]) -> ForkedProcess:
        if self._server is not None:
            try:
                return self._asked(self._server, task, arguments, streams)
            except InfrastructureError:  # it was killed: another one takes its place
                self._server.close()
                self._shared.clear()
                self._preloaded.clear()
        engines = [*ENGINE_MODULES, *(module for package, module in WITH_EXTRAS if find_spec(package))]
        self._server = ForkServer([*PLAYED_WITH, *SERVES], {ENGINES: engines}, ENGINE_VARIABLES)
        return self._asked(self._server, task, arguments, streams)

    def _asked(
        self, server: ForkServer, task: EpisodeTask, arguments: list[str], streams: tuple[int, int, int]
    ) -> ForkedProcess:
        start = msgspec.json.encode({"options": _played_on(task.options), "repeated": task.repeated})
        if start not in self._shared:
            self._shared.add(start)
            server.call(SHARE, start.decode(), in_layers=True)
        if (names := _policy_names(task.options)) not in self._preloaded:
            self._preloaded.add(names)
            server.call(PRELOAD, names)
        return server.run_module(_CLI, arguments, streams)


def _played_on(options: PlayOptions) -> PlayOptions:
    """The options that decide the instance, without those of whoever plays it."""
    return PlayOptions(
        mission=options.mission,
        seed=options.seed,
        mode=options.mode,
        settings=options.settings,
        engine_args=options.engine_args,
    )


def play_apart(tasks: Iterable[EpisodeTask], jobs: int) -> Iterator[tuple[EpisodeTask, EpisodeReport]]:
    """Play in child processes, `jobs` at a time, in order of completion.

    A child that fails before it has a result raises with its own message and exit code; the others are ended. So does
    one that a policy keeps from beginning, unless its task reports that. One that was killed (from outside, or for
    want of memory), or interrupted by another process, is an infrastructure abort of its episode.
    At an interrupt the children end as an interrupted command does and what they had is yielded before it is raised.
    """
    starter = _Starter()
    with contextlib.closing(starter):
        yield from _played_by(starter, iter(tasks), jobs)


def _played_by(
    starter: _Starter, waiting: Iterator[EpisodeTask], jobs: int
) -> Iterator[tuple[EpisodeTask, EpisodeReport]]:
    running: list[_Worker] = []
    try:
        while True:
            while len(running) < jobs and (task := next(waiting, None)) is not None:
                running.append(starter.start(task))
            if not running:
                return
            done = [child for child in running if child.process.poll() is not None]
            running = [child for child in running if child not in done]
            for child in done:
                yield child.task, _finish_unasked(child)
            if not done:
                time.sleep(0.05)
    except KeyboardInterrupt:
        stopped, running = running, []
        _end(stopped)
        for child in stopped:
            with suppress(KeyboardInterrupt, LingjingError):  # it had no result yet
                yield child.task, _finish(child)
        raise
    finally:
        _end(running)


class _ChildInterrupted(KeyboardInterrupt):
    """A child was interrupted before it had a result."""


def _finish_unasked(child: _Worker) -> EpisodeReport:
    """The report of a child that was not asked to end. One that was interrupted all the same is an abort: a policy's
    process may have sent the signal."""
    try:
        report = _finish(child)
    except _ChildInterrupted:
        return without_result(child.task, SIGNALLED)
    return msgspec.structs.replace(report, reason=ABORTED, detail=SIGNALLED) if report.reason == INTERRUPTED else report


def _finish(child: _Worker) -> EpisodeReport:
    child.output.seek(0)
    child.errors.seek(0)
    printed, complaint = child.output.read(), child.errors.read().decode(errors="replace").strip()
    if isinstance(child.process, ForkedProcess):
        child.process.close()
    if child.process.returncode == ForkedProcess.LOST:
        return without_result(child.task, SERVER_KILLED)
    with suppress(msgspec.DecodeError):  # nothing, or half of it
        report = msgspec.json.decode(printed, type=EpisodeReport)
        if report.reason == POLICY_FAILED and not child.task.reports_failure:
            raise ForeignCodeError(report.detail, hint=report.hint)
        return report
    release_if_empty(child.task.folder)
    code = child.process.wait()
    if code == ExitCode.INTERRUPTED:
        raise _ChildInterrupted
    if code <= ExitCode.OK:
        return without_result(child.task, end_without_result(code))
    said, _, hint = complaint.partition("\nhint: ")
    if not said:
        said, hint = f"an episode ended with code {code} and could not say why", _MUTE_HINT
    raise error_of(code, said.removeprefix("error: "), hint)


def without_result(task: EpisodeTask, why: str) -> EpisodeReport:
    """What can be said of an episode whose process is gone: nothing was scored."""
    trace = next(task.folder.glob("*.part"), task.folder)
    options = task.options
    return EpisodeReport(
        mission=Path(options.mission).stem, seed=options.seed, mode=options.mode or "", policy=options.policy,
        success=False, reason=ABORTED, scr=0.0, ticks=0, digest="", trace=str(trace), metrics=None, detail=why,
        policy_seed=options.policy_seed,
    )  # fmt: skip


def _end(children: list[_Worker]) -> None:
    """Ask every child to stop as Ctrl-C would, then make sure."""
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
