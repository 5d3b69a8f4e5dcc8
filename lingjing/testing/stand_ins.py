"""Stand-in engines: bodies that stand exactly where a test puts them, and a camera with exactly the boxes of a test.

With them a distance or an overlap is met to the last bit. The kernel, the mission's rules and the engine `city` with
its targets are the real ones.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from lingjing import builtin
from lingjing.mission.instance import Vector
from lingjing.plugins.engine import Boundary, CaptureRequest, EnginePlugin, EngineSpec, Frame
from lingjing.plugins.hookspecs import hookimpl
from lingjing.plugins.requests import Requests
from lingjing.plugins.stock import Stock, booked
from lingjing.scene.city import City
from lingjing.testing.decisions import CENTRE_BOX, Box
from lingjing.trace.records import BodyState, CameraPose, Command, FrameInfo, Receipt, Route
from lingjing.trace.records import Box as TargetBox

REPLACED = ("multirotor", "quadruped", "vessel", "road")
"""The engines that stand-ins replace, beside the camera."""

_GREY = 90
"""The value of each pixel of a stand-in's picture, 0 to 255 (chosen)."""


@dataclass
class Stage:
    """The inputs of stand-in engines. A test changes them between boundaries."""

    places: dict[str, Vector | Callable[[float], Vector]] = field(default_factory=dict)
    """The position of an entity in metres, or a function of the time in seconds. An absent one stays at its start."""
    routes: list[tuple[Vector, ...]] = field(default_factory=list)
    """The waypoints of the routes that vehicles get, in order; the last one is repeated."""
    boxes: dict[str, Box] = field(default_factory=dict)
    """The box of an entity in each picture."""
    sight_m: float = 0.0
    """Largest planar distance from the camera at which a target is in the picture without an entry in `boxes`,
    metres."""


class StandInBodies:
    """A motion engine that puts bodies at the places of a stage. It accepts and completes every command at once."""

    def __init__(self, name: str, stage: Stage) -> None:
        self._name, self._stage = name, stage
        self._time_s = 0.0
        self._requests = Requests(name)
        self._fresh: list[Route] = []
        self._numbers: dict[str, int] = {}

    def reset(self, spec: EngineSpec, city: City, seed: int) -> Boundary:
        """Return the boundary at time 0."""
        self._entities = spec.owned()
        self._stocks = {entity.id: Stock(entity) for entity in self._entities}
        return self._boundary()

    def submit(self, commands: Sequence[Command]) -> tuple[Receipt, ...]:
        """Accept the commands."""
        return tuple(self._requests.admit(command, self._time_s, self._start) for command in commands)

    def advance(self, until: float, mirrors: Sequence[BodyState]) -> Boundary:
        """Complete all requests."""
        self._time_s = until
        for entity in self._entities:
            self._stocks[entity.id].read(booked(mirrors))
            self._requests.complete(entity.id, until)
        return self._boundary()

    def capture(self, requests: Sequence[CaptureRequest]) -> tuple[Frame, ...]:
        """Return no picture."""
        return ()

    def close(self) -> None:
        """Release nothing."""

    def _start(self, command: Command) -> None:
        if command.verb in ("route", "replan"):
            number = self._numbers[command.resource] = self._numbers.get(command.resource, 0) + 1
            self._fresh.append(
                Route(
                    entity=command.resource,
                    number=number,
                    waypoints=self._stage.routes[min(number, len(self._stage.routes)) - 1],
                    length_m=100.0,
                    duration_s=10.0,
                    time_s=self._time_s,
                    request=command.id,
                )
            )

    def _boundary(self) -> Boundary:
        routes, self._fresh = tuple(self._fresh), []
        return Boundary(
            engine=self._name,
            time_s=self._time_s,
            states=tuple(
                BodyState(
                    id=entity.id,
                    position=self._place(entity.id, entity.position),
                    heading_deg=entity.heading_deg,
                    status="idle",
                    resources=dict(self._stocks[entity.id].amounts),
                )
                for entity in self._entities
            ),
            receipts=self._requests.drain(),
            routes=routes,
        )

    def _place(self, entity: str, start: Vector) -> Vector:
        place = self._stage.places.get(entity, start)
        return place(self._time_s) if callable(place) else place


class StandInCamera:
    """A camera with grey pictures of 8 x 6 pixels; their ground truth is exactly the boxes of a stage."""

    def __init__(self, stage: Stage) -> None:
        self._stage = stage

    def reset(self, spec: EngineSpec, city: City, seed: int) -> Boundary:
        """Return the boundary at time 0."""
        self._spec = spec
        self._types = {entity.id: entity.type for entity in spec.instance.entities}
        self._targets = [entity.id for entity in spec.instance.entities if entity.role == "target"]
        return Boundary(engine=spec.engine, time_s=0.0)

    def submit(self, commands: Sequence[Command]) -> tuple[Receipt, ...]:
        """Receive no command."""
        return ()

    def advance(self, until: float, mirrors: Sequence[BodyState]) -> Boundary:
        """Store the bodies of the other engines."""
        self._mirrors = {mirror.id: mirror for mirror in mirrors}
        return Boundary(engine=self._spec.engine, time_s=until)

    def capture(self, requests: Sequence[CaptureRequest]) -> tuple[Frame, ...]:
        """Return a picture for each request."""
        return tuple(self._draw(request) for request in requests)

    def close(self) -> None:
        """Release nothing."""

    def _draw(self, request: CaptureRequest) -> Frame:
        place = self._mirrors[request.entity].position
        shown = {name: CENTRE_BOX for name in self._targets if self._sees(place, name)} | self._stage.boxes
        pose = CameraPose(position=place, heading_deg=0.0, tilt_deg=90.0, width=8, height=6)
        info = FrameInfo(
            id=request.frame,
            entity=request.entity,
            camera=request.camera,
            tick=request.tick,
            time_s=request.time_s,
            pose=request.pose or pose,
            channels=("rgb",),
            boxes=tuple(
                TargetBox(entity=name, cls=self._types[name], box=box, pixels=9) for name, box in shown.items()
            ),
        )
        return Frame(info, np.full((6, 8, 3), _GREY, np.uint8))

    def _sees(self, place: Vector, target: str) -> bool:
        distance_m = math.dist(self._mirrors[target].position[:2], place[:2])
        return self._stage.sight_m > 0.0 and distance_m <= self._stage.sight_m


class StandIns:
    """A plug-in with stand-ins for the camera and all motion engines, except those named in `real`."""

    def __init__(self, stage: Stage, real: tuple[str, ...] = ("city",)) -> None:
        self._stage, self._real = stage, real

    @hookimpl
    def lingjing_engines(self) -> list[EnginePlugin]:
        """Return the real engines, the stand-ins and the camera."""
        engines = {engine.name: engine for engine in builtin.lingjing_engines()}
        kept = [engines[name] for name in self._real]
        moved = [
            EnginePlugin(name=name, factory=functools.partial(StandInBodies, name, self._stage))
            for name in REPLACED
            if name not in self._real
        ]
        camera = EnginePlugin(
            name="camera", factory=functools.partial(StandInCamera, self._stage), place="camera", sensor=True
        )
        return [*kept, *moved, camera]


__all__ = ["REPLACED", "Stage", "StandInBodies", "StandInCamera", "StandIns"]
