"""Search for the smallest mission that still fails as a trace did, by delta debugging.

The steps: the failure of the trace (`failure`), its mission with fixed draws (`reduced_mission`), removal of parts
(`delta_debugging`) as long as the played mission fails alike (`candidates`). First parts are removed, then ticks, then
single parts, until nothing more can be removed. The smallest mission so far is written after every step.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import msgspec

from lingjing.causal.candidates import (
    BudgetUsedUpError,
    Candidate,
    CandidatePlayer,
    CandidateVerdict,
    Predicate,
    append,
)
from lingjing.causal.delta_debugging import minimize
from lingjing.causal.failure import FailureSignature, Sameness, failure_of
from lingjing.causal.reduced_mission import ReducibleMission, RemovablePart
from lingjing.dsl.loading.load import load_mission
from lingjing.errors import InfrastructureError, UsageError
from lingjing.mission.instance import GivenOption, Instance
from lingjing.mission.instantiate import instantiate
from lingjing.mission.model import Mission
from lingjing.play.options import PlayOptions
from lingjing.play.parallel import EpisodeProcesses
from lingjing.plugins.host import PluginHost
from lingjing.trace.reader import Trace
from lingjing.whole_files import written_whole

_SAME = ("mission", "mode", "settings", "clock", "budget", "agents", "messages", "rules", "stages", "success")
"""Fields by which an instance is compared with its mission."""


class ShrinkOptions(msgspec.Struct, frozen=True, kw_only=True):
    """Options of the search."""

    mission: str = ""
    """The file or shipped name of the trace's mission; empty: its own name."""
    policies: tuple[str, ...] = ()
    """Policy files that the trace names without a folder."""
    sameness: Sameness = "family"
    """The compared parts of failures."""
    predicate: Predicate | None = None
    """A user's function that compares failures, in place of `sameness`; None: not set."""
    control: str = "oracle"
    """The policy that must win; empty: none."""
    episodes: int = 200
    """The greatest number of episodes."""
    jobs: int = 1
    """Episodes played in parallel."""


class ShrunkMission(msgspec.Struct, frozen=True, kw_only=True):
    """The result of the search."""

    path: str
    """The mission file."""
    failure: str
    """The failure in one line."""
    removed: tuple[str, ...]
    """Removed parts."""
    kept: tuple[str, ...]
    """Remaining parts."""
    ticks_before: int
    """The budget of the trace, ticks."""
    ticks: int
    """The budget of the result, ticks."""
    minimal: bool
    """True if nothing more can be removed; else the episodes were used up."""
    episodes: int
    """The number of played episodes."""
    digest: str
    """The digest of the episode, played from the written file."""
    control: str
    """The policy that wins the result; empty: none was set, or it did not win the complete mission."""
    options: PlayOptions
    """The options that play the episode."""
    notes: tuple[str, ...] = ()
    """Remarks for the user."""


def shrink(
    trace: Trace, out: Path, options: ShrinkOptions | None = None, tell: Callable[[str], None] = lambda line: None
) -> ShrunkMission:
    """Shrink the mission of a failed trace and write it to `out`, a new file or one of an interrupted search.

    `tell` receives a line for each step. Raises `UsageError` for a trace that was won or cut, a missing mission or
    policy, and a failure that does not occur again; `InfrastructureError` if an episode cannot be played.
    """
    options = options or ShrinkOptions()
    signature = failure_of(trace)
    if signature is None:
        raise UsageError(f"{trace.path} was won: there is no failure to keep")
    if options.predicate is not None and not options.predicate(trace):
        raise UsageError(f"{trace.path} does not show the failure of --same-if")
    log = out.with_name(f"{out.name}.tried.jsonl")
    if out.exists() and not log.exists():
        raise UsageError(f"`{out}` already exists", hint="nothing is overwritten: name a new file with -o")
    mission = _mission_of(trace, options.mission)
    policies = _policies(trace, options.policies)
    append(log)  # reports a folder that cannot be written before anything is played
    with TemporaryDirectory(prefix="lingjing-shrink-") as folder, EpisodeProcesses() as processes:
        player = CandidatePlayer(
            trace=trace, signature=signature, sameness=options.sameness, options=_play_options(trace),
            policies=policies, folder=Path(folder), log=log, processes=processes, budget=options.episodes,
            jobs=options.jobs, control=options.control, predicate=options.predicate,
        )  # fmt: skip
        return _Shrinking(trace, mission, player, signature, out, tell).run()


@dataclass
class _Best:
    """The smallest failing mission so far."""

    parts: tuple[RemovablePart, ...]
    ticks: int
    candidate: Candidate


