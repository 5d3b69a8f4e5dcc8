"""`CheckRunner`: runs checks and yields a result for each.

Episodes run as those of suites do: in processes of their own, several at a time. The trace of each is removed after its
report. An aborted episode is tried again, `TRIES` times in all. A check ends as soon as its result is certain; its
running episodes are then ended. Checks of one command share episodes with equal options.
"""

from __future__ import annotations

import shlex
import tempfile
import time
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import Literal, Self

import msgspec

from lingjing.authoring.checks import MissionCheck, policy_beside
from lingjing.authoring.coverage import cover
from lingjing.authoring.impossible import Refusal, refusals
from lingjing.authoring.shares import ShareDecision
from lingjing.bench.running import TRIES, remove_run
from lingjing.errors import InfrastructureError, LingjingError, MissionError, PluginError, hint_of
from lingjing.mission import expression as ex
from lingjing.mission import model
from lingjing.mission.evaluate import Scope, number
from lingjing.mission.instantiate import choose_settings, instantiate
from lingjing.mission.tiers import setting_value
from lingjing.play.options import PlayOptions
from lingjing.play.parallel import EpisodeProcesses, EpisodeTask
from lingjing.play.policy_files import is_file
from lingjing.play.report import ABORTED, INTERRUPTED, POLICY_FAILED, EpisodeReport
from lingjing.plugins.host import PluginHost

SHOWN = 3
"""Episodes and settings that the text of a failed check lists (chosen)."""


class CheckResult(msgspec.Struct, frozen=True, kw_only=True):
    """The result of one check."""

    check: MissionCheck
    state: Literal["passed", "failed", "error", "aborted"]
    """`error`: it cannot be evaluated. `aborted`: the infrastructure failed."""
    summary: str
    """The reason for the state, in one line."""
    details: tuple[str, ...] = ()
    """Further lines: what happened, and the commands that show it."""
    episodes: int = 0
    """Episodes that were played or shared."""
    wall_s: float = 0.0
    """Seconds of wall clock."""


