"""Who plays a suite's episodes: processes of this machine, or the workers of a Ray cluster."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Protocol

from lingjing.play.parallel import EpisodeTask, play_apart
from lingjing.play.report import EpisodeReport


class Executor(Protocol):
    """Plays episodes; what comes of one does not depend on who plays it."""

    @property
    def jobs(self) -> int:
        """How many are played at a time."""

    def play(self, tasks: Iterable[EpisodeTask]) -> Iterator[tuple[EpisodeTask, EpisodeReport]]:
        """Play them, in order of completion. A task is taken when somebody is free to play it.

        An episode whose process or machine was lost is an infrastructure abort of that episode; anything that makes all
        others fail as well is raised. At an interrupt what was played is yielded before `KeyboardInterrupt` is raised.
        """


@dataclass(frozen=True, slots=True)
class LocalExecutor:
    """Child processes of this one."""

    jobs: int = 1

    def play(self, tasks: Iterable[EpisodeTask]) -> Iterator[tuple[EpisodeTask, EpisodeReport]]:
        """Play the tasks, `jobs` at a time."""
        return play_apart(tasks, self.jobs)


__all__ = ["Executor", "LocalExecutor"]
