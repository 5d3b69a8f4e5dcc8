"""One vehicle of the mission: where it is, what it is doing, what it carries.

SUMO's position is the middle of the front bumper; here and in every state it is the middle of the vehicle. A vehicle
that is to stay somewhere has a stop of SUMO's that never ends; one that is held anywhere else has its speed set to 0.

A vehicle without a task stands on its lane. When somebody has to wait behind it, it makes room: it moves aside to the
kerb and the lane is free. A vehicle that finds others of the mission standing where it wants to stop has arrived behind
them.
"""

from __future__ import annotations

import math
from collections.abc import Container, Sequence
from dataclasses import dataclass
from typing import Literal

from lingjing.mission.instance import Entity
from lingjing.plugins.engines.bodies import SIZES
from lingjing.plugins.engines.road.graph import Graph, Place
from lingjing.plugins.engines.road.kinds import SPEED_MPS, declare, kind_of, top_speed
from lingjing.plugins.engines.road.routing import Avoided, Way, onward
from lingjing.plugins.engines.road.sideways import Sideways, shifted
from lingjing.plugins.engines.road.simulation import FOREVER_S, STEP_S, Simulation, SumoError
from lingjing.trace.records import BodyState

BRAKING_MPS2 = 2.0
"""Comfortable braking of `stop`, `forward` and turns."""

RESERVE_M = 300.0
"""How far a route leads beyond where its vehicle is to stop."""

STANDING_MPS = 0.05
NOWHERE_M = -1e8
"""Farther west than every map: where SUMO says a vehicle is that is on no road."""

_STILL_MPS = 1e-3
_SAME_LOAD_KG = 0.5

LOAD = "load_kg"

ASIDE_M = 2.2
"""How far to the right of its lane's middle a vehicle stands that has made room."""

QUEUE_M = 40.0
"""Within this distance of its goal a vehicle that stands behind others of the mission has arrived."""

_SUMO_ASIDE_M = 3.2
_WAIT_STEPS = 30
_PARKING = 1
_GAP_M = 2.5
_HEADWAY_S = 2.5
_PATIENCE_STEPS = 300
_KEEP_LANE, _CHANGE_LANES = 0, 1621
"""Lane change modes: none at all, and SUMO's default."""

Status = Literal["parked", "driving", "waiting", "arrived"]
Outcome = Literal["", "done", "arrived"]


@dataclass(frozen=True, slots=True)
class Plan:
    """A way to a destination that was asked for: the point named, the lane point nearest to it, the edges."""

    x: float
    y: float
    goal: Place
    way: Way


@dataclass(slots=True)
class Task:
    """What is being done: `drive` to a goal, cover a `distance` by the odometer, or `halt`."""

    kind: Literal["drive", "distance", "halt"]
    total: float
    start_m: float = 0.0
    plan: Plan | None = None
    onto: str = ""
    edges: tuple[str, ...] = ()
    steps: int = 0


@dataclass(frozen=True, slots=True)
class Room:
    """Where a vehicle made room: the lane, metres of its front along it."""

    lane: str
    at_m: float


@dataclass(frozen=True, slots=True)
class Footing:
    """Where a vehicle's route may change: edges that it must still follow first, then an edge and metres along it."""

    before: tuple[str, ...]
    edge: str
    at_m: float


