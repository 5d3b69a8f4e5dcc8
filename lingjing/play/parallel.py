"""Several episodes: one after another on a warm world here, or a few at a time in processes of their own."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO, TYPE_CHECKING, NamedTuple

import msgspec

from lingjing.errors import ExitCode, InfrastructureError, LingjingError, UsageError
from lingjing.mission.model import Mission
from lingjing.play.folders import release_if_empty
from lingjing.play.options import PlayOptions, compiled
from lingjing.play.report import ABORTED, EpisodeReport

if TYPE_CHECKING:
    from lingjing.kernel.episode import Progress

    Watch = Callable[[str], AbstractContextManager[Callable[[Progress], None]]]

GRACE_S = 90.0
"""How long an interrupted episode may take to close its workers."""


def play_here(
    options: PlayOptions, places: Iterable[tuple[int, Path | None]], watch: Watch, mission: Mission | None = None
) -> Iterator[EpisodeReport]:
    """Play (seed, folder) pairs in order on the same warm workers; an interrupted episode is the last one.

    A folder of None is a new one under `runs/`. `watch` opens a progress display for each episode.
    """
    from lingjing.play.episode import EpisodeInterrupted, Session

    mission = mission or compiled(options)
    with Session() as session:
        for seed, folder in places:
            try:
                with watch(f"{mission.name} seed {seed}") as progress:
                    report = session.play(
                        msgspec.structs.replace(options, seed=seed), mission, out=folder, progress=progress
                    )
            except EpisodeInterrupted as interrupt:
                yield interrupt.report
                return
            finally:
                if folder is not None:
                    release_if_empty(folder)
            yield report


class EpisodeTask(NamedTuple):
    """An episode to be played in a process of its own."""

    options: PlayOptions
    folder: Path

    def command(self) -> list[str]:
        """The command line that plays it with the options on its standard input, and prints its report as JSON."""
        run = [sys.executable, "-m", "lingjing.cli.main", "run", "--options", "-", "-o", str(self.folder)]
        return [*run, "--json", "--end-with", str(os.getpid())]


@dataclass(frozen=True, slots=True)
class _Worker:
    task: EpisodeTask
    process: subprocess.Popen[bytes]
    output: IO[bytes]
    errors: IO[bytes]


def play_apart(tasks: Iterable[EpisodeTask], jobs: int) -> Iterator[tuple[EpisodeTask, EpisodeReport]]:
    """Play in child processes, `jobs` at a time, in order of completion.

    A child that fails before it has a result raises with its own message and exit code; the others are ended. One that
    was killed (from outside, or for want of memory) is an infrastructure abort of its episode.
    At an interrupt the children end as an interrupted command does and what they had is yielded before it is raised.
    """
    waiting = iter(tasks)
    running: list[_Worker] = []
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


def _start(task: EpisodeTask) -> _Worker:
    output, errors = tempfile.TemporaryFile(), tempfile.TemporaryFile()  # noqa: SIM115 - the child outlives this call
    with tempfile.TemporaryFile() as options:
        options.write(msgspec.json.encode(task.options))
        options.seek(0)
        # A process group of its own: a terminal's Ctrl-C reaches the caller alone, who then ends each child once.
        process = subprocess.Popen(task.command(), stdin=options, stdout=output, stderr=errors, process_group=0)
    return _Worker(task, process, output, errors)


def _finish(child: _Worker) -> EpisodeReport:
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