class CheckRunner:
    """Runs checks; a context manager. A mission's file must not change while the runner is open: episodes are known by
    its path."""

    def __init__(self, jobs: int = 1) -> None:
        self.on_episode: Callable[[int, int], None] = lambda done, due: None
        """Receives the numbers of ended and of due episodes of the check."""
        self._jobs = jobs
        self._host = PluginHost()
        self._processes = EpisodeProcesses()
        self._folder = tempfile.TemporaryDirectory(prefix="lingjing-test-")
        self._known: dict[bytes, EpisodeReport] = {}
        self._number = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._processes.close()
        self._folder.cleanup()

    def run(self, check: MissionCheck) -> CheckResult:
        """Run one check. Raises `KeyboardInterrupt` at an interrupt, after its episodes have ended."""
        begun = time.monotonic()
        try:
            result = self._run(check)
        except LingjingError as error:
            is_broken = isinstance(error, PluginError | InfrastructureError)
            hint = hint_of(error)
            result = CheckResult(
                check=check,
                state="aborted" if is_broken else "error",
                summary=str(error),
                details=(f"hint: {hint}",) if hint else (),
            )
        return msgspec.structs.replace(result, wall_s=time.monotonic() - begun)

    @property
    def folder(self) -> Path:
        """A folder for files of this run, which is removed at its end."""
        return Path(self._folder.name)

    # -- private

    def _run(self, check: MissionCheck) -> CheckResult:
        match check.expectation:
            case model.PolicyExpectation():
                return self._play(check, check.expectation)
            case model.InfeasibleExpectation():
                return _prove(check, check.expectation)
            case model.SpreadExpectation():
                return _measure(check, check.expectation)

    def _play(self, check: MissionCheck, expectation: model.PolicyExpectation) -> CheckResult:
        if not is_file(expectation.policy):
            self._host.policy(expectation.policy)  # raises `UsageError` for an unknown one
        options = _options(check, expectation)
        due_ticks = _due_ticks(check.mission, expectation, options)
        decision = ShareDecision(expectation)
        played: list[EpisodeReport] = []
        whole = len(expectation.episodes.seeds)
        with closing(self._reports(options, expectation.episodes.seeds)) as reports:
            for report in reports:
                if report.reason in (ABORTED, POLICY_FAILED):
                    return _cut_short(check, expectation, report, len(played))
                played.append(report)
                decision.add(_meets(report, expectation, due_ticks))
                self.on_episode(len(played), whole)
                if decision.verdict != "open":
                    break
        return _decided(check, expectation, decision, played, due_ticks)

    def _reports(self, options: PlayOptions, seeds: Sequence[int]) -> Generator[EpisodeReport]:
        """The reports of the seeds in their order. An aborted episode is played again."""
        ended: dict[int, EpisodeReport] = {}
        due = list(seeds)
        missing = [seed for seed in due if self._key(options, seed) not in self._known]
        for tries in range(1, TRIES + 1):
            again: list[int] = []
            yield from self._ready(options, due, ended)
            with closing(self._processes.play(self._tasks(options, missing), self._jobs)) as played:
                for task, report in played:
                    remove_run(task.folder)
                    if report.reason == INTERRUPTED:
                        raise KeyboardInterrupt
                    if report.reason == ABORTED and tries < TRIES:
                        again.append(task.options.seed)
                        continue
                    ended[task.options.seed] = report
                    yield from self._ready(options, due, ended)
            missing = again
            if not missing:
                return

    def _ready(
        self, options: PlayOptions, due: list[int], ended: Mapping[int, EpisodeReport]
    ) -> Iterator[EpisodeReport]:
        """Yield the reports at the beginning of the seeds that are due, and remove these seeds."""
        while due:
            key = self._key(options, due[0])
            report = self._known.get(key) or ended.get(due[0])
            if report is None:
                return
            if report.reason != ABORTED:
                self._known[key] = report
            due.pop(0)
            yield report

    def _tasks(self, options: PlayOptions, seeds: Sequence[int]) -> Iterator[EpisodeTask]:
        for seed in seeds:
            self._number += 1
            folder = self.folder / f"episode-{self._number}"
            played = msgspec.structs.replace(options, seed=seed)
            yield EpisodeTask(played, folder, repeated=False, reports_failure=True)

    def _key(self, options: PlayOptions, seed: int) -> bytes:
        return msgspec.json.encode(msgspec.structs.replace(options, seed=seed), order="deterministic")


# -- episodes


def _options(check: MissionCheck, expectation: model.PolicyExpectation) -> PlayOptions:
    mission, episodes = check.mission, expectation.episodes
    mode = episodes.mode or mission.modes.default
    return PlayOptions(
        mission=str(check.path),
        policy=policy_beside(expectation.policy, check.path),
        mode=mode,
        settings=_settings(mission, episodes),
        tier=episodes.tier,
        overview=False,
        calls="live",
    )


def _settings(mission: model.Mission, episodes: model.ExpectedEpisodes) -> dict[str, float]:
    """The settings of an expectation, SI values."""
    scope = Scope(parameters={}, mode=episodes.mode or mission.modes.default)
    return {setting.name: setting_value(setting, scope) for setting in episodes.settings}


def _due_ticks(mission: model.Mission, expectation: model.PolicyExpectation, options: PlayOptions) -> float | None:
    """The bound of the expectation in ticks; None without one."""
    within = expectation.within
    if within is None:
        return None
    mode, values = choose_settings(mission, options.mode, options.settings)
    value = number(within, Scope(parameters=values, mode=mode))
    if isinstance(within, ex.Number) and within.unit in _TICKS:
        return value
    return value / instantiate(mission, mode=mode, settings=options.settings).clock.tick_s


def _meets(report: EpisodeReport, expectation: model.PolicyExpectation, due_ticks: float | None) -> bool:
    in_time = due_ticks is None or report.ticks <= due_ticks
    return in_time and report.success == (expectation.outcome == "wins")


