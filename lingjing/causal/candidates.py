"""`CandidatePlayer`: whether smaller missions fail as a trace did, by playing them.

A candidate is a whole `.ljs` text. It must compile, draw an instance in which what was kept is as it was, not be proved
hopeless, fail the same way with the same policies and seeds, and be won by the control policy, where there is one: an
episode that nobody could win says nothing about who lost it. Each verdict is kept by the SHA-256 of the text, in memory
and in a file, so nothing is played twice.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from shutil import rmtree
from typing import Literal

import msgspec

from lingjing.causal.failure import FailureSignature, Sameness, failure_of
from lingjing.causal.reduced_mission import ReducedMission
from lingjing.dsl.compilation import compile_text
from lingjing.dsl.printing.printer import to_ljs
from lingjing.errors import InfrastructureError, LingjingError, MissionError, UsageError
from lingjing.mission.feasibility import prove_instance
from lingjing.mission.instance import Instance
from lingjing.mission.instantiate import instantiate
from lingjing.play.options import PlayOptions
from lingjing.play.parallel import EpisodeTask, play_apart
from lingjing.trace.reader import Trace, read_trace
from lingjing.trace.records import CUT_SHORT

PROVED = "LJ06"
"""How the codes of proofs begin that no episode of a mission can be won."""

CandidateVerdict = Literal["fails", "other", "won", "no mission", "hopeless", "aborted"]
"""What became of a candidate: it fails the same way; it fails otherwise; it is won; it is no valid mission, or what was
kept is not as it was; it cannot be won, as a proof says or because the control lost; its episode was cut short."""

Predicate = Callable[[Trace], bool]
"""Says of a failed episode's trace whether it is the failure that is looked for."""


class BudgetUsedUpError(LingjingError):
    """As many episodes were played as were allowed."""


class TriedCandidate(msgspec.Struct, frozen=True, kw_only=True):
    """A verdict with the digest and the ticks of the episode, where one was played. `who` played it."""

    key: str
    who: str
    verdict: CandidateVerdict
    ticks: int = 0
    digest: str = ""


@dataclass(frozen=True, slots=True)
class Candidate:
    """A text, who plays whom in it, and the ids that its agents had."""

    text: str
    agents: Mapping[str, str]

    @property
    def key(self) -> str:
        """The SHA-256 of text and agents."""
        return hashlib.sha256(f"{sorted(self.agents.items())}\n{self.text}".encode()).hexdigest()


