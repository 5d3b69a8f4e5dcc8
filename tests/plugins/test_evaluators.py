"""Evaluators of plug-ins: their inputs and options, several evaluators at once, and an installed evaluator."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest

from lingjing import Session, builtin
from lingjing import read as read_trace
from lingjing import run as lingjing_run
from lingjing.errors import PluginError, UsageError
from lingjing.kernel.adjudication import Adjudicator
from lingjing.plugins.evaluator import EpisodeState, Evaluation, EvaluatorPlugin
from lingjing.plugins.hookspecs import hookimpl
from lingjing.plugins.options import Field, PluginOptions
from lingjing.testing import PluginHost
from tools.python_forks import run_python

MISSION = """\
ljs 1
use std.air { quadrotor }

mission hover "Hover" {
  goal    "Take off."
  scene   bay
  clock   { tick = 5 s, sync = 500 ms }
  budget  { ticks <= 4, policy <= 20 s, engine <= 60 s, capture <= 60 s }
  mode    single
  asset uav : quadrotor { position = (0 m, -700 m, 20 m), band = 10 m..60 m, actions { takeoff, stop } }
  agent pilot as flyer controls uav { observes uav.* }
  adjudicate aloft() { when uav.status == "dead" }
  success when aloft()
}
"""

PLUGIN = '''
"""An evaluator that ends the episode as a success at the second boundary."""

from lingjing.plugins.evaluator import Evaluation, EvaluatorPlugin
from lingjing.plugins.hookspecs import hookimpl


class Patience:
    def __init__(self, instance):
        self.uav = instance.entities[0].id

    def evaluate(self, state, events):
        assert self.uav in state.states and not state.achieved and not events
        done = state.tick >= 2
        return Evaluation(state.tick / 2, done, "success" if done else "", "patience paid")


@hookimpl
def lingjing_evaluators():
    yield EvaluatorPlugin(name="patience", build=Patience, summary="Waits for two ticks.")
'''


@pytest.fixture
def mission(tmp_path: Path) -> Path:
    file = tmp_path / "hover.ljs"
    file.write_text(MISSION)
    return file


@pytest.fixture
def installed(tmp_path: Path) -> dict[str, str]:
    """The environment of a process in which the plug-in is a distribution with an entry point."""
    site = tmp_path / "site"
    (site / "patience-1.0.dist-info").mkdir(parents=True)
    (site / "patience_plugin.py").write_text(PLUGIN)
    (site / "patience-1.0.dist-info" / "METADATA").write_text("Metadata-Version: 2.1\nName: patience\nVersion: 1.0\n")
    (site / "patience-1.0.dist-info" / "entry_points.txt").write_text("[lingjing]\npatience = patience_plugin\n")
    return {**os.environ, "PYTHONPATH": str(site)}


def lingjing(environment: dict[str, str], *arguments: object) -> str:
    command = [sys.executable, "-m", "lingjing.cli.main", *map(str, arguments)]
    return run_python(command, env=environment, check=True).stdout


def test_an_installed_evaluator_is_listed_and_scores_episodes(
    installed: dict[str, str], mission: Path, tmp_path: Path
) -> None:
    listed = json.loads(lingjing(installed, "plugins", "--output-format", "json"))
    offered = [(offer["name"], offer["source"]) for offer in listed if offer["kind"] == "evaluator"]
    assert offered == [("mission", "builtin"), ("patience", "patience")]
    run = ("run", mission, "--policy", "random", "--no-overview", "--json", "--world", "inline")
    report = json.loads(lingjing(installed, *run, "--evaluator", "patience", "-o", tmp_path / "a"))
    assert (report["success"], report["ticks"], report["score"]) == (True, 2, 1.0)
    assert read_trace(report["trace"]).header.evaluators == ("patience",)
    both = ("--evaluator", "mission", "--evaluator", "patience", "--seeds", "0-1", "-j", "2")
    several = json.loads(lingjing(installed, *run, *both, "-o", tmp_path / "b"))
    assert [(episode["ticks"], episode["score"]) for episode in several["episodes"]] == [(2, 0.5), (2, 0.5)]


class _Constant:
    @staticmethod
    @hookimpl
    def lingjing_evaluators() -> list[EvaluatorPlugin]:
        return [EvaluatorPlugin(name="constant", build=lambda instance: _Half())]


class _Half:
    def evaluate(self, state: EpisodeState, events: object) -> Evaluation:
        return Evaluation(0.5, state.tick == 1)


def test_an_episode_that_an_evaluator_ends_without_a_reason_is_no_success(mission: Path, tmp_path: Path) -> None:
    with Session(PluginHost(extra=(_Constant,))) as session:
        options = {"policy": "random", "evaluators": ["constant"], "world": "inline", "overview": False}
        report = session.run(mission, out=tmp_path / "run", **options)
    assert (report.reason, report.ticks, report.score) == ("failure", 1, 0.5)


def test_an_unknown_evaluator_and_two_evaluators_of_one_name_are_errors(mission: Path, tmp_path: Path) -> None:
    with Session() as session, pytest.raises(UsageError, match="no evaluator is called `nobody`"):
        session.run(mission, evaluators=["nobody"], world="inline", out=tmp_path / "run")
    with pytest.raises(PluginError, match="`constant` is offered twice by lingjing_evaluators"):
        PluginHost(entry_points=False, extra=(builtin, _Constant, type("Other", (), vars(_Constant).copy())))


class WaitOptions(PluginOptions):
    ticks: int = Field(ge=1, le=9, description="how long it waits")
    scores: list[float] = [1.0]


class _Wait:
    @staticmethod
    @hookimpl
    def lingjing_evaluators() -> list[EvaluatorPlugin]:
        def build(instance: object, options: WaitOptions) -> object:
            def evaluate(state: EpisodeState, events: object) -> Evaluation:
                done = state.tick >= options.ticks
                return Evaluation(options.scores[-1], done, "success" if done else "")

            return SimpleNamespace(evaluate=evaluate)

        return [EvaluatorPlugin(name="wait", build=build, options=WaitOptions)]


def test_an_evaluator_receives_its_options(mission: Path, tmp_path: Path) -> None:
    arguments = {"wait.ticks": "2", "wait.scores": "[0.25, 0.75]"}
    options = {"policy": "random", "evaluators": ["wait"], "world": "inline", "overview": False}
    with Session(PluginHost(extra=(_Wait,))) as session:
        report = session.run(mission, out=tmp_path / "run", evaluator_args=arguments, **options)
    assert (report.reason, report.ticks, report.score) == ("success", 2, 0.75)
    assert read_trace(Path(report.trace)).header.evaluator_options == {"wait": {"ticks": "2", "scores": "[0.25, 0.75]"}}


def test_faults_in_the_options_of_evaluators_are_reported_by_name(mission: Path, tmp_path: Path) -> None:
    options = {"policy": "random", "world": "inline", "out": tmp_path / "run"}
    with Session(PluginHost(extra=(_Wait,))) as session:
        with pytest.raises(UsageError, match="evaluator `wait`: option `ticks` is missing"):
            session.run(mission, evaluators=["wait"], **options)
        with pytest.raises(UsageError) as caught:
            arguments = {"wait.ticks": "12", "wait.tick": 1, "mission.x": 1, "patience.x": 2, "wait.scores": [1, "x"]}
            session.run(mission, evaluators=["mission", "wait"], evaluator_args=arguments, **options)
    message = str(caught.value)
    for fault in (
        "evaluators: option `patience.x` names no evaluator that scores and one of its options",
        "evaluator `mission`: option `x` is not known",
        "evaluator `wait`: option `ticks` is '12', at most 9 is due",
        "evaluator `wait`: option `tick` is not known; did you mean `ticks`?",
        "evaluator `wait`: option `scores.1` is 'x', a number is due",
    ):
        assert fault in message
    assert len(message.splitlines()) == 5


def test_the_evaluator_of_the_mission_uses_the_adjudicator_of_the_kernel(
    mission: Path, tmp_path: Path, monkeypatch
) -> None:
    """The evaluator `mission` reads the context of the kernel's rules, and makes no adjudicator of its own."""
    made = []
    monkeypatch.setattr(Adjudicator, "__init__", _counting(Adjudicator.__init__, made))
    lingjing_run(mission, policy="random", world="inline", out=tmp_path / "run", overview=False)
    assert len(made) == 1