def _decided(
    check: MissionCheck,
    expectation: model.PolicyExpectation,
    decision: ShareDecision,
    played: Sequence[EpisodeReport],
    due_ticks: float | None,
) -> CheckResult:
    word = "won" if expectation.outcome == "wins" else "lost"
    due = "" if due_ticks is None else f" within {due_ticks:g} ticks"
    whole = len(expectation.episodes.seeds)
    left = whole - len(played)
    summary = f"{decision.met} of {len(played)} episodes were {word}{due}" + (f"; {left} not needed" if left else "")
    passed = decision.verdict == "passed"
    wanted = expectation.share == "none"
    wrong = [report for report in played if _meets(report, expectation, due_ticks) == wanted]
    details = [] if passed else [line for report in wrong[:SHOWN] for line in _shown(check, expectation, report)]
    if not passed and len(wrong) > SHOWN:
        details.append(f"and {len(wrong) - SHOWN} more")
    return CheckResult(
        check=check,
        state="passed" if passed else "failed",
        summary=summary,
        details=tuple(details),
        episodes=len(played),
    )


def _cut_short(
    check: MissionCheck, expectation: model.PolicyExpectation, report: EpisodeReport, before: int
) -> CheckResult:
    """The result of a check with an episode that has no result."""
    what = "was aborted" if report.reason == ABORTED else "did not begin"
    hint = (f"hint: {report.hint}",) if report.hint else ()
    return CheckResult(
        check=check,
        state="aborted",
        summary=f"seed {report.seed} {what}: {report.detail}",
        details=(*hint, f"try it: {watch_command(check, expectation, report.seed)}"),
        episodes=before,
    )


def _shown(check: MissionCheck, expectation: model.PolicyExpectation, report: EpisodeReport) -> Iterator[str]:
    end = "won" if report.success else f"lost ({report.reason}{f': {report.detail}' if report.detail else ''})"
    family = f", failure family {report.family}" if report.family else ""
    yield f"seed {report.seed}: {end} at tick {report.ticks}, SCR {report.scr:.2f}{family}"
    yield f"  watch it: {watch_command(check, expectation, report.seed)}"


def watch_command(check: MissionCheck, expectation: model.PolicyExpectation, seed: int) -> str:
    """The command that plays one episode of an expectation."""
    options = _options(check, expectation)
    words = ["lingjing", "run", check.file, "--seed", str(seed), "--policy", options.policy]
    words += ["--mode", options.mode] if options.mode and options.mode != check.mission.modes.default else []
    words += [word for name, value in options.settings.items() for word in ("--set", f"{name}={value:g}")]
    return shlex.join([*words, "--watch"])


# -- checks without episodes


def _prove(check: MissionCheck, expectation: model.InfeasibleExpectation) -> CheckResult:
    tried = refusals(check.mission, expectation.condition)
    if not tried:
        hint = (
            "name values that the params can have; those near their bounds and near the condition's numbers are tried"
        )
        raise MissionError("the condition holds for none of the settings that were tried", hint=hint)
    open_settings = [each for each in tried if not each.reason]
    if open_settings:
        summary = f"{len(open_settings)} of {len(tried)} such settings are not proved to be infeasible"
        details = tuple(_run_with(check, each) for each in open_settings[:SHOWN])
        return CheckResult(check=check, state="failed", summary=summary, details=details)
    proved = next((each for each in tried if not each.bounds), tried[0])
    summary = f"{len(tried)} such settings are refused, for example: {proved.reason}"
    return CheckResult(check=check, state="passed", summary=summary)


def _run_with(check: MissionCheck, tried: Refusal) -> str:
    words = ["lingjing", "run", check.file, "--mode", tried.mode]
    words += [word for name, value in tried.settings.items() for word in ("--set", f"{name}={value:g}")]
    return f"it may be won: {shlex.join([*words, '--policy', 'oracle'])}"


def _measure(check: MissionCheck, expectation: model.SpreadExpectation) -> CheckResult:
    measured = cover(check.mission, expectation, _settings(check.mission, expectation.episodes))
    if measured.spreads:
        return CheckResult(check=check, state="passed", summary=str(measured))
    command = shlex.join(["lingjing", "scene", "draw", check.file, "--seed", str(expectation.episodes.first_seed)])
    return CheckResult(check=check, state="failed", summary=str(measured), details=(f"look at one: {command}",))


_TICKS = ("tick", "ticks")
"""Units of a bound that counts ticks."""

__all__ = ["CheckResult", "CheckRunner", "watch_command"]
