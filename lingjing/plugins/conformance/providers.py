"""The checks of evaluators, scenes and files of kinds: the offers match their contract, in every call."""

from __future__ import annotations

import copy
from dataclasses import dataclass, field

from lingjing.mission.instance import GivenOption, Instance, SceneSpec
from lingjing.mission.kinds import described_by
from lingjing.plugins.building import build_city
from lingjing.plugins.conformance.case import require
from lingjing.plugins.evaluator import Evaluation, EvaluatorPlugin, answer_fault
from lingjing.plugins.host import PluginHost
from lingjing.plugins.options import PluginOptions, declared_model, read_options
from lingjing.scene.city import content_sha256
from lingjing.scene.city_checks import city_faults
from lingjing.trace.records import BodyState


@dataclass(slots=True)
class _RestingStanding:
    """An `EpisodeState` without events, with every entity at its first place."""

    tick: int
    time_s: float
    states: dict[str, BodyState]
    achieved: dict[tuple[str, tuple[str, ...]], float] = field(default_factory=dict)
    stages: dict[tuple[str, str], int] = field(default_factory=dict)


def check_evaluator(
    plugin: EvaluatorPlugin, instance: Instance, options: dict[str, GivenOption] | None = None, *, ticks: int = 3
) -> None:
    """Check an evaluator: valid answers that depend on the arguments alone, and arguments that stay unchanged.

    The boundaries have no events. Raises `ConformanceError` with the first fault.
    """
    owner = f"evaluator `{plugin.name}`"
    model = declared_model(plugin.options, owner)
    arguments = (read_options(model or PluginOptions, options or {}, owner),) if plugin.options or options else ()
    places = {entity.id: BodyState(id=entity.id, position=entity.position) for entity in instance.entities}
    shown = [_RestingStanding(tick, tick * instance.clock.tick_s, dict(places)) for tick in range(ticks)]
    before = copy.deepcopy(shown)
    first, second = plugin.build(instance, *arguments), plugin.build(instance, *arguments)
    answers = [first.evaluate(state, ()) for state in shown]
    for tick, answer in enumerate(answers):
        what = f"{owner} at tick {tick}"
        require(isinstance(answer, Evaluation), f"{what} answers a {type(answer).__name__} instead of an Evaluation")
        require(not answer_fault(answer), f"{what}: {answer_fault(answer)}")
    again = [second.evaluate(state, ()) for state in reversed(shown)][::-1]
    require(answers == again, f"{owner} gives other answers in another order: it keeps a state")
    require(shown == before, f"{owner} changes the boundary that it receives")


def check_scene(spec: SceneSpec, host: PluginHost | None = None) -> None:
    """Check that the city of an installed scene is valid, and equal when it is built again. Raises
    `ConformanceError`."""
    host = host or PluginHost()
    city, again = build_city(spec, host), build_city(spec, host)
    faults = list(city_faults(city, spec))
    require(not faults, f"scene `{spec.kind}`: {'; '.join(faults[:10])}")
    same = content_sha256(city) == content_sha256(again)
    require(same, f"scene `{spec.kind}` builds another city in a second call")


def check_kinds(plugin: str, host: PluginHost | None = None) -> None:
    """Check that the `kinds.json` of an entry point is valid, and describes exactly the scenes that it offers.

    Raises `PluginError` that lists every fault of the file, `ConformanceError` for a missing or an unknown kind.
    """
    sources = (host or PluginHost()).sources
    file = described_by(plugin)
    for kind, described in (("scene", file.by_scene), ("engine", file.by_engine)):
        offered = [name for (hook, name), source in sources.items() if (hook, source) == (f"lingjing_{kind}s", plugin)]
        made_up = sorted(described.keys() - set(offered))
        require(not made_up, f"kinds.json describes {kind}s that `{plugin}` does not offer: {', '.join(made_up)}")
        left_out = sorted(set(offered) - described.keys()) if kind == "scene" else []
        require(not left_out, f"kinds.json does not describe the scenes {', '.join(left_out)} that `{plugin}` offers")


__all__ = ["check_evaluator", "check_kinds", "check_scene"]
