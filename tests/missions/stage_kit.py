"""The nine missions on their real instances, with the actors on strings.

Rules, unlocks, the city engine, its targets and the kernel are the real ones. What moves is replaced by puppets that
stand exactly where a test puts them, and the camera by one that shows exactly the boxes a test gives: a radius is met
to the last bit only that way. Targets are put on multiples of 1/64 m, so that sums of coordinates are exact.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import msgspec
import numpy as np

from lingjing import builtin
from lingjing.analysis.relations import RelationTracker
from lingjing.dsl.loading.load import load_mission
from lingjing.kernel.cities import CityBuilder
from lingjing.kernel.step import Kernel, Published
from lingjing.kernel.world.inline import InlineWorld
from lingjing.mission.instance import Instance, Weather
from lingjing.mission.instantiate import instantiate
from lingjing.plugins.engine import Boundary, EnginePlugin, Frame
from lingjing.plugins.hookspecs import hookimpl
from lingjing.plugins.host import PluginHost
from lingjing.plugins.requests import Requests
from lingjing.plugins.stock import Stock, booked
from lingjing.scene.city import City
from lingjing.trace.records import (
    Action,
    AdjudicatedEvent,
    BodyState,
    Box,
    CameraPose,
    Decision,
    DecisionRecord,
    FrameInfo,
    Outgoing,
    Receipt,
    RelationRecord,
    Route,
)

ROOT = Path(__file__).parents[2]

COLUMNS = (
    ("vdn", "single"),
    ("bi", "single"),
    ("ld", "star"),
    ("idf", "broadcast"),
    ("upr", "star"),
    ("ufr", "star"),
    ("ufr", "broadcast"),
    ("cr", "star"),
    ("ssr", "star"),
    ("ssr", "broadcast"),
    ("cd", "star"),
    ("cd", "broadcast"),
)
"""The twelve task-mode columns of the paper's main table."""

Place = tuple[float, float, float]

BOX = (0.4, 0.4, 0.6, 0.6)
FAR = 0.01
"""Just inside and just outside, metres."""


def shifted(share: float) -> tuple[float, float, float, float]:
    """`BOX` moved to the right so that the intersection over union is `share`."""
    move = (BOX[2] - BOX[0]) * (1 - share) / (1 + share)
    return (BOX[0] + move, BOX[1], BOX[2] + move, BOX[3])


@functools.cache
def mission(name: str):
    return load_mission(ROOT / "scenarios" / f"{name}.ljs")


@functools.cache
def staged(
    name: str, mode: str | None = None, seed: int = 0, settings: tuple[tuple[str, float], ...] = ()
) -> tuple[Instance, City]:
    """The anchored instance and its city, as an episode gets them."""
    return CityBuilder(PluginHost()).place(instantiate(mission(name), seed=seed, mode=mode, settings=dict(settings)))


def still(instance: Instance) -> Instance:
    """The instance in calm air and water, nothing adrift, its targets on 64ths of a metre."""

    def calm(entity):
        if entity.role != "target":
            return entity
        x, y, z = entity.position
        drift = {"drift_mps": 0.0} if "drift_mps" in entity.properties else {}
        place = (round(x * 64) / 64, round(y * 64) / 64, z)
        return msgspec.structs.replace(entity, position=place, properties={**entity.properties, **drift})

    weather = Weather(visibility_m=10_000.0)
    return msgspec.structs.replace(instance, weather=weather, entities=tuple(map(calm, instance.entities)))


@dataclass
class Strings:
    """The inputs that a test controls."""

    places: dict[str, Place | Callable[[float], Place]] = field(default_factory=dict)
    """Entity → its position, or a function of the time in seconds."""
    routes: list[tuple[tuple[float, float, float], ...]] = field(default_factory=list)
    """The routes that a vehicle gets, in order."""
    boxes: dict[str, tuple[float, float, float, float]] = field(default_factory=dict)
    """Entity → its box in each picture."""
    sight_m: float = 0.0
    """Largest planar distance from the camera at which a target is in the picture without a declared box, metres."""


