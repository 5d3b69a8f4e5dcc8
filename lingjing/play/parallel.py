"""Several episodes: one after another on a warm world here, or a few at a time in processes of their own."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import AbstractContextManager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, TYPE_CHECKING, Literal, NamedTuple

import msgspec

from lingjing.errors import ExitCode, InfrastructureError, LingjingError, UsageError
from lingjing.mission.model import Mission
from lingjing.play.folders import release_if_empty
from lingjing.play.report import ABORTED, EpisodeReport

if TYPE_CHECKING:
    from lingjing.kernel.episode import Progress
    from lingjing.play.episode import EpisodeResult, Session

    Watch = Callable[[str], AbstractContextManager[Callable[[Progress], None]]]

GRACE_S = 90.0
"""How long an interrupted episode may take to close its workers."""


@dataclass(frozen=True, slots=True)
class RunOptions:
    """How a mission is to be played, less the seeds and the folders: the options of `lingjing run`."""

    path: Path
    policy: str
    policies_for: Mapping[str, str] = field(default_factory=dict)
    policy_args: Mapping[str, str] = field(default_factory=dict)
    mode: str | None = None
    settings: Mapping[str, float] = field(default_factory=dict)
    world: Literal["process", "inline"] = "process"
    policy_seed: int = 0
    blank_pictures: bool = False
    overview: bool = True

    def command(self, seed: int, folder: Path) -> list[str]:
        """The command line that plays this one episode and prints its JSON object."""
        line = [sys.executable, "-m", "lingjing.cli.main", "run", str(self.path), "--json"]
        line += ["--seed", str(seed), "-o", str(folder), "--policy", self.policy, "--world", self.world]
        line += ["--policy-seed", str(self.policy_seed)]
        line += ["--end-with", str(os.getpid())]
        line += ["--mode", self.mode] if self.mode else []
        line += ["--blank-pictures"] if self.blank_pictures else []
        line += [] if self.overview else ["--no-overview"]
        for option, pairs in (
            ("--set", self.settings),
            ("--policy-for", self.policies_for),
            ("--policy-arg", self.policy_args),
        ):
            line += [part for name, value in pairs.items() for part in (option, f"{name}={value}")]
        return line


def play_here(
    mission: Mission, options: RunOptions, places: Iterable[tuple[int, Path | None]], watch: Watch
) -> Iterator[EpisodeReport]:
    """Play (seed, folder) pairs in order on the same warm workers; an interrupted episode is the last one.

    A folder of None is a new one under `runs/`. `watch` opens a progress display for each episode.
    """
    from lingjing.play.episode import EpisodeInterrupted, Session

    with Session(options.world) as session:
        for seed, folder in places:
            try:
                yield _report(options, _play(session, mission, options, seed, folder, watch))
            except EpisodeInterrupted as interrupt:
                yield _report(options, interrupt.result)
                return


def _play(
    session: Session, mission: Mission, options: RunOptions, seed: int, folder: Path | None, watch: Watch
) -> EpisodeResult:
    try:
        with watch(f"{mission.name} seed {seed}") as progress:
            return session.run(
                mission,
                policy=options.policy,
                policies_for=options.policies_for,
                policy_args=options.policy_args,
                seed=seed,
                mode=options.mode,
                settings=options.settings,
                out=folder,
                policy_seed=options.policy_seed,
                blank_pictures=options.blank_pictures,
                overview=options.overview,
                progress=progress,
            )
    finally:
        if folder is not None:
            release_if_empty(folder)


def _report(options: RunOptions, result: EpisodeResult) -> EpisodeReport:
    return EpisodeReport(
        mission=result.mission,
        seed=result.seed,
        mode=result.mode,
        policy=options.policy,
        success=result.success,
        reason=result.reason,
        scr=result.scr,
        ticks=result.ticks,
        digest=result.digest,
        trace=str(result.trace),
        metrics=msgspec.to_builtins(result.metrics),
        incidents=result.incidents,
        happened=result.happened,
        detail=result.detail,
        hint=result.hint,
        warnings=result.warnings,
        attribution=result.attribution,
        policy_seed=result.policy_seed,
        score=result.score,
    )


class Task(NamedTuple):
    """An episode to be played in a process of its own."""

    options: RunOptions
    seed: int
    folder: Path


@dataclass(frozen=True, slots=True)
class _Child:
    task: Task
    process: subprocess.Popen[bytes]
    output: IO[bytes]
    errors: IO[bytes]


def play_apart(tasks: Iterable[Task], jobs: int) -> Iterator[tuple[Task, EpisodeReport]]:
    """Play in child processes, `jobs` at a time, in order of completion.

    A child that fails before it has a result raises with its own message and exit code; the others are ended. One that
    was killed (from outside, or for want of memory) is an infrastructure abort of its episode.
    At an interrupt the children end as an interrupted command does and what they had is yielded before it is raised.
    """
    waiting = iter(tasks)
    running: list[_Child] = []
    try:
        while True:
            while len(running) < jobs and (task := next(waiting, None)) is not None:
                running.append(_start(task))
            if not running:
                return
            done = [child for child in running if child.process.poll() is not None]
            running = [child for child in running if child not in done]
            for child in done:
                yield child.task, _finish(child)
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


def _start(task: Task) -> _Child:
    command = task.options.command(task.seed, task.folder)
    output, errors = tempfile.TemporaryFile(), tempfile.TemporaryFile()  # noqa: SIM115 - the child outlives this call
    # A process group of its own: a terminal's Ctrl-C reaches the caller alone, who then ends each child once.
    process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=output, stderr=errors, process_group=0)
    return _Child(task, process, output, errors)


def _finish(child: _Child) -> EpisodeReport:
    child.output.seek(0)
    child.errors.seek(0)
    printed, complaint = child.output.read(), child.errors.read().decode(errors="replace").strip()
    with suppress(msgspec.DecodeError):  # nothing, or half of it
        return msgspec.json.decode(printed, type=EpisodeReport)
    release_if_empty(child.task.folder)
    code = child.process.returncode
    if code == ExitCode.INTERRUPTED:
        raise KeyboardInterrupt
    if code < 0:
        return without_result(child.task, f"its process was killed by signal {-code}")
    if code == ExitCode.OK:
        return without_result(child.task, "its process ended without a result (exit code 0)")
    kinds: dict[int, type[LingjingError]] = {ExitCode.USAGE: UsageError, ExitCode.INFRASTRUCTURE: InfrastructureError}
    raise kinds.get(code, LingjingError)(complaint.removeprefix("error: ") or f"an episode ended with code {code}")


def without_result(task: Task, why: str) -> EpisodeReport:
    """What can be said of an episode whose process is gone: nothing was scored."""
    trace = next(task.folder.glob("*.part"), task.folder)
    return EpisodeReport(
        mission=task.options.path.stem, seed=task.seed, mode=task.options.mode or "", policy=task.options.policy,
        success=False, reason=ABORTED, scr=0.0, ticks=0, digest="", trace=str(trace), metrics={}, detail=why,
        policy_seed=task.options.policy_seed,
    )  # fmt: skip


def _end(children: list[_Child]) -> None:
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
