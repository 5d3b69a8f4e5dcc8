"""Missions, instances and cities for tests: from a text, a file or the name of a shipped mission.

A *source* is a compiled mission, the text of a mission, a file, or the name of a shipped mission (`ssr`). A string with
a line break is a text.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from os import PathLike
from pathlib import Path

import msgspec

from lingjing.data import data_path
from lingjing.dsl import Compilation, SourceText, compile_file, compile_source, compile_text
from lingjing.dsl.loading.load import load_mission, mission_of
from lingjing.errors import UsageError
from lingjing.kernel.cities import CityBuilder
from lingjing.kernel.visibility import Projector
from lingjing.mission import instantiate as instantiation
from lingjing.mission.alternatives import at_tier
from lingjing.mission.diagnostics import Diagnostic
from lingjing.mission.expression import Flag, Number
from lingjing.mission.instance import Budget, Clock, CommsSpec, Entity, Instance, SceneSpec, Weather
from lingjing.mission.model import Mission
from lingjing.plugins.building import build_city
from lingjing.plugins.host import PluginHost
from lingjing.plugins.policy import Brief
from lingjing.scene.city import City
from lingjing.suggest import nearest_or

__all__ = [
    "Compilation", "Diagnostic", "MissionSource", "PluginHost", "SourceText", "at_tier", "bare_instance", "brief_of",
    "city_of", "compile_file", "compile_source", "compile_text", "compiled", "instantiate", "mission_file", "placed",
    "shipped_missions", "shortened",
]  # fmt: skip

MissionSource = Mission | str | PathLike[str]
"""A compiled mission, a text with a line break, the path of a file, or the name of a shipped mission."""


def compiled(source: MissionSource) -> Mission:
    """Return the compiled mission of a source.

    Raises `MissionError` with the rendered diagnostics if the mission has errors, `UsageError` if there is no mission.
    """
    if isinstance(source, Mission):
        return source
    if isinstance(source, str) and "\n" in source:
        return mission_of(compile_text(source))
    return load_mission(source)


def shortened(source: MissionSource, ticks: int) -> Mission:
    """Return the mission of a source with another budget of ticks, so that a test plays its beginning alone.

    Raises the errors of `compiled`.
    """
    mission = compiled(source)
    budget = msgspec.structs.replace(mission.budget, ticks=Number(value=float(ticks)))
    return msgspec.structs.replace(mission, budget=budget)


def instantiate(
    source: MissionSource,
    *,
    seed: int = 0,
    mode: str | None = None,
    settings: Mapping[str, float] | None = None,
    tier: int = 0,
    language: str = "en",
) -> Instance:
    """Return an instance: every random value is drawn with `seed`, and no entity is placed in a city yet.

    `mode` is a communication mode of the mission, None for its default; `settings` are values of its parameters in SI
    units; `language` is that of goal and prompts. Raises the errors of `compiled`, and `UsageError` for a mode,
    parameter, value or language that the mission excludes.
    """
    return instantiation.instantiate(
        compiled(source), seed=seed, mode=mode, settings=settings, tier=tier, language=language
    )


def placed(
    source: MissionSource | Instance,
    *,
    seed: int = 0,
    mode: str | None = None,
    settings: Mapping[str, float] | None = None,
    host: PluginHost | None = None,
) -> tuple[Instance, City]:
    """Return an instance with its entities on the roads, roofs and ground of its city, and the city, as an episode has
    them.

    The other arguments are those of `instantiate`; an instance as the source ignores them. `host` offers the scenes;
    None for the installed ones. Raises the errors of `instantiate`, `PluginError` if the city cannot be built,
    `MissionError` if an entity has no place.
    """
    builder = CityBuilder(host or PluginHost())
    if isinstance(source, Instance):
        return builder.place(source)
    mission = compiled(source)
    drawn = instantiate(mission, seed=seed, mode=mode, settings=settings)
    return builder.place(drawn, imported=bool(mission.origin.places))


def city_of(scene: SceneSpec, host: PluginHost | None = None) -> City:
    """Return the city of a scene. `host` offers the scenes; None for the installed ones.

    Raises `UsageError` for a kind of scene that no plug-in offers, `PluginError` if the scene cannot be built.
    """
    return build_city(scene, host or PluginHost())


def brief_of(
    instance: Instance, agent: str, classes: Sequence[str] = (), *, city: City | None = None, policy_seed: int = 0
) -> Brief:
    """Return the brief that the policy of an agent receives; `Brief.classes` are `classes`.

    `city` gives the brief the roads of the scene. Raises `KeyError` for an unknown agent.
    """
    specs = {spec.id: spec for spec in instance.agents}
    return Projector(instance, policy_seed, city).brief(specs[agent], classes)


def bare_instance(entities: Iterable[Entity], *, won: bool = True, **fields: object) -> Instance:
    """Return an instance with these entities and nothing else: no agent, no message, no rule.

    It is won at once; with `won=False` it is never won.

    The defaults are a scene `bay`, a tick of 10 s with macro-steps of 0.5 s, 60 ticks, 1 s of wall clock for each
    policy, engine and picture, and calm weather. `fields` replaces fields of the instance; an unknown one raises
    `TypeError`.
    """
    bare = Instance(
        mission="test",
        title="",
        goal="",
        seed=1,
        settings={},
        scene=SceneSpec(kind="bay"),
        clock=Clock(tick_s=10.0, sync_s=0.5),
        budget=Budget(ticks=60, policy_s=1.0, engine_s=1.0, capture_s=1.0),
        weather=Weather(),
        regions=(),
        cells=(),
        entities=tuple(entities),
        agents=(),
        messages=(),
        comms=CommsSpec(mode="broadcast", hub=None),
        rules=(),
        unlocks=(),
        stages=(),
        relations=(),
        success=Flag(value=won),
    )
    return msgspec.structs.replace(bare, **fields)


def mission_file(name: str) -> Path:
    """Return the file of a shipped mission (`ssr`, `reset/ssr-001.json`). Raises `UsageError` for an unknown name."""
    path = data_path("scenarios", *name.split("/"))
    file = path if path.suffix else path.with_suffix(".ljs")
    if not file.is_file():
        names = [shipped.stem for shipped in shipped_missions()]
        raise UsageError(f"there is no shipped mission `{name}`", hint=nearest_or(name, names, ", ".join(names)))
    return file


def shipped_missions() -> tuple[Path, ...]:
    """Return the files of all shipped missions, sorted by name."""
    return tuple(sorted(data_path("scenarios").glob("*.ljs")))


__all__ = [
    "Compilation", "MissionSource", "PluginHost", "at_tier", "bare_instance", "brief_of", "city_of", "compile_file",
    "compile_text", "compiled", "instantiate", "mission_file", "placed", "shipped_missions", "shortened",
]  # fmt: skip