class Puppets:
    """A motion engine that puts bodies where the strings define; every command is accepted and done at once."""

    def __init__(self, name: str, strings: Strings) -> None:
        self.name, self.strings = name, strings

    def reset(self, spec, city, seed):
        self.time_s = 0.0
        self.requests = Requests(self.name)
        self.entities = spec.owned()
        self.stocks = {entity.id: Stock(entity) for entity in self.entities}
        self.fresh, self.numbers = [], {}
        return self.boundary()

    def submit(self, commands):
        return tuple(self.requests.admit(command, self.time_s, self.start) for command in commands)

    def start(self, command):
        if command.verb in ("route", "replan"):
            number = self.numbers[command.resource] = self.numbers.get(command.resource, 0) + 1
            way = self.strings.routes[min(number, len(self.strings.routes)) - 1]
            self.fresh.append(
                Route(
                    entity=command.resource,
                    number=number,
                    waypoints=way,
                    length_m=100.0,
                    duration_s=10.0,
                    time_s=self.time_s,
                    request=command.id,
                )
            )

    def advance(self, until, mirrors):
        self.time_s = until
        for entity in self.entities:
            self.stocks[entity.id].read(booked(mirrors))
            self.requests.complete(entity.id, until)
        return self.boundary()

    def boundary(self):
        routes, self.fresh = tuple(self.fresh), []
        return Boundary(
            engine=self.name,
            time_s=self.time_s,
            states=tuple(self.state(entity) for entity in self.entities),
            receipts=self.requests.drain(),
            routes=routes,
        )

    def state(self, entity):
        place = self.strings.places.get(entity.id, entity.position)
        return BodyState(
            id=entity.id,
            position=place(self.time_s) if callable(place) else place,
            heading_deg=entity.heading_deg,
            status="idle",
            resources=dict(self.stocks[entity.id].amounts),
        )

    def capture(self, requests):
        return ()

    def close(self):
        pass


class Eye:
    """A camera with small grey pictures that contain exactly the boxes of the strings."""

    def __init__(self, strings: Strings) -> None:
        self.strings = strings

    def reset(self, spec, city, seed):
        self.spec = spec
        self.types = {entity.id: entity.type for entity in spec.instance.entities}
        self.targets = [entity.id for entity in spec.instance.entities if entity.role == "target"]
        return Boundary(engine=spec.engine, time_s=0.0)

    def submit(self, commands):
        return ()

    def advance(self, until, mirrors):
        self.mirrors = {mirror.id: mirror for mirror in mirrors}
        return Boundary(engine=self.spec.engine, time_s=until)

    def capture(self, requests):
        return tuple(self.draw(request) for request in requests)

    def sees(self, place, target):
        far_m = math.dist(self.mirrors[target].position[:2], place[:2])
        return self.strings.sight_m > 0.0 and far_m <= self.strings.sight_m

    def draw(self, request):
        place = self.mirrors[request.entity].position
        shown = {name: BOX for name in self.targets if self.sees(place, name)} | self.strings.boxes
        boxes = tuple(Box(entity=name, cls=self.types[name], box=box, pixels=9) for name, box in shown.items())
        pose = request.pose or CameraPose(position=place, heading_deg=0.0, tilt_deg=90.0, width=8, height=6)
        info = FrameInfo(
            id=request.frame,
            entity=request.entity,
            camera=request.camera,
            tick=request.tick,
            time_s=request.time_s,
            pose=pose,
            channels=("rgb",),
            boxes=boxes,
        )
        return Frame(info, np.full((6, 8, 3), 90, np.uint8))

    def close(self):
        pass


class Troupe:
    """The plug-in: puppets for all that move, the eye for the camera, the city and the scenes as they are."""

    def __init__(self, strings: Strings, real: tuple[str, ...] = ("city",)) -> None:
        self.strings, self.real = strings, real

    @hookimpl
    def lingjing_engines(self):
        engines = {engine.name: engine for engine in builtin.lingjing_engines()}
        kept = [engines[name] for name in self.real]
        moved = [
            EnginePlugin(name=name, factory=functools.partial(Puppets, name, self.strings))
            for name in ("multirotor", "quadruped", "vessel", "road")
            if name not in self.real
        ]
        eye = EnginePlugin(name="camera", factory=lambda: Eye(self.strings), place="camera", sensor=True)
        return [*kept, *moved, eye]


