"""The engine: one AirSim vehicle for each UAV, paused between two boundaries.

A vehicle's place is that of its UAV in the mission plus what it has flown since its start: AirSim's settings put the
vehicles where the mission has them.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from lingjing.errors import InfrastructureError
from lingjing.plugins.engine import (
    BodyState,
    Boundary,
    CaptureRequest,
    City,
    Command,
    EngineSpec,
    Frame,
    Receipt,
    TaskEvent,
)
from lingjing.plugins.options import engine_options
from lingjing.plugins.requests import STOP, Refusal, Requests, number, optional_number
from lingjing_airsim.options import AirsimOptions
from lingjing_airsim.session import AirsimSession, Telemetry

_TAKEOFF_M = 10.0
"""Height of a take-off without an altitude, metres: that of Lingjing's own multirotor."""
_STILL_MPS = 0.5
"""Speed below which a vehicle counts as standing, m/s (chosen: AirSim's controller swings less)."""
_USUAL_MPS = 5.0
"""Speed of a UAV that declares none, m/s (chosen)."""
_COURSES = {"forward": 0.0, "right": 90.0, "backward": 180.0, "left": 270.0}
"""Angle of each move from the heading, degrees clockwise."""
_DEAD = "dead"
_GROUNDED = "grounded"

Place = tuple[float, float, float]
"""East, north, up in metres."""


@dataclass
class _Vehicle:
    entity: str
    name: str
    start: Place
    cruise_mps: float
    state: BodyState
    goal: Place | None = None
    length_m: float = 0.0
    """Distance to the goal at its start."""
    climbs: bool = False
    """True while the take-off before a destination goes on."""
    faces: bool = False
    arrives: bool = True

    def local(self, place: Place) -> Place:
        """Return a place of the mission as AirSim has it: north, east, down from the start."""
        return place[1] - self.start[1], place[0] - self.start[0], self.start[2] - place[2]