class _Shrinking:
    """One search for a smaller mission that fails alike."""

    def __init__(
        self, trace: Trace, mission: Mission, player: CandidatePlayer, signature: FailureSignature, out: Path,
        tell: Callable[[str], None],
    ) -> None:  # fmt: skip
        self._trace, self._player, self._signature, self._out, self._tell = trace, player, signature, out, tell
        self._whole = ReducibleMission(mission, trace.header.instance)
        self._notes: list[str] = []
        self._best = self._start()

    def run(self) -> ShrunkMission:
        """Search, write the result and verify it."""
        minimal = True
        try:
            self._parts()
            while self._ticks() or self._single_parts():
                pass
        except BudgetUsedUpError:
            minimal = False
        removed = [part for part in self._whole.parts if part not in self._best.parts]
        self._write(f"{self._heading(removed)}{self._best.candidate.text}")
        self._verify()
        if minimal:
            self._player.log.unlink(missing_ok=True)
        before = self._trace.header.instance
        return ShrunkMission(
            path=str(self._out), failure=self._signature.part(self._player.sameness).text,
            removed=tuple(map(str, removed)), kept=tuple(map(str, self._best.parts)),
            ticks_before=before.budget.ticks, ticks=self._best.ticks, minimal=minimal, episodes=self._player.played,
            digest=self._player.digest(self._best.candidate), control=self._player.control,
            options=self._player.options_for(self._best.candidate, str(self._out)), notes=tuple(self._notes),
        )  # fmt: skip

    def _start(self) -> _Best:
        """Return the complete mission, which must fail as the trace did. The control is dropped if it does not win
        it.
        """
        ticks = self._trace.header.instance.budget.ticks
        candidate = self._candidate(self._whole.parts, ticks)
        if candidate is None:
            raise UsageError(
                "the mission cannot be written as .ljs", hint="`lingjing compile --emit ljs` shows the reason"
            )
        verdict = self._player.verdict(candidate)
        if verdict == "hopeless":
            self._notes.append(
                f"`{self._player.control}` does not win the complete mission, so it is not required to win smaller ones"
            )
            self._player.control = ""
            verdict = self._player.verdict(candidate)
        if verdict != "fails":
            raise _not_reproduced(self._trace, self._player, verdict)
        self._tell(f"the complete mission fails alike: {len(self._whole.parts)} parts, {ticks} ticks")
        if self._player.digest(candidate) != self._digest:
            self._notes.append("the complete mission fails alike, but its digest is not the trace's")
        self._write(candidate.text)
        return _Best(self._whole.parts, ticks, candidate)

    def _candidate(self, parts: Iterable[RemovablePart], ticks: int) -> Candidate | None:
        return self._player.candidate(self._whole.keeping(parts, ticks))

    def _first(self, ways: Sequence[tuple[tuple[RemovablePart, ...], int]]) -> int | None:
        """Try several smaller missions in order; the first failing one becomes the best. Return its index, or None."""
        candidates = [self._candidate(parts, ticks) for parts, ticks in ways]
        failing = self._player.first_failing(candidates)
        if failing is not None:
            candidate = candidates[failing]
            assert candidate is not None
            self._best = _Best(*ways[failing], candidate)
            self._write(candidate.text)
            self._tell(
                f"{self._player.played} episodes: {len(self._best.parts)} of {len(self._whole.parts)} parts "
                f"and {self._best.ticks} ticks fail alike"
            )
        return failing

    def _parts(self) -> None:
        ticks = self._best.ticks
        minimize(self._best.parts, lambda ways: self._first([(way, ticks) for way in ways]))

    def _single_parts(self) -> bool:
        """Remove single parts; return whether one could be removed."""
        parts = self._best.parts
        ways = [(tuple(part for part in parts if part != left_out), self._best.ticks) for left_out in parts]
        return self._first(ways) is not None

    def _ticks(self) -> bool:
        """Lower the budget of ticks by bisection; return whether it was lowered."""
        begun, low = self._best.ticks, 0
        while self._best.ticks - low > 1:
            middle = (self._best.ticks + low) // 2
            if self._first([(self._best.parts, middle)]) is None:
                low = middle
        return self._best.ticks < begun

    def _heading(self, removed: Sequence[RemovablePart]) -> str:
        """Return comments for the file about its origin."""
        header = self._trace.header
        failure = self._signature.part(self._player.sameness).text
        policies = dict.fromkeys(binding.policy for binding in header.bindings)
        played = f"{header.instance.mission}, seed {header.instance.seed}, played by {', '.join(policies)}"
        lines = [
            f"Shrunk from the trace {self._digest[:16]} of {played}.",
            f"It fails by: {failure}",
            f"Removed: {', '.join(map(str, removed)) or 'nothing'}",
        ]
        return "".join(f"# {' '.join(line.split())}\n" for line in lines)

    @property
    def _digest(self) -> str:
        return self._trace.boundaries[-1].digest

    def _write(self, text: str) -> None:
        try:
            with written_whole(self._out) as partial:
                partial.write_text(text, encoding="utf-8")
        except OSError as error:
            raise UsageError(f"cannot write `{self._out}`: {error.strerror}", hint="choose another with -o") from error

    def _verify(self) -> None:
        """Play the written file again; raise `InfrastructureError` unless the episode is the same."""
        again = Candidate(self._out.read_text(encoding="utf-8"), self._best.candidate.agents)
        expected = self._player.digest(self._best.candidate)
        if self._player.replayed(again) != "fails" or self._player.digest(again) != expected:
            raise InfrastructureError(
                f"`{self._out}` does not fail alike when it is played again",
                hint="shrink needs deterministic policies",
            )


