"""`shrink`: the smallest mission that still fails as a trace did, by delta debugging.

From a trace: its failure (`failure`), its mission with everything drawn made fast (`reduced_mission`), what is left out
of it part by part (`delta_debugging`) as long as it fails the same way when it is played (`candidates`). First parts,
then ticks, then each part once more, until nothing can be left out any more. The best so far is written whenever it
gets smaller.
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
from lingjing.plugins.host import PluginHost
from lingjing.trace.reader import Trace
from lingjing.whole_files import written_whole

_SAME = ("mission", "mode", "settings", "clock", "budget", "agents", "messages", "rules", "stages", "success")
"""Fields by which an instance shows which mission it is of."""


class ShrinkOptions(msgspec.Struct, frozen=True, kw_only=True):
    """`mission` is the file or shipped name of the trace's mission ("": by its name), `policies` files of policies that
    the trace names without their folder; `sameness` and `predicate` say which failures are the same; `control` is the
    policy that must win ("": none is asked); `episodes` are played at most, `jobs` at a time."""

    mission: str = ""
    policies: tuple[str, ...] = ()
    sameness: Sameness = "family"
    predicate: Predicate | None = None
    control: str = "oracle"
    episodes: int = 200
    jobs: int = 1


class ShrunkMission(msgspec.Struct, frozen=True, kw_only=True):
    """What is left. `minimal`: nothing more can be left out; else the episodes were used up. `options` plays it and
    `digest` is that of the episode, which the command has played from the written file; `control` is the policy that
    wins it, "" if none was asked or none won the whole mission."""

    path: str
    failure: str
    removed: tuple[str, ...]
    kept: tuple[str, ...]
    ticks_before: int
    ticks: int
    minimal: bool
    episodes: int
    digest: str
    control: str
    options: PlayOptions
    notes: tuple[str, ...] = ()


def shrink(
    trace: Trace, out: Path, options: ShrinkOptions | None = None, tell: Callable[[str], None] = lambda line: None
) -> ShrunkMission:
    """Shrink the mission of a failed trace and write it to `out`, which must be new or one that was begun before.

    `tell` is told each step. Raises `UsageError` for a trace that was won or cut, a mission or a policy that is not to
    be had, and a failure that does not come again; `InfrastructureError` if an episode cannot be played.
    """
    options = options or ShrinkOptions()
    signature = failure_of(trace)
    if signature is None:
        raise UsageError(f"{trace.path} was won: there is no failure to keep")
    if options.predicate is not None and not options.predicate(trace):
        raise UsageError(f"{trace.path} does not show the failure that was asked for")
    log = out.with_name(f"{out.name}.tried.jsonl")
    if out.exists() and not log.exists():
        raise UsageError(f"`{out}` is there already", hint="nothing is overwritten: name a new file with -o")
    mission = _mission_of(trace, options.mission)
    policies = _policies(trace, options.policies)
    append(log)  # what cannot be written is told before anything is played
    with TemporaryDirectory(prefix="lingjing-shrink-") as folder:
        player = CandidatePlayer(
            trace=trace, signature=signature, sameness=options.sameness, options=_play_options(trace),
            policies=policies, folder=Path(folder), log=log, budget=options.episodes,
            jobs=options.jobs, control=options.control, predicate=options.predicate,
        )  # fmt: skip
        return _Shrinking(trace, mission, player, signature, out, tell).run()


@dataclass
class _Best:
    """The smallest that was found so far."""

    parts: tuple[RemovablePart, ...]
    ticks: int
    candidate: Candidate


class _Shrinking:
    """One search."""

    def __init__(
        self, trace: Trace, mission: Mission, player: CandidatePlayer, signature: FailureSignature, out: Path,
        tell: Callable[[str], None],
    ) -> None:  # fmt: skip
        self._trace, self._player, self._signature, self._out, self._tell = trace, player, signature, out, tell
        self._whole = ReducibleMission(mission, trace.header.instance)
        self._notes: list[str] = []
        self._best = self._start()

    def run(self) -> ShrunkMission:
        """Search, and verify what was written."""
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
        """The whole mission, which must fail as the trace did; without a control if that does not win it."""
        ticks = self._trace.header.instance.budget.ticks
        candidate = self._candidate(self._whole.parts, ticks)
        if candidate is None:
            raise UsageError("the mission cannot be written as .ljs", hint="`lingjing compile --emit ljs` says why")
        verdict = self._player.verdict(candidate)
        if verdict == "hopeless":
            self._notes.append(f"`{self._player.control}` does not win the whole mission, so nothing asks it of parts")
            self._player.control = ""
            verdict = self._player.verdict(candidate)
        if verdict != "fails":
            raise _not_again(self._trace, self._player, verdict)
        self._tell(f"the whole mission fails the same way: {len(self._whole.parts)} parts, {ticks} ticks")
        if self._player.digest(candidate) != self._digest:
            self._notes.append("the whole mission fails the same way, but is not the trace's episode tick for tick")
        self._write(candidate.text)
        return _Best(self._whole.parts, ticks, candidate)

    def _candidate(self, parts: Iterable[RemovablePart], ticks: int) -> Candidate | None:
        return self._player.candidate(self._whole.keeping(parts, ticks))

    def _first(self, ways: Sequence[tuple[tuple[RemovablePart, ...], int]]) -> int | None:
        """The first of several smaller missions that fails; it is the best from then on."""
        candidates = [self._candidate(parts, ticks) for parts, ticks in ways]
        found = self._player.first_failing(candidates)
        if found is not None:
            candidate = candidates[found]
            assert candidate is not None
            self._best = _Best(*ways[found], candidate)
            self._write(candidate.text)
            self._tell(
                f"{self._player.played} episodes: {len(self._best.parts)} of {len(self._whole.parts)} parts "
                f"and {self._best.ticks} ticks fail the same way"
            )
        return found

    def _parts(self) -> None:
        ticks = self._best.ticks
        minimize(self._best.parts, lambda ways: self._first([(way, ticks) for way in ways]))

    def _single_parts(self) -> bool:
        """Leave out each part that can be left out; whether one could."""
        parts = self._best.parts
        ways = [(tuple(one for one in parts if one != left_out), self._best.ticks) for left_out in parts]
        return self._first(ways) is not None

    def _ticks(self) -> bool:
        """Lower the ticks, in halves and then one by one; whether it could be done."""
        begun, low = self._best.ticks, 0
        while self._best.ticks - low > 1:
            middle = (self._best.ticks + low) // 2
            if self._first([(self._best.parts, middle)]) is None:
                low = middle
        return self._best.ticks < begun

    def _heading(self, removed: Sequence[RemovablePart]) -> str:
        """Comments that say where the mission comes from."""
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
        """Play the written file once more, and be sure that it is the same episode."""
        again = Candidate(self._out.read_text(encoding="utf-8"), self._best.candidate.agents)
        expected = self._player.digest(self._best.candidate)
        if self._player.replayed(again) != "fails" or self._player.digest(again) != expected:
            raise InfrastructureError(
                f"`{self._out}` does not fail the same way when it is played again",
                hint="a policy whose answers are not the same each time cannot be shrunk",
            )


def _not_again(trace: Trace, player: CandidatePlayer, verdict: CandidateVerdict) -> UsageError:
    """Why the failure of the whole mission does not come again."""
    said = {
        "won": "is won when it is played again",
        "other": "fails in another way when it is played again",
        "aborted": "is cut short when it is played again",
        "no mission": "is not the mission that the trace holds",
        "hopeless": "cannot be won by anybody, as a proof says",
        "fails": "",
    }[verdict]
    hint = "a policy whose answers are not the same each time cannot be shrunk; settings of engines count too"
    if verdict == "hopeless":
        hint = "there is no failure of the policies to be made smaller; `lingjing validate` says what is in the way"
    return UsageError(f"the episode of {trace.path} {said}", hint=hint)


def _mission_of(trace: Trace, given: str) -> Mission:
    """The mission, which must be the one that the trace was played with."""
    instance = trace.header.instance
    try:
        mission = load_mission(given or instance.mission)
    except UsageError as error:
        if given:
            raise
        hint = "name its file with --mission FILE; a trace holds the instance, and not the text"
        raise UsageError(f"the mission `{instance.mission}` of {trace.path} is not shipped", hint=hint) from error
    other = _first_difference(mission, instance)
    if other:
        raise UsageError(
            f"`{given or instance.mission}` is not the mission that {trace.path} was played with: {other} differ",
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
    if [(one.id, one.type) for one in again.entities] != [(one.id, one.type) for one in instance.entities]:
        return "its entities"
    return next((f"its {name}" for name in _SAME if getattr(again, name) != getattr(instance, name)), "")


def _play_options(trace: Trace) -> PlayOptions:
    """How the trace was played, without mission and policies."""
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
    """Who plays each agent, as `PlayOptions` names it. Raises `UsageError` for a file that was not given, and for
    policies that ask chat models."""
    host, found = PluginHost(), {}
    for binding in trace.header.bindings:
        name, _, cls = binding.policy.partition(":")
        if name.endswith(".py"):
            path = next((one for one in (*files, name) if Path(one).name == name and Path(one).is_file()), None)
            if path is None:
                hint = f"say where it is: --policy-file FOLDER/{name}"
                raise UsageError(
                    f"the trace was played by `{binding.policy}`, and there is no such file here", hint=hint
                )
            found[binding.agent] = f"{Path(path).resolve()}:{cls}"
        elif host.policy(binding.policy).calls:
            raise UsageError(
                f"`{binding.policy}` asks chat models, whose answers to smaller missions nobody has recorded",
                hint="shrink episodes of policies that answer the same each time",
            )
        else:
            found[binding.agent] = binding.policy
    return found
