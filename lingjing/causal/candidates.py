"""Candidates for smaller missions, and their verdicts by playing.

A candidate is a complete `.ljs` text. It must compile; its instance must keep the remaining entities unchanged; no
proof may exclude a win; it must fail alike with the same policies and seeds; and the control policy must win it, if
there is one, because a mission that cannot be won shows nothing about policies. Verdicts are stored in memory and in a
file by the SHA-256 of the text, so nothing is played twice.
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
from lingjing.decoding import from_json
from lingjing.dsl.compilation import compile_text
from lingjing.dsl.printing.printer import to_ljs
from lingjing.errors import InfrastructureError, LingjingError, MissionError, UsageError
from lingjing.mission.feasibility import prove_instance
from lingjing.mission.instance import Instance
from lingjing.mission.instantiate import instantiate
from lingjing.play.options import PlayOptions
from lingjing.play.parallel import EpisodeProcesses, EpisodeTask
from lingjing.trace.reader import Trace, read_trace
from lingjing.trace.records import CUT_SHORT

PROVED = "LJ06"
"""Prefix of the diagnostic codes that prove a mission unwinnable."""

CandidateVerdict = Literal["fails", "other", "won", "no mission", "hopeless", "aborted"]
"""`fails`: fails alike. `other`: fails differently. `won`: is won. `no mission`: is no valid mission, or changed the
remaining entities. `hopeless`: cannot be won, by a proof or because the control lost. `aborted`: the episode was cut
short.
"""

Predicate = Callable[[Trace], bool]
"""Returns True if a failed trace shows the wanted failure."""


class BudgetUsedUpError(LingjingError):
    """The budget of episodes is used up."""


class TriedCandidate(msgspec.Struct, frozen=True, kw_only=True):
    """A verdict; one line of the log."""

    key: str
    """The key of the candidate."""
    who: str
    """The control policy that played; empty for the trace's policies."""
    verdict: CandidateVerdict
    ticks: int = 0
    """The ticks of the episode; 0 if none was played."""
    digest: str = ""
    """The digest of the episode; empty if none was played."""


@dataclass(frozen=True, slots=True)
class Candidate:
    """A mission text."""

    text: str
    agents: Mapping[str, str]
    """The agents' ids in the trace by their new ids."""

    @property
    def key(self) -> str:
        """The SHA-256 of text and agents."""
        return hashlib.sha256(f"{sorted(self.agents.items())}\n{self.text}".encode()).hexdigest()