def _not_reproduced(trace: Trace, player: CandidatePlayer, verdict: CandidateVerdict) -> UsageError:
    """Return the error of a complete mission that does not fail as the trace did."""
    outcome = {
        "won": "is won when it is played again",
        "other": "fails differently when it is played again",
        "aborted": "is cut short when it is played again",
        "no mission": "is not an episode of this mission",
        "hopeless": "provably cannot be won",
        "fails": "",
    }[verdict]
    hint = "shrink needs deterministic policies, and the settings of engines that the trace was played with"
    if verdict == "hopeless":
        hint = "the policies did not cause this failure; `lingjing validate` shows the proof"
    return UsageError(f"the episode of {trace.path} {outcome}", hint=hint)


def _mission_of(trace: Trace, named: str) -> Mission:
    """Return the mission, which must be that of the trace. Raises `UsageError`."""
    instance = trace.header.instance
    try:
        mission = load_mission(named or instance.mission)
    except UsageError as error:
        if named:
            raise
        hint = "name its file with --mission FILE; a trace does not hold the mission's text"
        raise UsageError(f"the mission `{instance.mission}` of {trace.path} is not shipped", hint=hint) from error
    differing = _first_difference(mission, instance)
    if differing:
        raise UsageError(
            f"`{named or instance.mission}` is not the mission that {trace.path} was played with: {differing} differ",
            hint="name the file it was played with: --mission FILE",
        )
    return mission


def _first_difference(mission: Mission, instance: Instance) -> str:
    if mission.name != instance.mission:
        return "their names"
    try:
        again = instantiate(mission, seed=instance.seed, mode=instance.mode, settings=instance.settings)
    except UsageError:
        return "its modes or parameters"
    if [(entity.id, entity.type) for entity in again.entities] != [
        (entity.id, entity.type) for entity in instance.entities
    ]:
        return "its entities"
    return next((f"its {name}" for name in _SAME if getattr(again, name) != getattr(instance, name)), "")


def _play_options(trace: Trace) -> PlayOptions:
    """Return the options of the trace, without mission and policies."""
    header = trace.header
    engine_args: dict[str, GivenOption] = {
        f"{engine}.{name}": value
        for engine, options in header.instance.engine_options.items()
        for name, value in options.items()
    }
    evaluator_args: dict[str, GivenOption] = {
        f"{evaluator}.{name}": value
        for evaluator, options in header.evaluator_options.items()
        for name, value in options.items()
    }
    policy_args = {name: value for binding in header.bindings for name, value in binding.arguments.items()}
    return PlayOptions(
        mission="", mode=header.instance.mode, seed=header.instance.seed, policy_seed=header.policy_seed,
        policy_args=policy_args, engine_args=engine_args, evaluator_args=evaluator_args, evaluators=header.evaluators,
        overview=False,
    )  # fmt: skip


def _policies(trace: Trace, files: Sequence[str]) -> dict[str, str]:
    """Return the policy of each agent in the form of `PlayOptions`. Raises `UsageError` for a missing file, and for
    policies that call chat models.
    """
    host, policies = PluginHost(), {}
    for binding in trace.header.bindings:
        name, _, cls = binding.policy.partition(":")
        if name.endswith(".py"):
            path = next((file for file in (*files, name) if Path(file).name == name and Path(file).is_file()), None)
            if path is None:
                hint = f"name its file: --policy-file FOLDER/{name}"
                raise UsageError(f"the trace was played by `{binding.policy}`, and this file was not found", hint=hint)
            policies[binding.agent] = f"{Path(path).resolve()}:{cls}"
        elif host.policy(binding.policy).calls:
            raise UsageError(
                f"`{binding.policy}` calls chat models, whose answers to smaller missions are not recorded",
                hint="shrink episodes of deterministic policies",
            )
        else:
            policies[binding.agent] = binding.policy
    return policies
