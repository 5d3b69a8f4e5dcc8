"""Prompt search on failed traces: the paper's P2, which is P0 revised four times on a development set.

Each candidate is played on the same development seeds. Failed episodes of the best candidate so far go to a reviser,
which writes the next candidate; a better candidate replaces the best. The folder stores every candidate, episode and
request, so that an interrupted search continues. One command at a time may use it.
"""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import msgspec

from lingjing.analysis.metrics import metrics
from lingjing.bench.folder import lock_folder, write_whole
from lingjing.bench.rows import comparable
from lingjing.bench.running import OUT_OF_LIMITS, remove_run
from lingjing.decoding import from_json
from lingjing.errors import InfrastructureError, UsageError
from lingjing.play.options import PlayOptions
from lingjing.play.parallel import EpisodeProcesses, EpisodeTask
from lingjing.play.report import ABORTED, INTERRUPTED, EpisodeReport
from lingjing.play.spending import CountedCalls, SpendingLimits
from lingjing.plugins.calls import ModelCalls, SpendingLimitError
from lingjing.plugins.prompts import PromptReviser, TriedPrompt
from lingjing.trace.reader import Trace, read_trace
from lingjing.trace.records import BoundaryRecord, DecisionRecord

TRIES = 3
"""The number of tries of an episode. An episode that cannot be played ends the search, because all candidates play the
same ones.
"""

FAILURES = 4
"""The number of failed episodes in a request to the reviser."""

FIRST, LAST = 5, 4
"""Decisions of an agent in a request, from the start and from the end of its episode. Chosen."""

LONGEST = 220
"""Letters of a thought in a request. Chosen."""

AGENTS = 6
"""Agents in a request. Chosen."""

RESULTS = "search.json"
"""The file of the search's state."""

LEDGER = "money"
"""The file that counts the cost."""

_ELSEWHERE = ("base_url", "models")
"""Options that locate services and files; they may change when a search continues."""


class PromptEpisode(msgspec.Struct, frozen=True, kw_only=True):
    """One development episode of a candidate."""

    seed: int
    success: bool
    scr: float
    """Subtask completion rate, 0 to 1."""
    answers: int = 0
    """The number of model answers."""
    valid: int = 0
    """The number of answers that match the schema."""


class PromptCandidate(msgspec.Struct, frozen=True, kw_only=True):
    """A prompt with its results."""

    number: int
    """Number of the candidate; 0 for the prompt that the search began with."""
    text: str
    episodes: tuple[PromptEpisode, ...] = ()
    fault: str = ""
    """The reason why the answer was no prompt; such a candidate is not played."""

    @property
    def sha256(self) -> str:
        """SHA-256 (hex) of the text."""
        return hashlib.sha256(self.text.encode()).hexdigest()

    @property
    def tsr(self) -> float:
        """The share of won episodes."""
        return _mean([float(episode.success) for episode in self.episodes])

    @property
    def scr(self) -> float:
        """The mean subtask completion rate."""
        return _mean([episode.scr for episode in self.episodes])

    @property
    def compliance(self) -> float:
        """The share of all answers that match the schema."""
        return sum(episode.valid for episode in self.episodes) / max(
            1, sum(episode.answers for episode in self.episodes)
        )

    @property
    def rank(self) -> tuple[float, float, float]:
        """The order of candidates: won episodes, completed subtasks, valid answers."""
        return self.tsr, self.scr, self.compliance

    @property
    def line(self) -> str:
        """The results in words."""
        if self.fault:
            return f"no prompt: the answer {self.fault}"
        done = f"TSR {self.tsr:.0%}, SCR {self.scr:.0%}, JSON compliance {self.compliance:.0%}"
        return f"{done} over {len(self.episodes)} episodes"


class KeptSearch(msgspec.Struct, frozen=True, kw_only=True):
    """The stored state of a search."""

    start: str
    """The prompt that the search began with."""
    seeds: tuple[int, ...]
    mission: str
    options: PlayOptions
    candidates: tuple[PromptCandidate, ...] = ()