@dataclass
class CandidatePlayer:
    """Plays candidates, at most `budget` episodes, `jobs` at a time; `folder` is for their files.

    `policies` are the trace's by the old ids of its agents; `options` is how it was played, without mission and
    policies. `control` is the policy that must win, "" for none.
    """

    trace: Trace
    signature: FailureSignature
    sameness: Sameness
    options: PlayOptions
    policies: Mapping[str, str]
    folder: Path
    log: Path
    budget: int
    jobs: int = 1
    control: str = ""
    predicate: Predicate | None = None
    played: int = 0
    known: dict[tuple[str, str], TriedCandidate] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Take in what an earlier call has tried."""
        if self.log.is_file():
            for line in self.log.read_bytes().splitlines():
                try:
                    one = msgspec.json.decode(line, type=TriedCandidate)
                except msgspec.DecodeError:  # the line that was being written when it was killed
                    continue
                self.known[one.key, one.who] = one

    def candidate(self, reduced: ReducedMission) -> Candidate | None:
        """The text of a reduced mission; None for what cannot be written."""
        try:
            return Candidate(to_ljs(reduced.mission), reduced.agents)
        except (MissionError, ValueError):
            return None

    def first_failing(self, candidates: Sequence[Candidate | None]) -> int | None:
        """The first that fails the same way and that the control wins. Raises `BudgetUsedUpError`."""
        for start in range(0, len(candidates), self.jobs):
            batch = candidates[start : start + self.jobs]
            self._try([one for one in batch if one is not None], "")
            for number, one in enumerate(batch, start):
                if one is not None and self.verdict(one) == "fails":
                    return number
        return None

    def verdict(self, candidate: Candidate) -> CandidateVerdict:
        """What becomes of a candidate."""
        found = self._known(candidate, "")
        if found != "fails" or not self.control:
            return found
        return "fails" if self._known(candidate, self.control) == "won" else "hopeless"

    def replayed(self, candidate: Candidate) -> CandidateVerdict:
        """What becomes of a candidate when it is played once more, whatever is known of it and however many episodes
        were allowed."""
        self.known.pop((candidate.key, ""), None)
        self.budget = max(self.budget, self.played + 1)
        return self._known(candidate, "")

    def digest(self, candidate: Candidate) -> str:
        """The digest of the candidate's episode; it must have been played."""
        return self.known[candidate.key, ""].digest

    def _known(self, candidate: Candidate, who: str) -> CandidateVerdict:
        if (candidate.key, who) not in self.known:
            self._try([candidate], who)
        return self.known[candidate.key, who].verdict

    def _try(self, candidates: Sequence[Candidate], who: str) -> None:
        """Have verdicts on these candidates."""
        due = {one.key: one for one in candidates if (one.key, who) not in self.known}
        valid = []
        for one in due.values():
            refused = self._refused(one) if not who else None
            if refused is None:
                valid.append(one)
            else:
                self._keep(TriedCandidate(key=one.key, who=who, verdict=refused))
        if not valid:
            return
        valid = valid[: max(self.budget - self.played, 0)]
        if not valid:
            raise BudgetUsedUpError(f"{self.played} episodes were played")
        try:
            self._play(valid, who)
        except InfrastructureError:
            raise
        except LingjingError:  # one of them cannot begin, which ended the others
            for one in valid:
                self._play_alone(one, who)

    def _play_alone(self, candidate: Candidate, who: str) -> None:
        if (candidate.key, who) in self.known:
            return
        try:
            self._play([candidate], who)
        except InfrastructureError:
            raise
        except LingjingError:
            self._keep(TriedCandidate(key=candidate.key, who=who, verdict="no mission"))

    def _play(self, candidates: Sequence[Candidate], who: str) -> None:
        tasks = {}
        for one in candidates:
            place = self.folder / f"{one.key[:16]}-{'control' if who else 'same'}"
            rmtree(place, ignore_errors=True)
            mission = self.folder / f"{one.key[:16]}.ljs"
            mission.write_text(one.text, encoding="utf-8")
            tasks[place] = (one, EpisodeTask(self.options_for(one, str(mission), who), place, repeated=False))
            self.played += 1
        for task, report in play_apart([task for _, task in tasks.values()], self.jobs):
            one = tasks[task.folder][0]
            verdict = "aborted" if report.reason in CUT_SHORT else self._judged(read_trace(report.trace))
            self._keep(TriedCandidate(key=one.key, who=who, verdict=verdict, ticks=report.ticks, digest=report.digest))
            rmtree(task.folder, ignore_errors=True)

    def _judged(self, trace: Trace) -> CandidateVerdict:
        found = failure_of(trace)
        if found is None:
            return "won"
        if self.predicate is not None:
            return "fails" if self.predicate(trace) else "other"
        return "fails" if found.part(self.sameness) == self.signature.part(self.sameness) else "other"

    def options_for(self, candidate: Candidate, mission: str, who: str = "") -> PlayOptions:
        """How a candidate is played: by the trace's policies, or by one for all."""
        policies = {new: self.policies[old] for new, old in candidate.agents.items()}
        if who:
            return msgspec.structs.replace(self.options, mission=mission, policy=who, policies_for={}, policy_args={})
        first, *others = dict.fromkeys(policies.values())
        differing = {name: policy for name, policy in policies.items() if policy != first} if others else {}
        return msgspec.structs.replace(self.options, mission=mission, policy=first, policies_for=differing)

    def _refused(self, candidate: Candidate) -> CandidateVerdict | None:
        """Why the candidate need not be played."""
        result = compile_text(candidate.text)
        compiled = result.mission
        if compiled is None:
            errors = [one.code for one in result.diagnostics if one.severity == "error"]
            return "hopeless" if all(code.startswith(PROVED) for code in errors) else "no mission"
        before = self.trace.header.instance
        try:
            instance = instantiate(compiled, seed=before.seed, mode=before.mode)
        except LingjingError:
            return "no mission"
        if not _kept_as_it_was(before, instance, candidate.agents):
            return "no mission"
        return "hopeless" if any(True for _ in prove_instance(instance)) else None

    def _keep(self, one: TriedCandidate) -> None:
        self.known[one.key, one.who] = one
        if one.verdict != "aborted":  # it may end otherwise another time
            append(self.log, msgspec.json.encode(one) + b"\n")


def append(log: Path, line: bytes = b"") -> None:
    """Write a line behind those that are there. Raises `UsageError` where that cannot be."""
    try:
        with log.open("ab") as file:
            file.write(line)
    except OSError as error:
        raise UsageError(f"cannot write `{log}`: {error.strerror}", hint="choose another place with -o") from error


def _kept_as_it_was(before: Instance, after: Instance, agents: Mapping[str, str]) -> bool:
    """Whether each agent that is left has the role and the bodies that it had, and each body and target its place."""
    places = {(entity.group, entity.position, entity.type) for entity in before.entities}
    if any((entity.group, entity.position, entity.type) not in places for entity in after.entities):
        return False
    old = {agent.id: agent for agent in before.agents}
    where = {entity.id: entity.position for entity in (*before.entities,)}
    now = {entity.id: entity.position for entity in after.entities}
    return {agent.id for agent in after.agents} == set(agents) and all(
        agent.role == old[agents[agent.id]].role
        and [now[body] for body in agent.controls] == [where[body] for body in old[agents[agent.id]].controls]
        for agent in after.agents
    )