@dataclass
class Play:
    """An episode under way. `do` takes one decision per agent id; what happened is kept in order."""

    kernel: Kernel
    strings: Strings
    instance: Instance
    published: Published
    events: list[AdjudicatedEvent] = field(default_factory=list)
    relations: list[RelationRecord] = field(default_factory=list)
    receipts: list[Receipt] = field(default_factory=list)
    all: list[Published] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.tracker = RelationTracker(self.instance)
        self.relations.extend(self.tracker.take(self.published.record))

    def do(self, decisions: Mapping[str, Decision] | None = None) -> Published:
        made = decisions or {}
        unknown = set(made) - {agent.id for agent in self.instance.agents}
        assert not unknown, f"no such agent: {unknown}"
        records = tuple(
            DecisionRecord(agent=agent.id, decision=made[agent.id])
            for agent in self.instance.agents
            if agent.id in made
        )
        self.published = self.kernel.step(records)
        self.all.append(self.published)
        self.events.extend(self.published.record.events)
        self.relations.extend(self.tracker.take(self.published.record))
        self.receipts.extend(self.published.record.receipts)
        return self.published

    def wait(self, ticks: int) -> None:
        for _ in range(ticks):
            if not self.done:
                self.do()

    def put(self, name: str, target: str, east: float = 0.0, north: float = 0.0) -> None:
        """Stand an actor beside a target."""
        x, y, z = self.target(target).position
        self.strings.places[name] = (x + east, y + north, z)

    def target(self, name: str):
        return next(entity for entity in self.instance.entities if entity.id == name)

    def kinds(self) -> list[tuple[str, ...]]:
        """The adjudicated events: (rule, bound entities) in order, without report ids."""
        names = {entity.id for entity in self.instance.entities}
        return [(event.kind, *(name for name in event.bindings if name in names)) for event in self.events]

    def emitted(self) -> list[str]:
        """The engines' task events so far: kind and target."""
        return [f"{event.kind} {event.entities[0]}" for boundary in self.all for event in boundary.record.task_events]

    def reasons(self, request_sender: str) -> list[tuple[str, str]]:
        """(status, reason) of the receipts to one agent."""
        return [(receipt.status, receipt.reason) for receipt in self.receipts if receipt.sender == request_sender]

    def stages(self) -> list[str]:
        return [f"{stage.stage} {stage.subject}".strip() for boundary in self.all for stage in boundary.record.stages]

    @property
    def done(self) -> bool:
        return self.published.evaluation.done

    @property
    def success(self) -> bool:
        return self.published.evaluation.reason == "success"


@contextmanager
def playing(
    name: str,
    mode: str | None = None,
    *,
    seed: int = 0,
    real: tuple[str, ...] = ("city",),
    instance: Instance | None = None,
    strings: Strings | None = None,
    privileged: frozenset[str] = frozenset(),
    **settings: float,
) -> Iterator[Play]:
    """A fresh episode of a mission at boundary 0, with puppets for every engine that is not in `real`."""
    made, city = staged(name, mode, seed, tuple(sorted(settings.items())))
    if instance is None:
        instance = still(made)
    pulled = strings or Strings()
    world = InlineWorld(PluginHost(entry_points=False, extra=(Troupe(pulled, real),)))
    try:
        kernel = Kernel(instance, city, world, privileged=privileged)
        first = kernel.reset()
        yield Play(kernel, pulled, instance, first, all=[first])
    finally:
        world.close()


def does(verb: str, resource: str | None = None, **arguments: float | str) -> Decision:
    return Decision(command=Action(verb=verb, arguments=arguments, resource=resource))


def says(kind: str, to: tuple[str, ...] = (), **body: object) -> Decision:
    return Decision(messages=(Outgoing(kind=kind, body=body, to=to),))


def both(*parts: Decision) -> Decision:
    """One decision with the first command found and all the messages."""
    command = next((part.command for part in parts if part.command), None)
    return Decision(command=command, messages=tuple(message for part in parts for message in part.messages))


def report(kind: str, frame: str, cls: str, position: tuple[float, ...], box=BOX, **more: object) -> Decision:
    """A detection report of the kind a mission declares."""
    body = {"frame": frame, "class": cls, "box": box, "position": position, "confidence": 0.9, **more}
    return says(kind, **body)