@dataclass(slots=True)
class PromptSearch:
    """A search in a folder."""

    folder: Path
    options: PlayOptions
    option: str
    """The policy's option for the file of a prompt."""
    seeds: Sequence[int]
    """The development seeds."""
    reviser: Callable[[ModelCalls], PromptReviser]
    """Makes a reviser; its calls are counted."""
    check: Callable[[str], None]
    """Raises `ValueError` for a text that is no prompt."""
    jobs: int = 1
    """Episodes played in parallel."""
    tell: Callable[[PromptCandidate], None] = field(default=lambda candidate: None)
    """Receives each candidate when its results are known."""
    _processes: EpisodeProcesses = field(default_factory=EpisodeProcesses)
    """The processes of all episodes."""

    def run(self, start: str, rounds: int) -> PromptCandidate:
        """Return the best of the prompt and its `rounds` revisions. The search ends early if a candidate wins every
        episode.

        Raises `UsageError` if the folder holds another search, is in use or cannot be written, or if the money is
        spent; `InfrastructureError` if an episode cannot be played or the reviser does not answer.
        """
        reviser = self.reviser(CountedCalls(SpendingLimits(self.options.max_cost, None, self._ledger)))
        with lock_folder(self.folder, "search of prompts"), _explained_limits(), self._processes:
            known = self._known(start)
            best = self._played(known, PromptCandidate(number=0, text=start))
            for number in range(1, rounds + 1):
                candidate = next(
                    (known_candidate for known_candidate in known if known_candidate.number == number), None
                )
                if candidate is None and best.tsr == 1.0:
                    break  # without a failure the reviser has no input
                if candidate is None:
                    candidate = self._revised(reviser, best, known, number)
                    self._keep(known, candidate)
                if candidate.fault:
                    self.tell(candidate)
                    continue
                candidate = self._played(known, candidate)
                best = max(
                    best, candidate, key=lambda known_candidate: known_candidate.rank
                )  # the earlier of equal candidates
            return best

    @property
    def _ledger(self) -> Path | None:
        """The file that counts the cost of all commands of the search."""
        return None if self.options.max_cost is None else self.folder / LEDGER

    def _known(self, start: str) -> list[PromptCandidate]:
        """Return the stored candidates. Raises `UsageError` if the folder holds another search."""
        file = self.folder / RESULTS
        if not file.is_file():
            return []
        try:
            stored = from_json(file.read_bytes(), KeptSearch)
        except msgspec.DecodeError as error:
            raise UsageError(
                f"`{file}` is not the state of a prompt search: {error}", hint="name another folder"
            ) from error
        now = self._described(start)
        others = [name for name in now.__struct_fields__[:-1] if getattr(stored, name) != getattr(now, name)]
        if others:
            raise UsageError(
                f"`{self.folder}` holds a search with other {', '.join(others)}",
                hint="name another folder with --folder",
            )
        return list(stored.candidates)

    def _described(self, start: str) -> KeptSearch:
        """Return the search without its candidates."""
        plain = comparable(self.options)
        args = {name: value for name, value in plain.policy_args.items() if name not in _ELSEWHERE}
        return KeptSearch(
            start=start,
            seeds=tuple(sorted(self.seeds)),
            mission=Path(self.options.mission).stem,
            options=msgspec.structs.replace(plain, policy_args=args),
        )

    def _played(self, known: list[PromptCandidate], candidate: PromptCandidate) -> PromptCandidate:
        """Return the candidate with the results of all seeds; stored results are not played again."""
        done = next((item for item in known if item.number == candidate.number), candidate)
        write_whole(self._text_file(candidate), candidate.text.encode())
        failed: EpisodeReport | None = None
        for _ in range(TRIES):
            missing = sorted(set(self.seeds) - {item.seed for item in done.episodes})
            for task, report in self._processes.play(self._tasks(candidate, missing), self.jobs):
                if report.reason == INTERRUPTED:
                    continue
                if report.reason == ABORTED:
                    failed = _retryable(report)
                    continue
                done = msgspec.structs.replace(done, episodes=(*done.episodes, _counted(task.options.seed, report)))
                self._keep(known, done)
        missing = sorted(set(self.seeds) - {item.seed for item in done.episodes})
        if missing:
            reason = failed.detail if failed is not None else "it was interrupted"
            raise InfrastructureError(
                f"{len(missing)} episodes of candidate {candidate.number} could not be played, the first is seed "
                f"{missing[0]}: {reason}",
                hint="the same command tries them again",
            )
        self.tell(done)
        return done

    def _tasks(self, candidate: PromptCandidate, seeds: Sequence[int]) -> Iterator[EpisodeTask]:
        """Yield the episodes; the remains of an unfinished try are removed first."""
        for seed in seeds:
            folder = self._episode(candidate, seed)
            remove_run(folder)
            args = {**self.options.policy_args, self.option: str(self._text_file(candidate).resolve())}
            ledger = "" if self._ledger is None else str(self._ledger.resolve())
            options = msgspec.structs.replace(self.options, seed=seed, overview=False, policy_args=args, ledger=ledger)
            yield EpisodeTask(options, folder)

    def _text_file(self, candidate: PromptCandidate) -> Path:
        return self.folder / f"candidate-{candidate.number}.txt"

    def _episode(self, candidate: PromptCandidate, seed: int) -> Path:
        return self.folder / f"candidate-{candidate.number}-{seed}"

    def _keep(self, known: list[PromptCandidate], candidate: PromptCandidate) -> None:
        """Store a candidate in the folder's results; the file is replaced atomically."""
        others = [item for item in known if item.number != candidate.number]
        known[:] = sorted([*others, candidate], key=lambda item: item.number)
        kept = msgspec.structs.replace(self._described(known[0].text), candidates=tuple(known))
        write_whole(self.folder / RESULTS, msgspec.json.format(msgspec.json.encode(kept), indent=1))

    def _revised(
        self, reviser: PromptReviser, best: PromptCandidate, known: Sequence[PromptCandidate], number: int
    ) -> PromptCandidate:
        """Return the next candidate; request and answer are stored beside it."""
        failed = [self._episode(best, item.seed) for item in best.episodes if not item.success]
        left = [trace for folder in failed if (trace := _trace_in(folder)) is not None][:FAILURES]
        tried = [TriedPrompt(item.text, item.line) for item in known if item.number not in (0, best.number)]
        revision = reviser.revise(best.text, best.line, [_failed_episode(read_trace(path)) for path in left], tried)
        fault = revision.fault
        if not fault:
            try:
                self.check(revision.text)
            except ValueError as error:
                fault = str(error)
        write_whole(self.folder / f"revision-{number}-asked.txt", revision.asked.encode())
        write_whole(self.folder / f"revision-{number}-answered.txt", revision.answered.encode("utf-8", "replace"))
        return PromptCandidate(number=number, text="" if fault else revision.text, fault=fault)