@dataclass
class CandidatePlayer:
    """Plays candidates and logs their verdicts."""

    trace: Trace
    signature: FailureSignature
    """The signature of the trace's failure."""
    sameness: Sameness
    """The compared parts of signatures."""
    options: PlayOptions
    """The trace's options, without mission and policies."""
    policies: Mapping[str, str]
    """The trace's policies by the old ids of its agents."""
    folder: Path
    """A folder for temporary files."""
    log: Path
    """The file of verdicts."""
    budget: int
    """The greatest number of episodes."""
    jobs: int = 1
    """Episodes played in parallel."""
    control: str = ""
    """The policy that must win; empty: none."""
    predicate: Predicate | None = None
    """A user's function that compares failures, in place of the signature; None: not set."""
    processes: EpisodeProcesses = field(default_factory=EpisodeProcesses)
    """The processes of all episodes, which the caller closes. Without it each candidate would import the engines."""
    played: int = 0
    """The number of played episodes."""
    known: dict[tuple[str, str], TriedCandidate] = field(default_factory=dict)
    """Verdicts by candidate and control policy."""

    def __post_init__(self) -> None:
        """Read the verdicts of earlier commands."""
        if self.log.is_file():
            for line in self.log.read_bytes().splitlines():
                try:
                    tried = from_json(line, TriedCandidate)
                except msgspec.DecodeError:  # an incomplete last line of a killed command
                    continue
                self.known[tried.key, tried.who] = tried

    def candidate(self, reduced: ReducedMission) -> Candidate | None:
        """Return the text of a reduced mission, or None if it cannot be written."""
        try:
            return Candidate(to_ljs(reduced.mission), reduced.agents)
        except (MissionError, ValueError):
            return None

    def first_failing(self, candidates: Sequence[Candidate | None]) -> int | None:
        """Return the index of the first candidate that fails alike and that the control wins, or None. Raises
        `BudgetUsedUpError`.
        """
        for start in range(0, len(candidates), self.jobs):
            batch = candidates[start : start + self.jobs]
            self._try([candidate for candidate in batch if candidate is not None], "")
            for number, candidate in enumerate(batch, start):
                if candidate is not None and self.verdict(candidate) == "fails":
                    return number
        return None

    def verdict(self, candidate: Candidate) -> CandidateVerdict:
        """Return the verdict of a candidate."""
        outcome = self._known(candidate, "")
        if outcome != "fails" or not self.control:
            return outcome
        return "fails" if self._known(candidate, self.control) == "won" else "hopeless"

    def replayed(self, candidate: Candidate) -> CandidateVerdict:
        """Play a candidate again, even if its verdict is known and the budget is used up, and return the verdict."""
        self.known.pop((candidate.key, ""), None)
        self.budget = max(self.budget, self.played + 1)
        return self._known(candidate, "")

    def digest(self, candidate: Candidate) -> str:
        """Return the digest of the candidate's episode, which must have been played."""
        return self.known[candidate.key, ""].digest

    def _known(self, candidate: Candidate, control: str) -> CandidateVerdict:
        if (candidate.key, control) not in self.known:
            self._try([candidate], control)
        return self.known[candidate.key, control].verdict

    def _try(self, candidates: Sequence[Candidate], control: str) -> None:
        """Find the verdicts of these candidates."""
        due = {candidate.key: candidate for candidate in candidates if (candidate.key, control) not in self.known}
        valid = []
        for candidate in due.values():
            rejected = self._rejection(candidate) if not control else None
            if rejected is None:
                valid.append(candidate)
            else:
                self._keep(TriedCandidate(key=candidate.key, who=control, verdict=rejected))
        if not valid:
            return
        valid = valid[: max(self.budget - self.played, 0)]
        if not valid:
            raise BudgetUsedUpError(f"{self.played} episodes were played")
        try:
            self._play(valid, control)
        except InfrastructureError:
            raise
        except LingjingError:  # one candidate cannot start, which ended the others
            for candidate in valid:
                self._play_alone(candidate, control)

    def _play_alone(self, candidate: Candidate, control: str) -> None:
        if (candidate.key, control) in self.known:
            return
        try:
            self._play([candidate], control)
        except InfrastructureError:
            raise
        except LingjingError:
            self._keep(TriedCandidate(key=candidate.key, who=control, verdict="no mission"))

    def _play(self, candidates: Sequence[Candidate], control: str) -> None:
        tasks = {}
        for candidate in candidates:
            place = self.folder / f"{candidate.key[:16]}-{'control' if control else 'same'}"
            rmtree(place, ignore_errors=True)
            mission = self.folder / f"{candidate.key[:16]}.ljs"
            mission.write_text(candidate.text, encoding="utf-8")
            tasks[place] = (
                candidate,
                EpisodeTask(self.options_for(candidate, str(mission), control), place, repeated=False),
            )
            self.played += 1
        for task, report in self.processes.play([task for _, task in tasks.values()], self.jobs):
            candidate = tasks[task.folder][0]
            verdict = "aborted" if report.reason in CUT_SHORT else self._verdict_on(read_trace(report.trace))
            self._keep(
                TriedCandidate(
                    key=candidate.key, who=control, verdict=verdict, ticks=report.ticks, digest=report.digest
                )
            )
            rmtree(task.folder, ignore_errors=True)

    def _verdict_on(self, trace: Trace) -> CandidateVerdict:
        failure = failure_of(trace)
        if failure is None:
            return "won"
        if self.predicate is not None:
            return "fails" if self.predicate(trace) else "other"
        return "fails" if failure.part(self.sameness) == self.signature.part(self.sameness) else "other"

    def options_for(self, candidate: Candidate, mission: str, control: str = "") -> PlayOptions:
        """Return the options of a candidate: with the trace's policies, or with the control policy for all agents."""
        policies = {new: self.policies[old] for new, old in candidate.agents.items()}
        if control:
            return msgspec.structs.replace(
                self.options, mission=mission, policy=control, policies_for={}, policy_args={}
            )
        first, *others = dict.fromkeys(policies.values())
        differing = {name: policy for name, policy in policies.items() if policy != first} if others else {}
        return msgspec.structs.replace(self.options, mission=mission, policy=first, policies_for=differing)

    def _rejection(self, candidate: Candidate) -> CandidateVerdict | None:
        """Return the verdict on a candidate that need not be played, or None."""
        result = compile_text(candidate.text)
        compiled = result.mission
        if compiled is None:
            errors = [diagnostic.code for diagnostic in result.diagnostics if diagnostic.severity == "error"]
            return "hopeless" if all(code.startswith(PROVED) for code in errors) else "no mission"
        before = self.trace.header.instance
        try:
            instance = instantiate(compiled, seed=before.seed, mode=before.mode)
        except LingjingError:
            return "no mission"
        if not _is_unchanged(before, instance, candidate.agents):
            return "no mission"
        return "hopeless" if any(True for _ in prove_instance(instance)) else None

    def _keep(self, tried: TriedCandidate) -> None:
        self.known[tried.key, tried.who] = tried
        if tried.verdict != "aborted":  # not logged: the same candidate may end by itself later
            append(self.log, msgspec.json.encode(tried) + b"\n")


def append(log: Path, line: bytes = b"") -> None:
    """Append a line to the log. Raises `UsageError` if it cannot be written."""
    try:
        with log.open("ab") as file:
            file.write(line)
    except OSError as error:
        raise UsageError(f"cannot write `{log}`: {error.strerror}", hint="choose another place with -o") from error


def _is_unchanged(before: Instance, after: Instance, agents: Mapping[str, str]) -> bool:
    """Return whether the remaining agents have their roles and bodies, and the remaining entities their positions."""
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
