"""One engine, driven by macro-steps, and small worlds for it: an open sea, a quay with a tower, bodies with what their
types declare.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import msgspec

from lingjing.dsl.checking import library
from lingjing.dsl.checking.scope import TypeDecl
from lingjing.dsl.checking.toplevel import load_library
from lingjing.mission.appearance import MODELS, PHYSICAL
from lingjing.mission.evaluate import Scope, evaluate
from lingjing.mission.instance import Datum, Entity, Instance
from lingjing.mission.instance_entities import datum
from lingjing.plugins.engine import Boundary, Engine, EnginePlugin, EngineSpec
from lingjing.scene.city import City, Land, Solid, Water
from lingjing.scene.sizes import SIZES
from lingjing.testing.missions import MissionSource, placed
from lingjing.trace.records import BodyState, Command, Receipt, TaskEvent

WATER_LEVEL_M = -3.5
"""The elevation of the water of `open_sea` and `quay`, metres; that of the shipped bay."""


class EngineRun:
    """One engine in one run: it is reset, receives commands and advances by macro-steps, and its answers are kept."""

    def __init__(self, engine: Engine, instance: Instance, city: City, name: str, seed: int = 1) -> None:
        """`name` is the name under which the entities of the instance name the engine."""
        owned = tuple(entity.id for entity in instance.entities if entity.engine == name)
        self.engine = engine
        self.sync_s = instance.clock.sync_s
        """The interval of a macro-step, seconds."""
        self.boundary: Boundary = engine.reset(EngineSpec(engine=name, instance=instance, owns=owned), city, seed)
        """The last boundary."""
        self.history: list[Boundary] = [self.boundary]
        """All boundaries, from time 0."""
        self.receipts: list[Receipt] = []
        """The receipts of all boundaries, without those of admission."""
        self.events: list[TaskEvent] = []
        self.time_s = 0.0
        self._count = 0

    def command(self, resource: str, verb: str, origin: str = "agent", **arguments: Datum) -> Receipt:
        """Submit a command to the engine, and return the receipt of its admission."""
        self._count += 1
        command = Command(
            id=f"c0-{self._count}",
            tick=0,
            sender="test",
            resource=resource,
            verb=verb,
            arguments=arguments,
            origin="kernel" if origin == "kernel" else "agent",
        )
        (receipt,) = self.engine.submit((command,))
        return receipt

    def run(self, seconds: float, mirrors: Sequence[BodyState] = ()) -> Boundary:
        """Advance by whole macro-steps for these seconds, and return the last boundary."""
        for _ in range(round(seconds / self.sync_s)):
            self.step(mirrors)
        return self.boundary

    def until_ended(self, request: str, limit_s: float = 120.0) -> Receipt:
        """Advance until a request ends, and return its last receipt.

        Raises `AssertionError` if it has not ended at `limit_s` seconds of simulation time.
        """
        while self.time_s < limit_s:
            for receipt in self.step().receipts:
                if receipt.request == request and receipt.status != "running":
                    return receipt
        raise AssertionError(f"{request} did not end within {limit_s} s: {self.boundary.states}")

    def step(self, mirrors: Sequence[BodyState] = ()) -> Boundary:
        """Advance by one macro-step. `mirrors` are the bodies of other engines at its start."""
        self.time_s += self.sync_s
        self.boundary = self.engine.advance(self.time_s, mirrors)
        self.history.append(self.boundary)
        self.receipts += self.boundary.receipts
        self.events += self.boundary.events
        return self.boundary

    @property
    def state(self) -> BodyState:
        """The last state of the engine's first body."""
        return self.boundary.states[0]


def drive(plugin: EnginePlugin, source: MissionSource | Instance, *, seed: int = 1) -> EngineRun:
    """Return a run of a plug-in's engine on the instance and city of a mission, at time 0.

    Raises the errors of `placed`.
    """
    instance, city = placed(source, seed=seed)
    return EngineRun(plugin.factory(), instance, city, plugin.name, seed)


def square(x: float, y: float, half: float) -> tuple[tuple[float, float], ...]:
    """Return the corners of a square around a point, counter-clockwise; `half` is half of its side, metres."""
    return ((x - half, y - half), (x + half, y - half), (x + half, y + half), (x - half, y + half))


def open_sea() -> City:
    """Return a city that is water alone, 5 km to each side of the origin."""
    water = Water(polygon=square(0.0, 0.0, 5000.0), level_m=WATER_LEVEL_M)
    bounds = (-5000.0, -5000.0, 5000.0, 5000.0)
    return City(id="sea", origin=(31.0, 121.5), bounds=bounds, datum_m=WATER_LEVEL_M, waters=(water,))


def quay() -> City:
    """Return the open sea with a quay (top 0.9 m) of 40 m to each side of the origin and a tower of 60 m, 100 m to the
    east.
    """
    tower = Solid(id="tower", polygon=square(100.0, 0.0, 5.0), base_m=WATER_LEVEL_M, top_m=60.0)
    land = Land(polygon=square(0.0, 0.0, 40.0), top_m=0.9, surface="concrete")
    return msgspec.structs.replace(open_sea(), id="quay", lands=(land,), solids=(tower,))


def declared(entity: Entity) -> Entity:
    """Return the entity with the measures, look and mounts that its type of the standard library declares.

    The kinds of the background traffic are no types: such a body gets its kind's look and size. Properties of the
    entity stay.
    """
    declaration = library_types().get(entity.type)
    if declaration is None:
        return msgspec.structs.replace(entity, properties={**_of_kind(entity.type), **entity.properties})
    measures = {
        prop.name: datum(evaluate(prop.value, Scope()), 0.0) for prop in declaration.properties if prop.name in PHYSICAL
    }
    return msgspec.structs.replace(
        entity,
        properties={**measures, **entity.properties},
        mounts=tuple(declaration.mounts.values()),
        parts=tuple(declaration.parts.values()),
    )


@cache
def library_types() -> dict[str, TypeDecl]:
    """Return the declarations of all asset and target types of the standard library, by name."""
    types: dict[str, TypeDecl] = {}
    for path in library.known_paths("std"):
        file = library.find_file(tuple(path.split(".")))
        if file is not None:
            types.update(load_library(file)[0].types)
    return types


def _of_kind(kind: str) -> dict[str, float | str]:
    size = SIZES.get(kind)
    sizes = {} if size is None else {name: getattr(size, name) for name in ("length_m", "width_m", "height_m")}
    return {**sizes, **({"look": kind} if kind in MODELS else {})}


__all__ = ["WATER_LEVEL_M", "EngineRun", "declared", "drive", "library_types", "open_sea", "quay", "square"]
