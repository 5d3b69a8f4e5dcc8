"""The check of an evaluator: valid answers that depend on the arguments alone, in every order and from every boundary.

The boundaries are those of a made-up episode: each body moves at every tick, and the rules and stages of the mission
come true one after the other. So an evaluator that keeps anything (a path length, a counter, the last position) answers
differently when it is asked again.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from lingjing.mission.instance import GivenOption, Instance
from lingjing.plugins.conformance.case import of_plugin, require
from lingjing.plugins.evaluator import Evaluation, Evaluator, EvaluatorPlugin, answer_fault
from lingjing.plugins.foreign_errors import kind_of_value
from lingjing.plugins.hook_faults import check_declaration
from lingjing.plugins.options import PluginOptions, declared_model, read_options
from lingjing.trace.records import AdjudicatedEvent, BodyState

STEP_M = 7.0
"""The distance by which the first body moves at a tick, metres; each later body moves a little farther. Chosen."""


@dataclass(slots=True)
class _Boundary:
    """The arguments of one call: an `EpisodeState` and the events."""

    tick: int
    time_s: float
    states: dict[str, BodyState]
    achieved: dict[tuple[str, tuple[str, ...]], float]
    stages: dict[tuple[str, str], int]
    events: tuple[AdjudicatedEvent, ...]


def check_evaluator(
    plugin: EvaluatorPlugin, instance: Instance, options: dict[str, GivenOption] | None = None, *, ticks: int = 4
) -> None:
    """Check an evaluator: valid answers that depend on the arguments alone, and arguments that stay unchanged.

    It receives `ticks` boundaries of a made-up episode: in order, again in order, backwards, and each alone. Raises
    `ConformanceError` with the first fault.
    """
    owner = f"evaluator `{plugin.name}`"
    check_declaration(plugin, "lingjing_evaluators", plugin.name)
    named = ", ".join(options or {})
    require(bool(plugin.options) or not options, f"{owner} declares no model of options, and the check passes {named}")
    model = declared_model(plugin.options, owner)
    arguments = (read_options(model or PluginOptions, options or {}, owner),) if plugin.options or options else ()

    def build() -> Evaluator[Any]:
        made = of_plugin(f"{owner}: build", lambda: plugin.build(instance, *arguments))
        require(
            callable(getattr(made, "evaluate", None)),
            f"{owner}: build: it returned {kind_of_value(made)}, which has no method `evaluate`",
        )
        return made

    shown = [_boundary(instance, tick) for tick in range(ticks)]
    before = copy.deepcopy(shown)
    first = build()
    answers = [_answer(first, state, owner) for state in shown]
    require(shown == before, f"{owner} changes the boundary that it receives")
    again = [_answer(first, state, owner) for state in shown]
    _require_same(owner, "evaluates the same boundaries a second time", answers, again)
    other = build()
    backwards = [_answer(other, state, owner) for state in reversed(shown)][::-1]
    _require_same(owner, "receives the boundaries in another order", answers, backwards)
    _require_same(owner, "receives one boundary alone", answers, [_answer(build(), state, owner) for state in shown])


def _require_same(owner: str, when: str, answers: Sequence[Evaluation], others: Sequence[Evaluation]) -> None:
    for tick, (answer, other) in enumerate(zip(answers, others, strict=True)):
        require(
            answer == other,
            f"{owner} keeps a state between calls: at tick {tick} its reward is {answer.reward:g} (done: {answer.done})"
            f", and {other.reward:g} (done: {other.done}) when it {when}",
        )


def _answer(evaluator: Evaluator[Any], state: _Boundary, owner: str) -> Evaluation:
    """Return the valid answer of an evaluator."""
    what = f"{owner} at tick {state.tick}"
    answer: object = of_plugin(f"{what}: evaluate", lambda: evaluator.evaluate(state, state.events))
    require(isinstance(answer, Evaluation), f"{what} answers {kind_of_value(answer)} instead of an Evaluation")
    assert isinstance(answer, Evaluation)
    require(not answer_fault(answer), f"{what}: {answer_fault(answer)}")
    return answer


def _boundary(instance: Instance, tick: int) -> _Boundary:
    """Return a boundary of the made-up episode. From tick 1 on, one more rule and one more stage are true at each."""
    clock_s = instance.clock.tick_s
    rules, stages = instance.rules[: max(0, tick)], instance.stages[: max(0, tick)]
    entities = [entity.id for entity in instance.entities]
    done = [(rule.name, tuple(entities[: len(rule.parameters)]), (number + 1)) for number, rule in enumerate(rules)]
    events = tuple(
        AdjudicatedEvent(id=f"v{at}-1", kind=name, tick=at, time_s=at * clock_s, bindings=bound)
        for name, bound, at in done
        if at == tick
    )
    return _Boundary(
        tick,
        tick * clock_s,
        {
            entity.id: _moved(entity.id, entity.position, number, tick)
            for number, entity in enumerate(instance.entities)
        },
        {(name, bound): at * clock_s for name, bound, at in done},
        {(stage.name, ""): number + 1 for number, stage in enumerate(stages)},
        events,
    )


def _moved(name: str, start: tuple[float, float, float], number: int, tick: int) -> BodyState:
    """Return the state of a body after `tick` ticks on an arc from its first place."""
    x, y, z = start
    away_m, bearing = tick * (STEP_M + number), math.radians(40.0 * tick)
    place = (x + away_m * math.sin(bearing), y + away_m * math.cos(bearing), z)
    return BodyState(id=name, position=place, heading_deg=40.0 * tick % 360.0, status="moving" if tick else "idle")


__all__ = ["STEP_M", "check_evaluator"]