@contextmanager
def _explained_limits() -> Iterator[None]:
    """Turn write errors and spent limits into `UsageError` with a hint on how to continue."""
    try:
        yield
    except OSError as error:
        raise UsageError(
            f"cannot write the search of prompts: {error.strerror or error}",
            hint="make room; the same command continues",
        ) from error
    except SpendingLimitError as error:
        raise UsageError(str(error), hint="the same command with a higher --max-cost continues") from error


def _retryable(report: EpisodeReport) -> EpisodeReport:
    """Return the report of an abort that may end differently next time. Raises `SpendingLimitError` for a spent
    limit.
    """
    if report.detail.startswith(OUT_OF_LIMITS):
        raise SpendingLimitError(report.detail)
    return report


def _trace_in(folder: Path) -> Path | None:
    """Return the trace of an episode that ended by itself, or None if the folder has none."""
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


# -- the text on a failed episode, an input of the reviser: what policies received and did, and nothing hidden


def _failed_episode(trace: Trace) -> str:
    """Return the end of an episode, its failures by kind, and the first and last decisions of its agents, as text."""
    values = metrics(trace)
    lines = [
        f"It ended after {values.ticks} ticks ({values.reason}); {values.scr or 0.0:.0%} of its subtasks were done.",
        f"Stages: {', '.join(f'{stage.name} {stage.done} of {stage.required}' for stage in values.stages) or 'none'}.",
        f"Reports: {values.reports}, {values.detections} of them of a target; {values.misses} targets in view missed.",
        f"Messages: {values.messages}. Rejected: {_rejections(trace)}.",
        *_unusable_answers(trace),
    ]
    for agent in list(dict.fromkeys(made.agent for record in trace.boundaries for made in record.decisions))[:AGENTS]:
        lines += [f"Agent {agent}:", *_decision_lines(trace, agent)]
    return "\n".join(lines)


def _rejections(trace: Trace) -> str:
    refused = Counter(
        f"{receipt.resource}: {receipt.reason}"
        for record in trace.boundaries
        for receipt in record.receipts
        if receipt.status == "rejected"
    )
    return ", ".join(f"{many} times {reason}" for reason, many in refused.most_common(6)) or "nothing"


def _unusable_answers(trace: Trace) -> Iterator[str]:
    """Yield the errors of unusable answers, each kind once."""
    faults = Counter(
        made.detail[:LONGEST] for record in trace.boundaries for made in record.decisions if made.substituted
    )
    for fault, many in faults.most_common(3):
        yield f"{many} answers could not be used: {fault}"


def _decision_lines(trace: Trace, agent: str) -> Iterator[str]:
    made = [
        (record, decision) for record in trace.boundaries for decision in record.decisions if decision.agent == agent
    ]
    left_out = len(made) - FIRST - LAST
    for record, decision in made[:FIRST]:
        yield _decision_line(record, decision)
    if left_out > 0:
        yield f"  … {left_out} more …"
    for record, decision in made[max(FIRST, len(made) - LAST) :]:
        yield _decision_line(record, decision)


def _decision_line(record: BoundaryRecord, made: DecisionRecord) -> str:
    command, messages = made.decision.command, made.decision.messages
    did = f"{command.verb} {dict(command.arguments)}" if command else "no command"
    sent = f"; sends {', '.join(message.kind for message in messages)}" if messages else ""
    thought = " ".join(made.decision.thought.split())[:LONGEST]
    return f"  tick {record.tick - 1}: {did}{sent}" + (f' ("{thought}")' if thought else "")
