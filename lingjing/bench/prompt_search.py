"""Improving a prompt from failed traces: the paper's P2, P0 revised four times on a development set.

Each candidate is played on the same development seeds. The failed episodes of the best one so far go to a reviser,
which writes the next candidate; a candidate that is better takes its place. The folder keeps every candidate, every
episode and what was asked, so that a search that was stopped goes on where it was; one command at a time may use it.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import msgspec

from lingjing.bench.failed_episode import failed_episode
from lingjing.bench.folder import alone_in, write_whole
from lingjing.bench.rows import comparable
from lingjing.bench.running import OUT_OF_LIMITS, take_away
from lingjing.errors import InfrastructureError, UsageError
from lingjing.play.options import PlayOptions
from lingjing.play.parallel import EpisodeTask, play_apart
from lingjing.play.report import ABORTED, INTERRUPTED, EpisodeReport
from lingjing.play.spending import SpendingLimits
from lingjing.plugins.calls import CallRequest, CallResult, ModelCalls, SpendingLimitError
from lingjing.plugins.prompts import PromptReviser, TriedPrompt
from lingjing.trace.reader import read_trace

TRIES = 3
"""How often one episode is tried. One that cannot be played ends the search: all candidates play the same ones."""

FAILURES = 4
"""Failed episodes that a reviser is shown."""

RESULTS = "search.json"
LEDGER = "money"

_ELSEWHERE = ("base_url", "models")
"""Options that say where a policy finds things; they may be others when a search goes on."""


class PromptEpisode(msgspec.Struct, frozen=True, kw_only=True):
    """One development episode of a candidate: how it ended, and how many of its `answers` kept to the schema."""

    seed: int
    success: bool
    scr: float
    answers: int = 0
    valid: int = 0


class PromptCandidate(msgspec.Struct, frozen=True, kw_only=True):
    """A prompt with its results; `number` 0 is what the search began with. One with a `fault` was no prompt and is not
    played: its round is over."""

    number: int
    text: str
    episodes: tuple[PromptEpisode, ...] = ()
    fault: str = ""

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
        """Share of all answers that kept to the schema."""
        return sum(one.valid for one in self.episodes) / max(1, sum(one.answers for one in self.episodes))

    @property
    def rank(self) -> tuple[float, float, float]:
        """What makes one better than another: episodes won, subtasks done, answers that keep to the schema."""
        return self.tsr, self.scr, self.compliance

    @property
    def line(self) -> str:
        """The results in words."""
        if self.fault:
            return f"no prompt: the answer {self.fault}"
        done = f"TSR {self.tsr:.0%}, SCR {self.scr:.0%}, JSON compliance {self.compliance:.0%}"
        return f"{done} over {len(self.episodes)} episodes"


class KeptSearch(msgspec.Struct, frozen=True, kw_only=True):
    """What a folder keeps of its search: the prompt it began with, the episodes it plays, what is known."""

    start: str
    seeds: tuple[int, ...]
    mission: str
    options: PlayOptions
    candidates: tuple[PromptCandidate, ...] = ()


@dataclass(slots=True)
class PromptSearch:
    """A search in a folder. `option` is the policy's option that takes a prompt's file; `seeds` are the development
    episodes; `reviser` makes one whose calls are counted; `check` raises `ValueError` for a text that is no prompt;
    `tell` is given each candidate when its results are known."""

    folder: Path
    options: PlayOptions
    option: str
    seeds: Sequence[int]
    reviser: Callable[[ModelCalls], PromptReviser]
    check: Callable[[str], None]
    jobs: int = 1
    tell: Callable[[PromptCandidate], None] = field(default=lambda candidate: None)

    def run(self, start: str, rounds: int) -> PromptCandidate:
        """The best of the prompt and its `rounds` revisions; fewer if one wins every episode.

        Raises `UsageError` if the folder holds another search, is in use or cannot be written, or the money is used
        up; `InfrastructureError` if an episode cannot be played, or the reviser does not answer.
        """
        reviser = self.reviser(CountedCalls(SpendingLimits(self.options.max_cost, None, self._ledger)))
        with alone_in(self.folder, "search of prompts"), _named_limits():
            known = self._known(start)
            best = self._played(known, PromptCandidate(number=0, text=start))
            for number in range(1, rounds + 1):
                candidate = next((one for one in known if one.number == number), None)
                if candidate is None and best.tsr == 1.0:
                    break  # nothing has failed: there is nothing to learn from
                if candidate is None:
                    candidate = self._revised(reviser, best, known, number)
                    self._keep(known, candidate)
                if candidate.fault:
                    self.tell(candidate)
                    continue
                candidate = self._played(known, candidate)
                best = max(best, candidate, key=lambda one: one.rank)  # the earlier one of equals
            return best

    @property
    def _ledger(self) -> Path | None:
        """Where money is counted, over all commands that go on with the search."""
        return None if self.options.max_cost is None else self.folder / LEDGER

    def _known(self, start: str) -> list[PromptCandidate]:
        """What the folder has. A search of something else is refused."""
        file = self.folder / RESULTS
        if not file.is_file():
            return []
        try:
            found = msgspec.json.decode(file.read_bytes(), type=KeptSearch)
        except msgspec.DecodeError as error:
            raise UsageError(f"`{file}` holds no search of prompts: {error}", hint="name another folder") from error
        now = self._described(start)
        others = [name for name in now.__struct_fields__[:-1] if getattr(found, name) != getattr(now, name)]
        if others:
            raise UsageError(
                f"`{self.folder}` holds a search with other {', '.join(others)}", hint="name another with --folder"
            )
        return list(found.candidates)

    def _described(self, start: str) -> KeptSearch:
        """The search without its candidates."""
        plain = comparable(self.options)
        args = {name: value for name, value in plain.policy_args.items() if name not in _ELSEWHERE}
        return KeptSearch(
            start=start,
            seeds=tuple(sorted(self.seeds)),
            mission=Path(self.options.mission).stem,
            options=msgspec.structs.replace(plain, policy_args=args),
        )

    def _played(self, known: list[PromptCandidate], candidate: PromptCandidate) -> PromptCandidate:
        """The candidate with the results of all seeds; those that the folder has are not played again."""
        done = next((one for one in known if one.number == candidate.number), candidate)
        write_whole(self._text_file(candidate), candidate.text.encode())
        failed: EpisodeReport | None = None
        for _ in range(TRIES):
            missing = sorted(set(self.seeds) - {one.seed for one in done.episodes})
            for task, report in play_apart(self._tasks(candidate, missing), self.jobs):
                if report.reason == INTERRUPTED:
                    continue
                if report.reason == ABORTED:
                    failed = _possible(report)
                    continue
                done = msgspec.structs.replace(done, episodes=(*done.episodes, _counted(task.options.seed, report)))
                self._keep(known, done)
        missing = sorted(set(self.seeds) - {one.seed for one in done.episodes})
        if missing:
            told = failed.detail if failed is not None else "it was interrupted"
            raise InfrastructureError(
                f"{len(missing)} episodes of candidate {candidate.number} could not be played, the first is seed "
                f"{missing[0]}: {told}",
                hint="the same command tries them again",
            )
        self.tell(done)
        return done

    def _tasks(self, candidate: PromptCandidate, seeds: Sequence[int]) -> Iterator[EpisodeTask]:
        """The episodes, each with what an unfinished try left taken away."""
        for seed in seeds:
            folder = self._episode(candidate, seed)
            take_away(folder)
            args = {**self.options.policy_args, self.option: str(self._text_file(candidate).resolve())}
            ledger = "" if self._ledger is None else str(self._ledger.resolve())
            options = msgspec.structs.replace(self.options, seed=seed, overview=False, policy_args=args, ledger=ledger)
            yield EpisodeTask(options, folder)

    def _text_file(self, candidate: PromptCandidate) -> Path:
        return self.folder / f"candidate-{candidate.number}.txt"

    def _episode(self, candidate: PromptCandidate, seed: int) -> Path:
        return self.folder / f"candidate-{candidate.number}-{seed}"

    def _keep(self, known: list[PromptCandidate], candidate: PromptCandidate) -> None:
        """Put a candidate into the folder's results; the file is replaced whole."""
        others = [one for one in known if one.number != candidate.number]
        known[:] = sorted([*others, candidate], key=lambda one: one.number)
        kept = msgspec.structs.replace(self._described(known[0].text), candidates=tuple(known))
        write_whole(self.folder / RESULTS, msgspec.json.format(msgspec.json.encode(kept), indent=1))

    def _revised(
        self, reviser: PromptReviser, best: PromptCandidate, known: Sequence[PromptCandidate], number: int
    ) -> PromptCandidate:
        """The next candidate; what was asked and answered is kept beside it."""
        failed = [self._episode(best, one.seed) for one in best.episodes if not one.success]
        left = [found for folder in failed if (found := _trace_in(folder)) is not None][:FAILURES]
        tried = [TriedPrompt(one.text, one.line) for one in known if one.number not in (0, best.number)]
        revision = reviser.revise(best.text, best.line, [failed_episode(read_trace(path)) for path in left], tried)
        fault = revision.fault
        if not fault:
            try:
                self.check(revision.text)
            except ValueError as error:
                fault = str(error)
        write_whole(self.folder / f"revision-{number}-asked.txt", revision.asked.encode())
        write_whole(self.folder / f"revision-{number}-answered.txt", revision.answered.encode("utf-8", "replace"))
        return PromptCandidate(number=number, text="" if fault else revision.text, fault=fault)


