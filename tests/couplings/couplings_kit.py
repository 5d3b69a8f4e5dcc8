"""A kit that plays episodes of real engines tick by tick through the world host, and keeps their states."""

from __future__ import annotations

import itertools
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import msgspec

from lingjing.dsl.loading.load import load_mission
from lingjing.kernel.cities import CityBuilder
from lingjing.kernel.step import Kernel
from lingjing.kernel.world import open_world
from lingjing.kernel.world.contract import StoredFrame, World, WorldBoundary
from lingjing.mission.instance import Datum, Instance
from lingjing.mission.instantiate import instantiate
from lingjing.plugins.engine import CaptureRequest
from lingjing.plugins.host import PluginHost
from lingjing.scene.city import City
from lingjing.trace.records import Action, BodyState, Command, Decision, DecisionRecord, TaskEvent

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
    instance = instantiate(load_mission(mission), seed=seed, settings=settings)
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


class Play:
    """An episode in a world, tick by tick; `boundaries` holds all boundaries so far."""

    def __init__(self, world: World, instance: Instance, city: City) -> None:
        self.world, self.instance = world, instance
        self.boundaries: list[WorldBoundary] = [world.reset(instance, city)]
        self._commands = 0

    def tick(self, *orders: Command, count: int = 1) -> WorldBoundary:
        """Play some ticks, the first with these commands, all of which must be admitted."""
        for number in range(count):
            commands = orders if number == 0 else ()
            boundary = self.world.step(len(self.boundaries), commands)
            refused = [receipt for receipt in boundary.admissions if receipt.status != "accepted"]
            assert not refused and not boundary.missing, (refused, boundary.missing)
            self.boundaries.append(boundary)
        return self.boundaries[-1]

    def order(self, resource: str, verb: str, **arguments: Datum) -> Command:
        """Return a command for the next boundary in the name of the agent that controls the resource."""
        self._commands += 1
        sender = next((agent.id for agent in self.instance.agents if resource in agent.controls), "kernel")
        return Command(
            id=f"c{len(self.boundaries)}-{self._commands}",
            tick=len(self.boundaries),
            sender=sender,
            resource=resource,
            verb=verb,
            arguments=arguments,
            origin="kernel" if sender == "kernel" else "agent",
        )

    def look(self, entity: str, camera: str) -> StoredFrame:
        """Return a picture of the present boundary."""
        tick, last = len(self.boundaries) - 1, self.boundaries[-1].snapshots[-1]
        request = CaptureRequest(
            frame=f"f{tick}-{entity}-{camera}",
            entity=entity,
            camera=camera,
            tick=tick,
            time_s=self.boundaries[-1].time_s,
        )
        (frame,) = self.world.capture(tick, (request,), (*last.states, *last.ambient))
        assert isinstance(frame, StoredFrame), frame
        return frame

    def path(self, entity: str) -> list[BodyState]:
        """Return the states of the entity at every macro-step so far."""
        return list(path(self.boundaries, entity))

    def series(self, entity: str, resource: str) -> list[float]:
        """Return the values of one of its resources at every macro-step so far."""
        return [state.resources[resource] for state in self.path(entity)]

    def now(self, entity: str) -> BodyState:
        """Return the state of the entity at the last boundary."""
        return self.path(entity)[-1]

    def events(self, kind: str) -> list[TaskEvent]:
        """Return all task events of a kind so far."""
        return [event for boundary in self.boundaries for event in boundary.events if event.kind == kind]


def path(boundaries: Iterable[WorldBoundary], entity: str) -> Iterator[BodyState]:
    """Return the states of an entity at every macro-step of these boundaries."""
    for boundary in boundaries:
        for snapshot in boundary.snapshots:
            yield from (state for state in snapshot.states if state.id == entity)


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


def moved(states: Sequence[BodyState]) -> float:
    """Return the length of a path in the plane, metres."""
    pairs = itertools.pairwise(states)
    return sum(((b.position[0] - a.position[0]) ** 2 + (b.position[1] - a.position[1]) ** 2) ** 0.5 for a, b in pairs)


if __name__ == "__main__":  # python couplings_kit.py inline|process TICKS: prints the digests of each boundary
    played = open_world("inline" if sys.argv[1] == "inline" else "process", host=host())
    episode = Kernel(*staged(MIXED), played)
    episode.reset()
    print("\n".join(digests(episode, range(int(sys.argv[2])))))
    played.close()
