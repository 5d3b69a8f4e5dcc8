"""Executors of a suite's episodes: processes of this machine, or the workers of a Ray cluster (`on_ray`)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Protocol

from lingjing.play.parallel import EpisodeTask, play_apart
from lingjing.play.report import EpisodeReport


class Executor(Protocol):
    """An executor of episodes. Results do not depend on the executor."""

    @property
    def jobs(self) -> int:
        """The number of episodes played in parallel."""

    def play(self, tasks: Iterable[EpisodeTask]) -> Iterator[tuple[EpisodeTask, EpisodeReport]]:
        """Play the tasks and yield them in order of completion. The next task is taken when a worker is free.

        A lost process or machine is an infrastructure abort of its episode. An error that all episodes would share is
        raised. After an interrupt, finished episodes are yielded before `KeyboardInterrupt` is raised.
        """


@dataclass(frozen=True, slots=True)
class LocalExecutor:
    """An executor that plays episodes in child processes."""

    jobs: int = 1

    def play(self, tasks: Iterable[EpisodeTask]) -> Iterator[tuple[EpisodeTask, EpisodeReport]]:
        """Play the tasks, `jobs` at a time."""
        return play_apart(tasks, self.jobs)


__all__ = ["Executor", "LocalExecutor"]
