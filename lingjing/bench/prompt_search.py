"""Improving a prompt from failed traces: the paper's P2, P0 revised four times on a development set.

Each candidate is played on the same development seeds. The failed episodes of the best one so far go to a reviser,
which writes the next candidate; a candidate that is better takes its place. The folder keeps every candidate, every
episode and what was asked, so that a search that was stopped goes on where it was.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import msgspec

from lingjing.bench.failed_episode import failed_episode
from lingjing.errors import InfrastructureError, UsageError
from lingjing.play.options import PlayOptions
from lingjing.play.parallel import EpisodeTask, play_apart
from lingjing.play.report import ABORTED, INTERRUPTED
from lingjing.plugins.prompts import PromptReviser
from lingjing.trace.reader import read_trace

TRIES = 3
"""How often one episode is tried before it is left out."""

FAILURES = 4
"""Failed episodes that a reviser is shown."""

RESULTS = "search.json"


class PromptEpisode(msgspec.Struct, frozen=True, kw_only=True):
    """One development episode of a candidate: how it ended, and where its trace is."""

    seed: int
    success: bool
    scr: float
    trace: str
    answers: float | None = None
    error_m: float | None = None


class PromptCandidate(msgspec.Struct, frozen=True, kw_only=True):
    """A prompt with its results; `number` 0 is what the search began with."""

    number: int
    text: str
    episodes: tuple[PromptEpisode, ...] = ()

    @property
    def sha256(self) -> str:
        """SHA-256 (hex) of the text."""
        return hashlib.sha256(self.text.encode()).hexdigest()

    @property
    def tsr(self) -> float:
        """Share of episodes that were won."""
        return _mean([float(one.success) for one in self.episodes])

    @property
    def scr(self) -> float:
        """Mean share of subtasks done."""
        return _mean([one.scr for one in self.episodes])

    @property
    def compliance(self) -> float:
        """Mean share of answers that kept to the schema."""
        return _mean([one.answers for one in self.episodes if one.answers is not None])

    @property
    def rank(self) -> tuple[float, float, float]:
        """What makes one better than another: episodes won, subtasks done, answers that keep to the schema."""
        return self.tsr, self.scr, self.compliance

    @property
    def line(self) -> str:
        """The results in words."""
        done = f"TSR {self.tsr:.0%}, SCR {self.scr:.0%}, JSON compliance {self.compliance:.0%}"
        return f"{done} over {len(self.episodes)} episodes"


@dataclass(slots=True)
class PromptSearch:
    """A search in a folder. `option` is the policy's option that takes a prompt's file; `seeds` are the development
    episodes; `check` raises `ValueError` for a text that is no prompt; `tell` is given each candidate when its results
    are known."""

    folder: Path
    options: PlayOptions
    option: str
    seeds: Sequence[int]
    reviser: PromptReviser
    check: Callable[[str], None]
    jobs: int = 1
    tell: Callable[[PromptCandidate], None] = field(default=lambda candidate: None)

    def run(self, start: str, rounds: int) -> PromptCandidate:
        """The best of the prompt and its `rounds` revisions. Raises `UsageError` if the folder holds another search."""
        known = self._known(start)
        best = self._played(known, PromptCandidate(number=0, text=start))
        for number in range(1, rounds + 1):
            candidate = next((one for one in known if one.number == number), None)
            if candidate is None:
                candidate = PromptCandidate(number=number, text=self._revised(best, number))
            candidate = self._played(known, candidate)
            best = max(best, candidate, key=lambda one: one.rank)  # the earlier one of equals
        return best

    def _known(self, start: str) -> list[PromptCandidate]:
        """What the folder has. A search of another prompt or of other seeds is refused."""
        file = self.folder / RESULTS
        if not file.is_file():
            return []
        try:
            found = msgspec.json.decode(file.read_bytes(), type=list[PromptCandidate])
        except msgspec.DecodeError as error:
            raise UsageError(f"`{file}` holds no search of prompts: {error}", hint="name another folder") from error
        other = {one.seed for each in found for one in each.episodes} - set(self.seeds)
        if other or (found and found[0].text != start):
            raise UsageError(
                f"`{self.folder}` holds the search of another prompt, or on other seeds", hint="name another folder"
            )
        return found

    def _played(self, known: list[PromptCandidate], candidate: PromptCandidate) -> PromptCandidate:
        """The candidate with the results of all seeds; those that the folder has are not played again."""
        done = next((one for one in known if one.number == candidate.number), candidate)
        file = self.folder / f"candidate-{candidate.number}.txt"
        self.folder.mkdir(parents=True, exist_ok=True)
        file.write_text(candidate.text, encoding="utf-8")
        for _ in range(TRIES):
            missing = sorted(set(self.seeds) - {one.seed for one in done.episodes})
            for task, report in play_apart([self._task(file, candidate, seed) for seed in missing], self.jobs):
                if report.reason in (ABORTED, INTERRUPTED):
                    continue
                counted = report.metrics
                episode = PromptEpisode(
                    seed=task.options.seed, success=report.success, scr=report.scr, trace=report.trace,
                    answers=counted.json_compliance if counted else None,
                    error_m=counted.localisation_error_m if counted else None,
                )  # fmt: skip
                done = msgspec.structs.replace(done, episodes=(*done.episodes, episode))
                self._keep(known, done)
        if not done.episodes:
            raise InfrastructureError(
                "no development episode could be played", hint="play one with `lingjing run` first"
            )
        self._keep(known, done)
        self.tell(done)
        return done

    def _task(self, file: Path, candidate: PromptCandidate, seed: int) -> EpisodeTask:
        options = msgspec.structs.replace(
            self.options,
            seed=seed,
            overview=False,
            policy_args={**self.options.policy_args, self.option: str(file.resolve())},
        )
        return EpisodeTask(options, self.folder / f"candidate-{candidate.number}-{seed}")

    def _keep(self, known: list[PromptCandidate], candidate: PromptCandidate) -> None:
        """Put a candidate into the folder's results; the file is replaced whole."""
        others = [one for one in known if one.number != candidate.number]
        known[:] = sorted([*others, candidate], key=lambda one: one.number)
        part = self.folder / f"{RESULTS}.part"
        part.write_bytes(msgspec.json.format(msgspec.json.encode(known), indent=1))
        part.replace(self.folder / RESULTS)

    def _revised(self, best: PromptCandidate, number: int) -> str:
        """The next candidate's text; what was asked and answered is kept beside it."""
        failed = [one for one in best.episodes if not one.success][:FAILURES]
        told = [failed_episode(read_trace(Path(one.trace))) for one in failed]
        revision = self.reviser.revise(best.text, best.line, told)
        try:
            self.check(revision.text)
        except ValueError as error:
            raise InfrastructureError(f"the revision {error}", hint="run it again: another may be better") from error
        (self.folder / f"revision-{number}-asked.txt").write_text(revision.asked, encoding="utf-8")
        (self.folder / f"revision-{number}-answered.txt").write_text(revision.answered, encoding="utf-8")
        return revision.text


def _mean(values: Sequence[float]) -> float:
    return sum(values) / len(values) if values else 0.0
