"""The conformance kit on evaluators: results must depend only on the arguments."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import pytest

from lingjing.errors import PluginError, UsageError
from lingjing.mission.instance import Instance
from lingjing.plugins import conformance as kit
from lingjing.plugins.evaluator import EpisodeState, Evaluation, EvaluatorPlugin
from lingjing.plugins.options import Field, PluginOptions
from lingjing.testing import compile_text, instantiate
from lingjing.trace.records import AdjudicatedEvent

MISSION = """\
ljs 2
use std.air { quadrotor }
mission two "Two" {
  goal "Fly."
  scene bay { datum = sea level at -3.5 m }
  clock { tick = 10 s, sync = 500 ms }
  budget { ticks <= 5 }
  asset uav : quadrotor { position = (0 m, -700 m, 20 m), band = 10 m..60 m, actions { takeoff, stop } }
  agent pilot as flyer controls uav { observes uav.* }
  adjudicate aloft() { when uav.position.z >= 59 m }
  adjudicate east() { when uav.position.x >= 59 m }
  stage rise { done when aloft() }
  success when aloft()
}
"""


@pytest.fixture(scope="module")
def instance() -> Instance:
    mission = compile_text(MISSION).mission
    assert mission is not None
    return instantiate(mission)


class Share(PluginOptions):
    reward: float = Field(0.5, ge=0.0, le=1.0)


def evaluator(evaluate: Callable[[EpisodeState, object], object], **declared: object) -> EvaluatorPlugin:
    """An evaluator with this function as its `evaluate`."""
    made = type("Made", (), {"evaluate": staticmethod(evaluate)})
    return EvaluatorPlugin(name="made", build=lambda instance, *options: made(), **declared)  # type: ignore[arg-type]


def test_an_evaluator_that_keeps_its_contract_passes(instance: Instance) -> None:
    kit.check_evaluator(evaluator(lambda state, events: Evaluation(0.5, state.tick == 2)), instance)
    rewards: list[float] = []

    def build_share(instance: Instance, options: Share) -> object:
        rewards.append(options.reward)
        return type("Made", (), {"evaluate": lambda self, state, events: Evaluation(options.reward, False)})()

    plugin = EvaluatorPlugin(name="share", build=build_share, options=Share)  # type: ignore[arg-type]
    kit.check_evaluator(plugin, instance, {"reward": "0.25"})
    assert set(rewards) == {0.25}
    with pytest.raises(UsageError, match="option `reward` is '3', at most 1 is due"):
        kit.check_evaluator(plugin, instance, {"reward": "3"})


def _forgetful(state: EpisodeState, events: object) -> Evaluation:
    state.states.clear()  # type: ignore[attr-defined]
    return Evaluation(0.0, False)


def _counting() -> Callable[[EpisodeState, object], Evaluation]:
    ticks: list[int] = []

    def evaluate(state: EpisodeState, events: object) -> Evaluation:
        ticks.append(state.tick)
        return Evaluation(min(1.0, len(ticks) / 10), False)

    return evaluate


@pytest.mark.parametrize(
    ("evaluate", "message"),
    [
        (lambda state, events: 0.5, "at tick 0 answers a value of type `float` instead of an Evaluation"),
        (lambda state, events: Evaluation(state.tick * 0.75, False), "at tick 2: its reward is 1.5"),
        (lambda state, events: Evaluation(0.5, True, "bored"), "its reason is 'bored'"),
        (_counting(), "keeps a state between calls: at tick 0 its reward is 0.1 .*, and 0.5 .* a second time"),
        (_forgetful, "changes the boundary that it receives"),
    ],
)
def test_an_evaluator_that_breaks_its_contract_fails(
    instance: Instance, evaluate: Callable[[EpisodeState, object], object], message: str
) -> None:
    with pytest.raises(kit.ConformanceError, match=message):
        kit.check_evaluator(evaluator(evaluate), instance)


class _Path:
    """The length of the path of the first body, kept from call to call."""

    def __init__(self, instance: Instance) -> None:
        self.body, self.last, self.length_m = instance.entities[0].id, instance.entities[0].position, 0.0

    def evaluate(self, state: EpisodeState, events: object) -> Evaluation:
        self.length_m += math.dist(self.last, state.states[self.body].position)
        self.last = state.states[self.body].position
        return Evaluation(min(1.0, self.length_m / 1000.0), False)


class _Farthest(_Path):
    """The largest distance so far. Two passes over the boundaries in order give the same results."""

    def evaluate(self, state: EpisodeState, events: object) -> Evaluation:
        self.length_m = max(self.length_m, state.states[self.body].position[0] / 1000.0)
        return Evaluation(min(1.0, self.length_m), False)


class _Events:
    """The number of events so far."""

    def __init__(self, instance: Instance) -> None:
        self.count = 0

    def evaluate(self, state: EpisodeState, events: Sequence[AdjudicatedEvent]) -> Evaluation:
        self.count += len(events)
        return Evaluation(min(1.0, self.count / 10.0), False)


class _FirstTick(_Path):
    """An evaluator that resets its state at tick 0, so that whole episodes are scored alike."""

    def evaluate(self, state: EpisodeState, events: object) -> Evaluation:
        if state.tick == 0:
            self.length_m, self.last = 0.0, state.states[self.body].position
        return super().evaluate(state, events)


@pytest.mark.parametrize("build", [_Path, _Farthest, _Events, _FirstTick])
def test_an_evaluator_with_a_state_fails(instance: Instance, build: type) -> None:
    with pytest.raises(kit.ConformanceError, match=r"keeps a state between calls: at tick \d its reward is"):
        kit.check_evaluator(EvaluatorPlugin(name="path", build=build), instance)


class _Stages:
    """A pure evaluator of events and stages."""

    def __init__(self, instance: Instance) -> None:
        self.stages = len(instance.stages)

    def evaluate(self, state: EpisodeState, events: Sequence[AdjudicatedEvent]) -> Evaluation:
        assert all((event.kind, event.bindings) in state.achieved for event in events)
        return Evaluation(len(state.stages) / self.stages, bool(events))


def test_a_pure_evaluator_of_events_and_stages_passes(instance: Instance) -> None:
    kit.check_evaluator(EvaluatorPlugin(name="stages", build=_Stages), instance)


def _divide(state: EpisodeState, events: object) -> Evaluation:
    return Evaluation(1 / state.tick, False)


def test_an_evaluator_that_raises_is_named_with_its_line(instance: Instance) -> None:
    message = r"evaluator `made` at tick 0: evaluate: ZeroDivisionError: division by zero \(.*evaluators.py:\d+\)"
    with pytest.raises(kit.ConformanceError, match=message):
        kit.check_evaluator(evaluator(_divide), instance)
    faulty = ((lambda instance: 1 / 0, "build: ZeroDivisionError"), (lambda instance: 3, "no method `evaluate`"))
    for build, message in faulty:
        with pytest.raises(kit.ConformanceError, match=message):
            kit.check_evaluator(EvaluatorPlugin(name="made", build=build), instance)  # type: ignore[arg-type]


def _with_options(instance: Instance, options: Share) -> _Stages:
    return _Stages(instance)


def test_a_missing_model_of_options_is_reported_instead_of_an_unknown_option(instance: Instance) -> None:
    message = r"`build` of `mine` takes \(instance, options\), and it is called with \(instance\)"
    with pytest.raises(PluginError, match=message) as caught:
        kit.check_evaluator(EvaluatorPlugin(name="mine", build=_with_options), instance, {"reward": 0.5})
    assert caught.value.hint == "declare `options`, the model of its options, or take (instance) alone"
    with pytest.raises(kit.ConformanceError, match="declares no model of options, and the check passes reward"):
        kit.check_evaluator(EvaluatorPlugin(name="mine", build=_Stages), instance, {"reward": 0.5})