class CountedCalls:
    """`ModelCalls` whose money is counted with that of the episodes. The search keeps what was asked and answered."""

    replaying = False

    def __init__(self, limits: SpendingLimits) -> None:
        self._limits = limits

    @property
    def capped(self) -> bool:
        """Whether money is limited."""
        return self._limits.money_is_capped

    def begin(self, request: CallRequest) -> None:
        """Set aside what the question can cost."""
        self._limits.reserve(request)

    def end(self, request: CallRequest, result: CallResult) -> None:
        """Count what it has cost."""
        self._limits.settle(request, result)


@contextmanager
def _named_limits() -> Iterator[None]:
    """Say of a folder that cannot be written, and of money that is used up, that the search can go on."""
    try:
        yield
    except OSError as error:
        raise UsageError(
            f"cannot write the search of prompts: {error.strerror or error}", hint="make room; the same command goes on"
        ) from error
    except SpendingLimitError as error:
        raise UsageError(str(error), hint="the same command with a higher --max-cost goes on") from error


def _possible(report: EpisodeReport) -> EpisodeReport:
    """The report of an abort that may end otherwise next time. Raises `SpendingLimitError` for one that cannot."""
    if report.detail.startswith(OUT_OF_LIMITS):
        raise SpendingLimitError(report.detail)
    return report


def _trace_in(folder: Path) -> Path | None:
    """The trace of an episode that ran to its end, if the folder has it."""
    place = folder / "trace.mcap"
    return place if place.is_file() else None


def _counted(seed: int, report: EpisodeReport) -> PromptEpisode:
    answers = report.metrics.answers if report.metrics is not None else 0
    share = (report.metrics.json_compliance if report.metrics is not None else None) or 0.0
    return PromptEpisode(
        seed=seed, success=report.success, scr=report.scr or 0.0, answers=answers, valid=round(share * answers)
    )


def _mean(values: Sequence[float]) -> float:
    return sum(values) / len(values) if values else 0.0