def _counting(init: Callable[..., None], made: list[object]) -> Callable[..., None]:
    def counted(self: object, *arguments: object) -> None:
        made.append(self)
        init(self, *arguments)

    return counted


def _host(build: object, name: object = "boom") -> PluginHost:
    """A host that also offers an evaluator of that name, by the plug-in `Wrong`."""
    offered = [EvaluatorPlugin(name=name, build=build)]  # type: ignore[arg-type]
    hook = staticmethod(hookimpl(lambda: offered, specname="lingjing_evaluators"))
    return PluginHost(extra=(type("Wrong", (), {"lingjing_evaluators": hook, "__name__": "Wrong"}),))


def _answering(answer: object) -> PluginHost:
    """A host with the evaluator `boom`. At tick 1 it returns `answer`, or raises it."""

    def evaluate(state: EpisodeState, events: object) -> object:
        if state.tick == 0:
            return Evaluation(0.25, False)
        if isinstance(answer, Exception):
            raise answer
        return answer

    return _host(lambda instance: SimpleNamespace(evaluate=evaluate))


def _raise(instance: object) -> object:
    raise KeyError("uav")


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (_raise, r"evaluator `boom` of plug-in `Wrong` cannot be built: KeyError: 'uav'"),
        (lambda instance: instance(), "evaluator `boom` of plug-in `Wrong` cannot be built: TypeError"),
        (lambda instance: None, "evaluator `boom` of plug-in `Wrong` built None, which has no method `evaluate`"),
    ],
)
def test_an_evaluator_that_cannot_be_built_is_named_before_the_episode(
    build: object, message: str, mission: Path, tmp_path: Path
) -> None:
    with Session(_host(build)) as session, pytest.raises(PluginError, match=message):
        session.run(mission, policy="random", evaluators=["boom"], world="inline", out=tmp_path / "run")
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("answer", "message"),
    [
        (RuntimeError("no sight"), "failed at tick 1: RuntimeError: no sight"),
        (None, "returned None at tick 1, no Evaluation"),
        ((0.5, False), "returned a value of type `tuple` at tick 1, no Evaluation"),
        (Evaluation(1.5, False), "its reward is 1.5, not a number in 0..1"),
        (Evaluation(-0.1, False), "its reward is -0.1, not a number in 0..1"),
        (Evaluation(float("nan"), False), "its reward is nan, not a number in 0..1"),
        (Evaluation("1", False), "its reward is '1', not a number in 0..1"),  # type: ignore[arg-type]
        (Evaluation(0.5, None), "its `done` is None"),  # type: ignore[arg-type]
        (Evaluation(0.5, True, "bored"), "its reason is 'bored'"),  # type: ignore[arg-type]
    ],
)
def test_a_wrong_result_aborts_the_episode_and_names_the_evaluator(
    answer: object, message: str, mission: Path, tmp_path: Path
) -> None:
    with Session(_answering(answer)) as session:
        options = {"policy": "random", "evaluators": ["boom"], "world": "inline", "overview": False}
        report = session.run(mission, out=tmp_path / "run", **options)
    assert (report.reason, report.ticks, report.score) == ("infrastructure-abort", 0, 0.25)
    assert report.detail.startswith("evaluator `boom` of plug-in `Wrong` ")
    assert message in report.detail


def test_naming_an_evaluator_twice_is_a_usage_error(mission: Path, tmp_path: Path) -> None:
    with Session() as session, pytest.raises(UsageError, match="evaluator `mission` is named twice"):
        session.run(mission, evaluators=["mission", "mission"], world="inline", out=tmp_path / "run")