class Vehicle:
    """A vehicle of the mission in the simulation."""

    def __init__(self, entity: Entity, sim: Simulation, graph: Graph) -> None:
        """Declare its type; `place` puts it on the road."""
        self.id = entity.id
        self.entity = entity
        self.kind = kind_of(entity)
        self.size = SIZES[self.kind.name]
        self.task: Task | None = None
        self.plan: Plan | None = None
        self.avoided: tuple[Avoided, ...] = ()
        self.routes = 0
        self._sim = sim
        self._graph = graph
        self._speed_mps = _number(entity, "speed_mps", SPEED_MPS)
        self._payload_kg = _number(entity, "payload_kg", 0.0)
        self._first_load_kg = self.load_kg = self._felt_kg = _number(entity, LOAD, 0.0)
        self._loads = LOAD in entity.state
        self._arrived = False
        self._waited = 0
        self._room: Room | None = None
        self._sideways = Sideways()
        self._offset_m = 0.0
        declare(
            sim, f"type/{self.id}", self.kind, self._speed_mps, blue_light=bool(entity.properties.get("blue_light"))
        )

    def place(self, place: Place) -> None:
        """Stand on a lane from the next step on."""
        lane = place.lane
        front = min(max(place.at_m + self.size.length_m / 2.0, 0.1), lane.length_m)
        name = f"route/{self.id}"
        self._sim.route.add(name, [lane.edge])
        self._sim.vehicle.add(
            self.id, name, f"type/{self.id}", departLane=str(lane.index), departPos=str(front), departSpeed="0"
        )
        self._sim.vehicle.setStop(self.id, lane.edge, front, lane.index, FOREVER_S)
        self._carry()

    @property
    def speed_mps(self) -> float:
        """Speed along the road."""
        return float(self._sim.vehicle.getSpeed(self.id))

    @property
    def road(self) -> str:
        """The edge it is on; an internal one (`:…`) within a junction."""
        return str(self._sim.vehicle.getRoadID(self.id))

    @property
    def odometer_m(self) -> float:
        """Metres driven since the episode began."""
        return max(0.0, float(self._sim.vehicle.getDistance(self.id)))

    @property
    def status(self) -> Status:
        """`driving` and `waiting` (standing on the way) while something is being done."""
        if self.task is not None:
            return "waiting" if self.task.kind != "halt" and self.speed_mps < STANDING_MPS else "driving"
        return "arrived" if self._arrived else "parked"

    def footing(self) -> Footing:
        """From where a new route may start. Within a junction that is the edge being entered."""
        vehicles = self._sim.vehicle
        road, at_m = vehicles.getRoadID(self.id), vehicles.getLanePosition(self.id)
        if not road.startswith(":"):
            return Footing((), road, at_m)
        route, index = vehicles.getRoute(self.id), vehicles.getRouteIndex(self.id)
        return Footing((route[index],), route[index + 1], 0.0)

    def braking_m(self) -> float:
        """The distance that a comfortable halt takes now."""
        return self.speed_mps**2 / (2.0 * BRAKING_MPS2)

    def drive(self, plan: Plan) -> None:
        """Drive along a plan that begins at the footing, and stay at its goal."""
        self._begin(Task("drive", max(plan.way.length_m, 1.0), self.odometer_m, plan))
        if self._room is None:
            self._set_out(plan)

    def _set_out(self, plan: Plan) -> None:
        footing, goal = self.footing(), plan.goal
        self._release()
        self._follow(footing, plan.way.edges)
        front = min(goal.at_m + self.size.length_m / 2.0, goal.lane.length_m - 0.2)
        front = max(front, min(self.size.length_m, goal.lane.length_m - 0.2))
        try:
            self._sim.vehicle.setStop(self.id, goal.lane.edge, front, goal.lane.index, FOREVER_S)
        except SumoError:  # it is there, or so close that braking ends beyond it
            self._brake(0.0)

    def cover(self, edges: tuple[str, ...], distance_m: float, onto: str = "") -> None:
        """Drive a distance along edges that begin at the footing's, and halt there; `onto`: not before that edge."""
        self._begin(Task("distance", distance_m, self.odometer_m, None, onto, edges))
        if self._room is None:
            self._set_out_along(edges)

    def _set_out_along(self, edges: tuple[str, ...]) -> None:
        footing = self.footing()
        self._release()
        self._follow(footing, edges)

    def halt(self) -> None:
        """Brake comfortably to a standstill."""
        speed = self.speed_mps
        if not self._sim.vehicle.isStopped(self.id):
            footing = self.footing()
            route = self._sim.vehicle.getRoute(self.id)[self._sim.vehicle.getRouteIndex(self.id) :]
            self._release()
            self._follow(footing, route[len(footing.before) :])
        self._begin(Task("halt", max(speed, STANDING_MPS)))
        self._arrived = False

    @property
    def is_aside(self) -> bool:
        """Whether it has made room."""
        return self._room is not None

    def prepare(self) -> None:
        """Before a step: stay held; or go back into the lane for a task once nobody comes, in a queue at a gap."""
        if self.task is None and not self._sim.vehicle.isStopped(self.id):
            self._brake(0.0)  # again, because SUMO has been seen to forget it
        if self._room is None or self.task is None or self.task.kind == "halt":
            return
        self.task.steps += 1
        if self._is_clear(self._room, self.task.steps > _PATIENCE_STEPS):
            if self.task.plan is not None:
                self._set_out(self.task.plan)
            else:
                self._set_out_along(self.task.edges)

    def _is_clear(self, room: Room, impatient: bool) -> bool:
        vehicles, length = self._sim.vehicle, self.size.length_m
        for other in self._sim.lane.getLastStepVehicleIDs(room.lane):
            front, speed = vehicles.getLanePosition(other), vehicles.getSpeed(other)
            if other == self.id or front - vehicles.getLength(other) > room.at_m + _GAP_M:
                continue
            behind = room.at_m - length - front
            if behind < (_GAP_M if impatient and speed < 2.0 else 2.0 * _GAP_M + speed * _HEADWAY_S):
                return False
        return True

    def make_room(self) -> None:
        """Move aside to the kerb; ended by the next task. Within a junction there is none: it stays."""
        vehicles = self._sim.vehicle
        name, lane = vehicles.getLaneID(self.id), vehicles.getLaneIndex(self.id)
        stops = vehicles.getStops(self.id, 1)
        at_m = stops[0].endPos if stops else vehicles.getLanePosition(self.id)
        if lane != 0 or name.startswith(":"):
            return  # others have a lane to pass on, or there is no kerb
        try:
            vehicles.setStop(self.id, self.road, at_m, lane, FOREVER_S, _PARKING)
        except SumoError:
            return
        self._room = Room(name, at_m)

    def is_waited_for(self) -> str:
        """Who stands right behind it, or ""."""
        follower, gap = self._sim.vehicle.getFollower(self.id, 5.0)
        standing = follower and 0.0 <= gap < 5.0 and self._sim.vehicle.getSpeed(follower) < STANDING_MPS
        return str(follower) if standing else ""

    def step(self, standing: Container[str]) -> Outcome:
        """Look after the task behind a step of the simulation; says when it is done. `standing`: who has no task."""
        self._shift()
        task = self.task
        if task is None:
            return ""
        if task.kind == "drive":
            outcome = self._driven(task, standing)
        elif task.kind == "distance":
            outcome = self._covered(task)
        else:
            outcome = self._halted()
        if outcome:
            self._sim.vehicle.setLaneChangeMode(self.id, _KEEP_LANE)
            self._brake(0.0)
            self.task = None
            self._arrived = outcome == "arrived"
        return outcome

    def progress(self) -> float | None:
        """The share of the task that is done; None: there is no task."""
        task = self.task
        if task is None:
            return None
        if task.kind == "halt":
            return 1.0 - self.speed_mps / task.total
        if task.plan is None:
            return (self.odometer_m - task.start_m) / max(task.total, 0.1)
        return 1.0 - min(max(self._left_m(task), 0.0) / task.total, 1.0)

    def take_load(self, got_kg: float) -> None:
        """Carry this much more than at the start from now on, if the load is a state of the vehicle."""
        self.load_kg = max(0.0, self._first_load_kg + got_kg) if self._loads else self.load_kg
        if abs(self.load_kg - self._felt_kg) > _SAME_LOAD_KG:
            self._felt_kg = self.load_kg
            self._carry()

    def state(self, ahead_s: float) -> BodyState:
        """The state `ahead_s` after the last step, moved on along its velocity."""
        vehicles = self._sim.vehicle
        speed = self.speed_mps
        body = body_state(self._sim, self.id, self.id, self.size.length_m, ahead_s)
        return BodyState(
            id=self.id,
            position=shifted(body, self._offset_m).position,
            velocity=body.velocity,
            heading_deg=body.heading_deg,
            pitch_deg=float(vehicles.getSlope(self.id)),
            status=self.status,
            resources={LOAD: self.load_kg, "speed_mps": speed, "odometer_m": self.odometer_m},
        )

    def _begin(self, task: Task) -> None:
        self.task = task
        self._waited = 0
        self._arrived = False

    def _driven(self, task: Task, standing: Container[str]) -> Outcome:
        vehicles = self._sim.vehicle
        if self._room is not None:
            return ""
        self._waited = self._waited + 1 if self.speed_mps < STANDING_MPS else 0
        if vehicles.isStopped(self.id) or (self._waited > 0 and not vehicles.getStops(self.id, 1)):
            return "arrived"
        if self._waited >= _WAIT_STEPS and self._left_m(task) <= QUEUE_M:
            ahead = vehicles.getLeader(self.id, 10.0)
            if ahead and ahead[0] in standing:
                self._release()
                self._brake(0.0)
                return "arrived"
        return ""

    def _left_m(self, task: Task) -> float:
        """Metres to the goal; infinite where there is none on the way."""
        if task.plan is None:
            return math.inf
        goal = task.plan.goal
        left = float(self._sim.vehicle.getDrivingDistance(self.id, goal.lane.edge, goal.at_m, goal.lane.index))
        return math.inf if left < -1e6 else left

    def _shift(self) -> None:
        """Follow what SUMO does sideways: lane changes, and parking a whole lane to the right."""
        rest = ASIDE_M - _SUMO_ASIDE_M if self._sim.vehicle.isStoppedParking(self.id) else 0.0
        body = body_state(self._sim, self.id, self.id, self.size.length_m, 0.0)
        self._offset_m = self._sideways.follow(body, STEP_S, rest)

    def _covered(self, task: Task) -> Outcome:
        if self._room is not None:
            return ""
        left = task.total - (self.odometer_m - task.start_m)
        there = task.onto == "" or self._sim.vehicle.getRoadID(self.id) == task.onto
        speed = self.speed_mps
        if left <= 0.3 and speed < _STILL_MPS and there:
            self._brake(0.0)
            return "done"
        if left <= speed * speed / (2.0 * BRAKING_MPS2) + speed * STEP_S + 0.5:
            reachable = math.sqrt(2.0 * BRAKING_MPS2 * max(left - speed * STEP_S, 0.0))
            self._brake(reachable if left > 0.3 and there else (0.0 if there else 2.0))
        return ""

    def _halted(self) -> Outcome:
        speed = self.speed_mps
        if speed < _STILL_MPS:
            return "done"
        self._brake(max(0.0, speed - BRAKING_MPS2 * STEP_S))
        return ""

    def _brake(self, speed_mps: float) -> None:
        self._sim.vehicle.setSpeed(self.id, speed_mps)

    def _follow(self, footing: Footing, edges: Sequence[str]) -> None:
        """Take a route. It goes on behind its end, for at the very end of one SUMO removes a vehicle."""
        self._sim.vehicle.setRoute(self.id, [*footing.before, *onward(self._graph, edges, RESERVE_M)])

    def _release(self) -> None:
        """Leave every stop and take the speed back."""
        vehicles = self._sim.vehicle
        if vehicles.isStopped(self.id):
            vehicles.resume(self.id)
        for _ in vehicles.getStops(self.id):
            vehicles.replaceStop(self.id, 0, "")
        vehicles.setSpeed(self.id, -1)
        vehicles.setLaneChangeMode(self.id, _CHANGE_LANES)
        self._room = None

    def _carry(self) -> None:
        vehicles = self._sim.vehicle
        vehicles.setAccel(self.id, self.kind.acceleration(self.load_kg))
        vehicles.setMaxSpeed(self.id, top_speed(self._speed_mps, self.load_kg, self._payload_kg))


def body_state(sim: Simulation, vehicle: str, name: str, length_m: float, ahead_s: float, kind: str = "") -> BodyState:
    """Any vehicle of the simulation as a body: its middle, `ahead_s` after the last step."""
    vehicles = sim.vehicle
    x, y, z = vehicles.getPosition3D(vehicle)
    heading = vehicles.getAngle(vehicle) % 360.0 % 360.0
    speed = vehicles.getSpeed(vehicle)
    slope_deg = 0.0 if sim.level else vehicles.getSlope(vehicle)
    angle = math.radians(heading)
    east, north, up = math.sin(angle), math.cos(angle), 0.0
    if slope_deg != 0.0:
        slope = math.radians(slope_deg)
        east, north, up = east * math.cos(slope), north * math.cos(slope), math.sin(slope)
    on = speed * ahead_s - length_m / 2.0
    return BodyState(
        id=name,
        position=(x + east * on, y + north * on, z + up * on),
        velocity=(east * speed, north * speed, up * speed),
        heading_deg=heading,
        pitch_deg=slope_deg,
        status="driving" if speed > STANDING_MPS else "waiting",
        kind=kind,
    )


def _number(entity: Entity, name: str, default: float) -> float:
    value = entity.properties.get(name)
    return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else default