class AirsimEngine:
    """See `lingjing.plugins.engine.Engine`."""

    def __init__(self) -> None:
        self._session: AirsimSession | None = None
        self._options = AirsimOptions()
        self._vehicles: dict[str, _Vehicle] = {}
        self._requests = Requests("airsim")
        self._events: list[TaskEvent] = []
        self._engine = "airsim"
        self._time_s = 0.0

    def reset(self, spec: EngineSpec, city: City, seed: int) -> Boundary:
        """Connect, reset AirSim, take control of its vehicles, and return boundary 0."""
        options = engine_options(AirsimOptions, spec)
        if self._session is None or options != self._options:
            self.close()
            self._options = options
            self._session = AirsimSession(options.host, options.port, options.timeout_s)
        self._engine, self._time_s, self._events = spec.engine, 0.0, []
        self._requests = Requests(spec.engine)
        names = self._session.begin(resets=options.resets)
        self._vehicles = {}
        for entity, name in zip(spec.owned(), _assigned(spec, options, names), strict=True):
            cruise = entity.properties.get("cruise_mps")
            self._session.control(name)
            self._vehicles[entity.id] = _Vehicle(
                entity=entity.id,
                name=name,
                start=entity.position,
                cruise_mps=float(cruise) if isinstance(cruise, int | float) and cruise > 0 else _USUAL_MPS,
                state=BodyState(id=entity.id, position=entity.position, heading_deg=entity.heading_deg),
            )
        self._observe(0.0)
        self._events = []
        return self._boundary(0.0)

    def submit(self, commands: Sequence[Command]) -> tuple[Receipt, ...]:
        """Admit or reject commands."""
        return tuple(self._admit(command) for command in commands)

    def advance(self, until: float, mirrors: Sequence[BodyState]) -> Boundary:
        """Let AirSim run to `until`."""
        self._open().advance(until - self._time_s)
        self._observe(until)
        self._time_s = until
        for vehicle in self._vehicles.values():
            self._judge(vehicle)
        return self._boundary(until)

    def capture(self, requests: Sequence[CaptureRequest]) -> tuple[Frame, ...]:
        """Return nothing: Lingjing's camera takes the pictures."""
        return ()

    def close(self) -> None:
        """Close the connection."""
        session, self._session = self._session, None
        if session is not None:
            session.close()

    def _open(self) -> AirsimSession:
        if self._session is None:
            raise InfrastructureError("AirSim is not connected", hint="call reset first")
        return self._session

    # -- commands

    def _admit(self, command: Command) -> Receipt:
        if command.resource not in self._vehicles:
            reason = "unknown_resource", f"`{command.resource}` is no UAV of this engine"
            return command.receipt(self._engine, "rejected", self._time_s, *reason)
        if command.verb == STOP:
            return self._stop(command)
        return self._requests.admit(command, self._time_s, self._start)

    def _stop(self, command: Command) -> Receipt:
        vehicle = self._vehicles[command.resource]
        if vehicle.state.status == _DEAD:
            return command.receipt(self._engine, "rejected", self._time_s, _DEAD, f"`{command.resource}` has crashed")
        self._requests.fail(command.resource, self._time_s, "preempted", f"`stop` {command.id} took over")
        vehicle.goal, vehicle.climbs = None, False
        if vehicle.state.status != _GROUNDED:
            self._open().hold(vehicle.name)
        return self._requests.answer(command, self._time_s, lambda _: None)

    def _start(self, command: Command) -> None:
        """Start a command. Raises `Refusal`."""
        vehicle = self._vehicles[command.resource]
        if vehicle.state.status == _DEAD:
            raise Refusal(_DEAD, f"`{command.resource}` has crashed")
        goal = self._goal(command, vehicle)
        vehicle.goal, vehicle.length_m = goal, math.dist(goal, vehicle.state.position)
        vehicle.faces = command.verb == "setDestination" and math.dist(goal[:2], vehicle.state.position[:2]) > 3.0
        vehicle.arrives = command.verb != "takeoff"
        vehicle.climbs = vehicle.state.status == _GROUNDED
        if vehicle.climbs:
            self._open().take_off(vehicle.name)
        else:
            self._go(vehicle)

    def _goal(self, command: Command, vehicle: _Vehicle) -> Place:
        x, y, z = vehicle.state.position
        grounded = vehicle.state.status == _GROUNDED
        if command.verb == "takeoff":
            if not grounded:
                raise Refusal("airborne", f"`{command.resource}` is flying already")
            altitude = optional_number(command, "altitude")
            return x, y, z + _at_least(command, "altitude", _TAKEOFF_M if altitude is None else altitude, 1.0)
        if command.verb == "setDestination":
            return number(command, "x"), number(command, "y"), number(command, "z")
        if command.verb not in _COURSES and command.verb not in ("up", "down"):
            raise Refusal("unknown_verb", f"a UAV of AirSim has no verb `{command.verb}`")
        distance = _at_least(command, "distance", number(command, "distance"), 0.0)
        if grounded and command.verb != "up":
            raise Refusal(_GROUNDED, f"`{command.resource}` is on the ground: `takeoff` or `setDestination` first")
        if command.verb in ("up", "down"):
            return x, y, z + (distance if command.verb == "up" else -distance)
        course = math.radians(vehicle.state.heading_deg + _COURSES[command.verb])
        return x + distance * math.sin(course), y + distance * math.cos(course), z

    def _go(self, vehicle: _Vehicle) -> None:
        if vehicle.goal is not None:
            place = vehicle.local(vehicle.goal)
            self._open().fly_to(vehicle.name, place, vehicle.cruise_mps, forward=vehicle.faces)

    # -- states

    def _observe(self, time_s: float) -> None:
        for vehicle in self._vehicles.values():
            seen = self._open().telemetry(vehicle.name)
            dead = vehicle.state.status == _DEAD
            if seen.collided and not dead and not (seen.landed or vehicle.state.status in ("", _GROUNDED)):
                dead = True
                self._events.append(TaskEvent(kind="collided", entities=(vehicle.entity,), time_s=time_s))
                self._requests.fail(vehicle.entity, time_s, "collided", f"it hit {seen.collided}")
                vehicle.goal = None
            vehicle.state = _state(vehicle, seen, dead=dead)

    def _judge(self, vehicle: _Vehicle) -> None:
        """Report the progress of a request, and complete it at the goal."""
        if vehicle.goal is None:
            return
        if vehicle.climbs and vehicle.state.status != _GROUNDED and vehicle.state.position[2] - vehicle.start[2] > 1.0:
            vehicle.climbs = False
            self._go(vehicle)
        left = math.dist(vehicle.goal, vehicle.state.position)
        speed = math.dist((0.0, 0.0, 0.0), vehicle.state.velocity)
        if left <= self._options.arrived_m and speed <= _STILL_MPS and not vehicle.climbs:
            vehicle.goal = None
            self._requests.complete(vehicle.entity, self._time_s)
            if vehicle.arrives:
                self._events.append(TaskEvent(kind="arrived", entities=(vehicle.entity,), time_s=self._time_s))
            return
        share = 1.0 - left / max(vehicle.length_m, self._options.arrived_m)
        self._requests.run(vehicle.entity, self._time_s, min(max(share, 0.0), 1.0))

    def _boundary(self, time_s: float) -> Boundary:
        events, self._events = tuple(self._events), []
        states = tuple(vehicle.state for vehicle in self._vehicles.values())
        receipts = self._requests.drain()
        return Boundary(engine=self._engine, time_s=time_s, states=states, receipts=receipts, events=events)


def _assigned(spec: EngineSpec, options: AirsimOptions, names: tuple[str, ...]) -> tuple[str, ...]:
    """Return the vehicle of each UAV. Raises `InfrastructureError` if there are too few."""
    chosen = tuple(name.strip() for name in options.vehicles.split(",") if name.strip()) or names
    unknown = [name for name in chosen if name not in names]
    if unknown:
        message = f"AirSim has no vehicle `{unknown[0]}`; it has {', '.join(names) or 'none'}"
        raise InfrastructureError(message, hint="set --engine-arg airsim.vehicles")
    if len(chosen) < len(spec.owns):
        raise InfrastructureError(
            f"AirSim has {len(chosen)} vehicles ({', '.join(chosen)}) for the UAVs {', '.join(spec.owns)}",
            hint="add vehicles to AirSim's settings.json",
        )
    return chosen[: len(spec.owns)]


def _state(vehicle: _Vehicle, seen: Telemetry, *, dead: bool) -> BodyState:
    position = vehicle.start[0] + seen.east, vehicle.start[1] + seen.north, vehicle.start[2] - seen.down
    velocity = seen.velocity[1], seen.velocity[0], -seen.velocity[2]
    moving = math.dist((0.0, 0.0, 0.0), velocity) > _STILL_MPS
    status = _DEAD if dead else _GROUNDED if seen.landed else "moving" if moving else "hovering"
    return BodyState(
        id=vehicle.entity,
        position=position,
        velocity=velocity,
        heading_deg=seen.heading_deg,
        pitch_deg=seen.pitch_deg,
        roll_deg=seen.roll_deg,
        status=status,
        resources={"battery": 1.0},
    )


def _at_least(command: Command, name: str, value: float, least: float) -> float:
    if value < least:
        raise Refusal("bad_argument", f"`{name}` of `{command.verb}` must be at least {least:g}, not {value:g}")
    return value
