"""Missions with all engines in one world: their instances with changes, and the commands of a busy episode."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import msgspec

from lingjing.kernel.cities import CityBuilder
from lingjing.kernel.step import Kernel
from lingjing.mission.instance import Datum, Instance
from lingjing.scene.city import City
from lingjing.testing import PluginHost, instantiate
from lingjing.testing.worlds import open_world
from lingjing.trace.records import Action, Decision, DecisionRecord

HERE = Path(__file__).parent
MIXED = HERE / "mixed.ljs"


@cache
def host() -> PluginHost:
    return PluginHost()


@cache
def cities() -> CityBuilder:
    return CityBuilder(host())


def staged(
    mission: Path, seed: int = 3, changed: Mapping[str, Mapping[str, Any]] | None = None, **settings: float
) -> tuple[Instance, City]:
    """Return an instance of a mission file with every entity placed on its city, and the city.

    `changed` replaces fields of entities by id, `weather` and `scene` those of the weather and the scene; a dictionary
    `properties` adds to the declared ones.
    """
    instance = instantiate(mission, seed=seed, settings=settings)
    return cities().place(_changed(instance, dict(changed or {})))


def _changed(instance: Instance, changes: dict[str, Mapping[str, Any]]) -> Instance:
    weather = msgspec.structs.replace(instance.weather, **changes.pop("weather", {}))
    scene = msgspec.structs.replace(instance.scene, **changes.pop("scene", {}))
    entities = []
    for entity in instance.entities:
        fields = dict(changes.pop(entity.id, {}))
        if "properties" in fields:
            fields["properties"] = {**entity.properties, **fields["properties"]}
        entities.append(msgspec.structs.replace(entity, **fields))
    assert not changes, f"no entity is called {', '.join(changes)}"
    return msgspec.structs.replace(instance, weather=weather, scene=scene, entities=tuple(entities))


def busy_decisions(instance: Instance, tick: int) -> tuple[DecisionRecord, ...]:
    """Return the commands of a busy episode: every body sets off at the first boundary, and some look around later.

    They are the same for every world.
    """
    actions = _departures(instance) if tick == 0 else _looks(instance) if tick % 3 == 1 else {}
    return tuple(
        DecisionRecord(agent=agent.id, decision=Decision(command=actions[agent.controls[0]]))
        for agent in instance.agents
        if agent.controls and agent.controls[0] in actions
    )


def _departures(instance: Instance) -> Mapping[str, Action]:
    actions = {}
    for entity in instance.entities:
        x, y, _ = entity.position
        shift = 40.0 * entity.index
        arguments: dict[str, tuple[str, dict[str, Datum]]] = {
            "multirotor": ("setDestination", {"x": x + 150.0, "y": y + shift, "z": 60.0 + 5.0 * entity.index}),
            "quadruped": ("forward", {"distance": 25.0}),
            "road": ("setDestination", {"x": -400.0, "y": 200.0 - 2 * shift}),
            "vessel": ("moveTo", {"x": 400.0, "y": 0.0}),
            "plane": ("setDestination", {"x": -300.0, "y": 600.0, "z": 250.0}),
        }
        if entity.engine in arguments:
            verb, values = arguments[entity.engine]
            actions[entity.id] = Action(verb=verb, arguments=values)
    return actions


def _looks(instance: Instance) -> Mapping[str, Action]:
    photo = Action(verb="takePhoto")
    return {entity.id: photo for entity in instance.entities if entity.cameras and entity.engine == "quadruped"}


def digests(kernel: Kernel, ticks: Iterable[int]) -> list[str]:
    """Return two digests of each boundary of a busy episode: one of everything but the pixels, one of the pixels."""
    digests_of_boundaries = []
    for tick in ticks:
        record = kernel.step(busy_decisions(kernel.instance, tick)).record
        digests_of_boundaries.append(f"{record.digest} {kernel.state.frames_digest}")
    return digests_of_boundaries


if __name__ == "__main__":  # python mixed_world.py inline|process TICKS: prints the digests of each boundary
    played = open_world("inline" if sys.argv[1] == "inline" else "process", host=host())
    episode = Kernel(*staged(MIXED), played)
    episode.reset()
    print("\n".join(digests(episode, range(int(sys.argv[2])))))
    played.close()
