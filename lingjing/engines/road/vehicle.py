"""One vehicle of the mission: its position, its task and its load.

SUMO's position is the middle of the front bumper; here and in every state it is the middle of the vehicle. A vehicle
that stays at a place has a SUMO stop without end. A vehicle that is held anywhere else has its speed set to 0.

A vehicle that has arrived parks at the kerb and leaves its lane free. It returns to the lane once no other vehicle
comes. It stands on its lane if there is no kerb, if it was halted on its way, and at its declared place. If another
vehicle has to wait for it there, it makes room: it moves to the kerb beside it or to the next free place ahead. A
vehicle that finds other vehicles of the mission standing where it wants to stop has arrived behind them.
"""

from __future__ import annotations

import math
from collections.abc import Container, Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import msgspec

from lingjing.engines.road.driving_conditions import DRY_DAY, DrivingConditions
from lingjing.engines.road.graph import Graph, LanePoint
from lingjing.engines.road.kerb import REACH_M, Kerb, LaneVehicle, ParkingPlace
from lingjing.engines.road.kinds import EMERGENCY_MPS2, SPEED_MPS, TAU_S, declare, top_speed, vehicle_kind
from lingjing.engines.road.lateral_motion import LateralOffsets, shifted
from lingjing.engines.road.routing import Avoided, DrivingWay, onward
from lingjing.engines.road.simulation import FOREVER_S, Simulation, SumoError
from lingjing.mission.instance import Entity
from lingjing.plugins.stock import Stock
from lingjing.scene.outlines import compass
from lingjing.trace.records import BodyState

BRAKING_MPS2 = 2.0
"""Comfortable braking of `stop`, `forward` and turns, m/s^2 (chosen)."""

RESERVE_M = 300.0
"""Length of a route beyond the place where its vehicle stops, metres (chosen)."""

STANDING_MPS = 0.05
"""Speed below which a vehicle stands, m/s (chosen)."""
NOWHERE_M = -1e8
"""West bound of every map, metres: SUMO places a vehicle that is on no road farther west."""

_STILL_MPS = 1e-3
"""Speed below which a halt is complete, m/s (chosen)."""

_SLACK_M = 0.3
"""Rest of a distance at which it counts as covered, metres (chosen); half of the distance if that is less."""

_SAME_LOAD_KG = 0.5
"""Change of the load that does not change the dynamics yet, kg (chosen)."""

QUEUE_M = 40.0
"""Distance from its goal within which a vehicle that stands behind others of the mission has arrived, metres
(chosen)."""

_SUMO_ASIDE_M = 3.2
"""Distance by which SUMO moves a parking vehicle to the right, metres."""

_WAIT_STEPS = 30
"""Steps at a standstill after which a vehicle checks for others ahead (chosen)."""

_PARKING = 1
"""SUMO's flag of a stop beside the lane."""

_GAP_M = 2.5
"""Gap to a vehicle in the lane when pulling out, metres (chosen)."""

_HEADWAY_S = 2.5
"""Time gap to an approaching vehicle when pulling out, seconds (chosen)."""

_REACTION_S = 0.3
"""Reaction time of an approaching driver, seconds (that of background traffic)."""

_DECEL_MPS2 = 4.5
"""Braking of an approaching driver, m/s^2 (SUMO's default)."""

_PATIENCE_STEPS = 300
"""Steps of waiting at the kerb after which a vehicle makes others brake (chosen)."""
_SAME_PLACE_M = 12.0
"""Distance beyond its goal at which a parked vehicle is there already, metres (chosen): it does not drive around the
block."""
_KEEP_LANE, _CHANGE_LANES = 0, 1621
"""SUMO's lane change modes: no changes at all, and the default."""

VehicleStatus = Literal["parked", "driving", "waiting", "arrived"]
"""The status words of a vehicle; `kinds.json` lists them for the checker."""

TaskEnd = Literal["", "done", "arrived"]


@dataclass(frozen=True, slots=True)
class DrivingPlan:
    """A route to a requested destination."""

    x: float
    """East coordinate of the destination, metres."""
    y: float
    """North coordinate of the destination, metres."""
    goal: LanePoint
    """The lane point nearest to it."""
    way: DrivingWay
    """The route."""


@dataclass(slots=True)
class _VehicleTask:
    """A task of a vehicle."""

    kind: Literal["drive", "distance", "halt", "aside"]
    """`drive` to a goal, cover a `distance` by the odometer, `halt`, or move `aside` for others."""
    total: float
    """Size of the task: length (m) of `drive` and `distance`, initial speed (m/s) of `halt`."""
    start_m: float = 0.0
    """Odometer at its start, metres."""
    plan: DrivingPlan | None = None
    """The plan of `drive`; None otherwise."""
    onto: str = ""
    """The edge that `distance` must reach before it ends; empty if there is none."""
    edges: tuple[str, ...] = ()
    """The edges of `distance`."""
    steps: int = 0
    """Steps of waiting at the kerb."""
    stays: bool = False
    """True if the vehicle is parked at the goal already."""

    def is_short(self, length_m: float) -> bool:
        """Return whether this is a distance in which a vehicle of `length_m` has no room to change lanes.

        SUMO would move the vehicle sideways at once, while it almost stands.
        """
        return self.kind == "distance" and self.onto == "" and self.total < 2.0 * length_m


@dataclass(frozen=True, slots=True)
class RouteStart:
    """The point from which a vehicle's route may change."""

    before: tuple[str, ...]
    """Edges that the vehicle must follow first."""
    edge: str
    """The edge of the point."""
    at_m: float
    """Distance along that edge, metres."""


class Vehicle:
    """A vehicle of the mission in the simulation."""

    def __init__(self, entity: Entity, sim: Simulation, graph: Graph, kerb: Kerb) -> None:
        """Declare its type in SUMO; `place` puts it on the road."""
        self.id = entity.id
        self.entity = entity
        self.kind = vehicle_kind(entity)
        self.size = self.kind.size
        self.task: _VehicleTask | None = None
        self.plan: DrivingPlan | None = None
        self.avoided: tuple[Avoided, ...] = ()
        self.routes = 0
        self._sim = sim
        self._graph = graph
        self._kerb = kerb
        self._speed_mps = entity.number_or("speed_mps", SPEED_MPS)
        self._payload_kg = entity.number_or("payload_kg", 0.0)
        self.stock = Stock(entity)
        self._applied_load_kg = math.inf
        self._conditions = DRY_DAY
        self._arrived = False
        self._waited = 0
        self._room: ParkingPlace | None = None
        self._bound: ParkingPlace | None = None
        self.held_by = ""
        """Id of the vehicle that prevents it from pulling out; empty if there is none."""
        self._sideways = LateralOffsets()
        self._offset_m = 0.0
        declare(
            sim, f"type/{self.id}", self.kind, self._speed_mps, blue_light=bool(entity.properties.get("blue_light"))
        )

    def place(self, place: LanePoint) -> None:
        """Stand on a lane from the next step on."""
        lane, front = place.lane, self._front(place)
        self._sim.enter(self.id, [lane.edge], f"type/{self.id}", lane.index, front)
        self._sim.vehicle.setStop(self.id, lane.edge, front, lane.index, FOREVER_S)
        self.update_load()

    def _kerbside(self, place: LanePoint) -> ParkingPlace | None:
        """Return the free place at the kerb nearest to a lane point, reserved for the vehicle; None if there is
        none."""
        return self._kerb.reserve(self.id, place.lane.edge, self._front(place), self.size.length_m)

    def _front(self, place: LanePoint) -> float:
        return min(max(place.at_m + self.size.length_m / 2.0, 0.1), place.lane.length_m)

    def _park(self, room: ParkingPlace | None) -> None:
        self._room = room
        if room is not None:
            self._kerb.take(self.id, room, self.size.length_m)

    @property
    def speed_mps(self) -> float:
        """Speed along the road, m/s."""
        return float(self._sim.vehicle.getSpeed(self.id))

    @property
    def odometer_m(self) -> float:
        """Distance driven since the episode began, metres."""
        return max(0.0, float(self._sim.vehicle.getDistance(self.id)))

    @property
    def status(self) -> VehicleStatus:
        """`driving` or `waiting` (at a standstill) during a task, otherwise `arrived` or `parked`."""
        if self.task is not None:
            return "waiting" if self.task.kind != "halt" and self.speed_mps < STANDING_MPS else "driving"
        return "arrived" if self._arrived else "parked"

    def route_start(self) -> RouteStart:
        """Return the point from which a new route may start. Inside a junction it is the start of the next edge."""
        vehicles = self._sim.vehicle
        road, at_m = vehicles.getRoadID(self.id), vehicles.getLanePosition(self.id)
        if not road.startswith(":"):
            return RouteStart((), road, at_m)
        route, index = vehicles.getRoute(self.id), vehicles.getRouteIndex(self.id)
        return RouteStart((route[index],), route[index + 1], 0.0)

    def braking_m(self) -> float:
        """Return the distance of a comfortable halt at the present speed, metres."""
        return self.speed_mps**2 / (2.0 * self._braking_mps2)

    @property
    def _braking_mps2(self) -> float:
        return self._conditions.braking_mps2(BRAKING_MPS2, self.kind.decel_mps2)

    def drive(self, plan: DrivingPlan) -> None:
        """Drive along a plan that begins at the route start, and stay at its goal."""
        self._begin(_VehicleTask("drive", max(plan.way.length_m, 1.0), self.odometer_m, plan))
        assert self.task is not None
        self.task.stays = self._is_at(plan.goal)
        if self._room is None:
            self._set_out(plan)

    def _is_at(self, goal: LanePoint) -> bool:
        """Return whether the vehicle is parked at its place for a goal, or a little beyond."""
        if self._room is None or self._room.lane.edge != goal.lane.edge:
            return False
        wanted = self._kerbside(goal)
        there = wanted is not None and abs(wanted.at_m - self._room.at_m) <= 1.0
        return there or -1.0 <= self._room.at_m - self._front(goal) <= _SAME_PLACE_M

    def _set_out(self, plan: DrivingPlan) -> None:
        start, goal = self.route_start(), plan.goal
        self._release()
        self._follow(start, plan.way.edges)
        here = len(plan.way.edges) == 1 and not start.before
        least = start.at_m + self.braking_m() if here else 0.0
        room = self._kerb.reserve(self.id, goal.lane.edge, self._front(goal), self.size.length_m, least)
        front = min(goal.at_m + self.size.length_m / 2.0, goal.lane.length_m - 0.2)
        front = max(front, min(self.size.length_m, goal.lane.length_m - 0.2))
        self._stop_at(room or ParkingPlace(goal.lane, front), 0 if room is None else _PARKING)

    def _stop_at(self, place: ParkingPlace, flags: int) -> None:
        """Set a stop with the front at a place."""
        self._bound = place if flags == _PARKING else None
        try:
            self._sim.vehicle.setStop(self.id, place.lane.edge, place.at_m, place.lane.index, FOREVER_S, flags)
        except SumoError:  # it is already there, or too close to brake in time
            self._brake(0.0)

    def cover(self, edges: tuple[str, ...], distance_m: float, onto: str = "") -> None:
        """Drive a distance along edges from the route start, and halt there, but not before the edge `onto`."""
        self._begin(_VehicleTask("distance", distance_m, self.odometer_m, None, onto, edges))
        if self._room is None:
            self._set_out_along(edges)

    def _set_out_along(self, edges: tuple[str, ...]) -> None:
        start = self.route_start()
        self._release()
        if self.task is not None and self.task.is_short(self.size.length_m):
            self._sim.vehicle.setLaneChangeMode(self.id, _KEEP_LANE)
        self._follow(start, edges)

    def halt(self) -> None:
        """Brake comfortably to a standstill."""
        speed = self.speed_mps
        if not self._sim.vehicle.isStopped(self.id):
            start = self.route_start()
            route = self._sim.vehicle.getRoute(self.id)[self._sim.vehicle.getRouteIndex(self.id) :]
            self._release()
            self._follow(start, route[len(start.before) :])
        self._begin(_VehicleTask("halt", max(speed, STANDING_MPS)))

    @property
    def is_aside(self) -> bool:
        """True if the vehicle is parked at the kerb."""
        return self._room is not None

    @property
    def is_stranded(self) -> bool:
        """True if the vehicle has arrived and stands on the lane."""
        return self._arrived and self._room is None and self.task is None

    def prepare(self) -> None:
        """Prepare a step: hold a vehicle without a task, or let a parked one pull out once the lane is free.

        In a queue it pulls out at a gap.
        """
        self.held_by = ""
        task, room = self.task, self._room
        if task is None and not self._sim.vehicle.isStopped(self.id):
            self._brake(0.0)  # repeated in each step: SUMO sometimes drops it
        if room is None or task is None or task.kind == "halt" or task.stays:
            return
        task.steps += 1
        self.held_by = next(self._in_the_way(room, task.steps > _PATIENCE_STEPS), "")
        if self.held_by == "":
            if task.plan is not None:
                self._set_out(task.plan)
            else:
                self._set_out_along(task.edges)

    def _in_the_way(self, room: ParkingPlace, impatient: bool) -> Iterator[str]:
        """Return the vehicles that would have to brake hard if this one pulled out now.

        With `impatient`, vehicles that can brake comfortably do not count.
        """
        for other in self._kerb.passing(room.lane):
            behind = room.at_m - self.size.length_m - other.front_m
            ahead = other.front_m - other.length_m - room.at_m
            if other.id != self.id and ahead <= _GAP_M and behind < _needed_m(other, impatient):
                yield other.id

    def make_room(self, *, blocks_others: bool) -> None:
        """Park beside the present place or at the next free place ahead; a later task ends this.

        A vehicle for which others wait also leaves its edge, and moves aside where there is no kerb.
        """
        start = self.route_start()
        lane = self._graph.edges[start.edge].lanes[0]
        if not start.before and self._sim.vehicle.getLaneIndex(self.id) != lane.index:
            return  # others can pass on another lane
        stops = self._sim.vehicle.getStops(self.id, 1)
        at_m = stops[0].endPos if stops and stops[0].lane == lane.id else start.at_m
        ways = onward(self._graph, (start.edge,), REACH_M) if blocks_others else (start.edge,)
        place = self._room_ahead(ways, at_m)
        if place is None and blocks_others:
            place = self._room_ahead(ways, at_m, without_kerb=True)
        if place is None:
            return
        edges, room = place
        if edges == (start.edge,) and not start.before and room.at_m - at_m < 0.1:
            self._squeeze(room)
        else:
            self._move_up(start, edges, room)

    def _room_ahead(
        self, edges: tuple[str, ...], at_m: float, *, without_kerb: bool = False
    ) -> tuple[tuple[str, ...], ParkingPlace] | None:
        """Return the next free place at the kerb ahead within reach, with the edges that lead there; None if there is
        none."""
        ahead_m = -at_m
        for number, name in enumerate(edges):
            least = at_m if number == 0 else 0.0
            room = self._kerb.reserve(self.id, name, least, self.size.length_m, least, without_kerb=without_kerb)
            if room is not None and ahead_m + room.at_m <= REACH_M + self.size.length_m:
                return edges[: number + 1], room
            ahead_m += self._graph.edges[name].length_m
        self._kerb.cancel(self.id)
        return None

    def _squeeze(self, room: ParkingPlace) -> None:
        try:
            self._sim.vehicle.setStop(self.id, room.lane.edge, room.at_m, room.lane.index, FOREVER_S, _PARKING)
        except SumoError:
            self._kerb.cancel(self.id)
            return
        self._park(room)

    def _move_up(self, start: RouteStart, edges: tuple[str, ...], room: ParkingPlace) -> None:
        arrived = self._arrived
        self._begin(_VehicleTask("aside", REACH_M, self.odometer_m))
        self._arrived = arrived
        self._release()
        self._follow(start, edges)
        self._kerb.reserve(self.id, room.lane.edge, room.at_m, self.size.length_m, room.at_m, without_kerb=True)
        self._stop_at(room, _PARKING)

    def blocked_follower(self) -> str:
        """Return the id of a vehicle that stands close behind, or an empty string."""
        follower, gap = self._sim.vehicle.getFollower(self.id, 5.0)
        standing = follower and 0.0 <= gap < 5.0 and self._sim.vehicle.getSpeed(follower) < STANDING_MPS
        return str(follower) if standing else ""

    def step(self, standing: Container[str]) -> TaskEnd:
        """Check the task after a step, and return how it ended, if it did. `standing` holds the vehicles without a
        task."""
        self._shift()
        task = self.task
        if task is None:
            return ""
        if task.kind == "drive":
            outcome = self._driven(task, standing)
        elif task.kind == "distance":
            outcome = self._covered(task)
        elif task.kind == "aside":
            outcome = self._moved_up()
        else:
            outcome = self._halted()
        if outcome:
            self._sim.vehicle.setLaneChangeMode(self.id, _KEEP_LANE)
            self._brake(0.0)
            self.task = None
            self._arrived = outcome == "arrived" or (task.kind == "aside" and self._arrived)
        return outcome

    def progress(self) -> float | None:
        """Return the share of the task that is done; None without a task."""
        task = self.task
        if task is None:
            return None
        if task.kind == "halt":
            return 1.0 - self.speed_mps / task.total
        if task.plan is None:
            return (self.odometer_m - task.start_m) / max(task.total, 0.1)
        return 1.0 - min(max(self._left_m(task), 0.0) / task.total, 1.0)

    def update_load(self) -> None:
        """Take over the load on board. Changes below `_SAME_LOAD_KG` are ignored."""
        if abs(self.stock.load_kg - self._applied_load_kg) > _SAME_LOAD_KG:
            self._applied_load_kg = self.stock.load_kg
            self._sim.vehicle.setAccel(self.id, self.kind.acceleration(self._applied_load_kg))
            self._limit_speed()

    def drive_in(self, conditions: DrivingConditions) -> None:
        """Take over the driving conditions."""
        if conditions == self._conditions:
            return
        self._conditions = conditions
        vehicles = self._sim.vehicle
        vehicles.setSpeedFactor(self.id, conditions.speed_share)
        vehicles.setTau(self.id, TAU_S * conditions.headway_share)
        vehicles.setDecel(self.id, self.kind.decel_mps2 * conditions.grip)
        vehicles.setEmergencyDecel(self.id, EMERGENCY_MPS2 * conditions.grip)
        self._limit_speed()

    def _limit_speed(self) -> None:
        top = top_speed(self._speed_mps, self._applied_load_kg, self._payload_kg)
        self._sim.vehicle.setMaxSpeed(self.id, self._conditions.top_mps(top))

    def state(self, ahead_s: float) -> BodyState:
        """Return the state `ahead_s` after the last step, extrapolated at constant velocity."""
        body = body_state(self._sim, self.id, self.size.length_m, ahead_s)
        return msgspec.structs.replace(
            shifted(body, self._offset_m),
            pitch_deg=float(self._sim.vehicle.getSlope(self.id)),
            status=self.status,
            resources={"load_kg": self.stock.load_kg, "speed_mps": self.speed_mps, "odometer_m": self.odometer_m},
        )

    def _begin(self, task: _VehicleTask) -> None:
        self.task = task
        self._waited = 0
        self._arrived = False
        self._bound = None
        self._kerb.cancel(self.id)

    def _driven(self, task: _VehicleTask, standing: Container[str]) -> TaskEnd:
        vehicles = self._sim.vehicle
        if self._room is not None:
            return "arrived" if task.stays else ""
        self._waited = self._waited + 1 if self.speed_mps < STANDING_MPS else 0
        if vehicles.isStopped(self.id) or (self._waited > 0 and not vehicles.getStops(self.id, 1)):
            self._park(self._bound if vehicles.isStoppedParking(self.id) else None)
            return "arrived"
        if self._waited >= _WAIT_STEPS and self._left_m(task) <= QUEUE_M:
            ahead = vehicles.getLeader(self.id, 10.0)
            if ahead and ahead[0] in standing:
                self._release()
                self._brake(0.0)
                return "arrived"
        return ""

    def _moved_up(self) -> TaskEnd:
        vehicles = self._sim.vehicle
        if vehicles.isStoppedParking(self.id):
            self._park(self._bound)
            return "done"
        return "" if vehicles.getStops(self.id, 1) else "done"

    def _left_m(self, task: _VehicleTask) -> float:
        """Return the distance to the goal, metres; infinite if the route has none."""
        if task.plan is None:
            return math.inf
        goal = task.plan.goal
        left = float(self._sim.vehicle.getDrivingDistance(self.id, goal.lane.edge, goal.at_m, goal.lane.index))
        return math.inf if left < -1e6 else left

    def _shift(self) -> None:
        """Update the sideways offset for lane changes and for parking."""
        rest = 0.0
        if self._room is not None and self._sim.vehicle.isStoppedParking(self.id):
            rest = (self._room.lane.width_m + self.size.width_m) / 2.0 - _SUMO_ASIDE_M
        body = body_state(self._sim, self.id, self.size.length_m, 0.0)
        self._offset_m = self._sideways.follow(body, self._sim.step_s, rest)

    def _covered(self, task: _VehicleTask) -> TaskEnd:
        if self._room is not None:
            return ""
        left, slack = task.total - (self.odometer_m - task.start_m), min(_SLACK_M, task.total / 2.0)
        there = task.onto == "" or self._sim.vehicle.getRoadID(self.id) == task.onto
        speed = self.speed_mps
        if left <= slack and speed < _STILL_MPS and there:
            self._brake(0.0)
            return "done"
        if left <= speed * speed / (2.0 * self._braking_mps2) + speed * self._sim.step_s + 0.5:
            reachable = math.sqrt(2.0 * self._braking_mps2 * max(left - speed * self._sim.step_s, 0.0))
            self._brake(reachable if left > slack and there else (0.0 if there else 2.0))
        return ""

    def _halted(self) -> TaskEnd:
        speed = self.speed_mps
        if speed < _STILL_MPS:
            return "done"
        self._brake(max(0.0, speed - self._braking_mps2 * self._sim.step_s))
        return ""

    def _brake(self, speed_mps: float) -> None:
        self._sim.vehicle.setSpeed(self.id, speed_mps)

    def _follow(self, start: RouteStart, edges: Sequence[str]) -> None:
        """Set the route. It continues behind its end, because SUMO removes a vehicle at the very end of its route."""
        self._sim.vehicle.setRoute(self.id, [*start.before, *onward(self._graph, edges, RESERVE_M)])

    def _release(self) -> None:
        """Remove every stop and give the speed back to SUMO."""
        vehicles = self._sim.vehicle
        if vehicles.isStopped(self.id):
            vehicles.resume(self.id)
        for _ in vehicles.getStops(self.id):
            vehicles.replaceStop(self.id, 0, "")
        vehicles.setSpeed(self.id, -1)
        vehicles.setLaneChangeMode(self.id, _CHANGE_LANES)
        self._kerb.leave(self.id)
        self._room = None


def body_state(sim: Simulation, vehicle: str, length_m: float, ahead_s: float, kind: str = "") -> BodyState:
    """Return any vehicle of the simulation as a body, `ahead_s` after the last step; its position is its middle."""
    vehicles = sim.vehicle
    x, y, z = vehicles.getPosition3D(vehicle)
    heading = compass(vehicles.getAngle(vehicle))
    speed = vehicles.getSpeed(vehicle)
    slope_deg = 0.0 if sim.level else vehicles.getSlope(vehicle)
    angle = math.radians(heading)
    east, north, up = math.sin(angle), math.cos(angle), 0.0
    if slope_deg != 0.0:
        slope = math.radians(slope_deg)
        east, north, up = east * math.cos(slope), north * math.cos(slope), math.sin(slope)
    on = speed * ahead_s - length_m / 2.0
    return BodyState(
        id=vehicle,
        position=(x + east * on, y + north * on, z + up * on),
        velocity=(east * speed, north * speed, up * speed),
        heading_deg=heading,
        pitch_deg=slope_deg,
        status="driving" if speed > STANDING_MPS else "waiting",
        kind=kind,
    )


def _needed_m(other: LaneVehicle, impatient: bool) -> float:
    """Return the distance behind at which an approaching vehicle is not disturbed when this one pulls out, metres."""
    speed = other.speed_mps
    if impatient:
        return _GAP_M + speed * _REACTION_S + speed * speed / (2.0 * _DECEL_MPS2)
    return 2.0 * _GAP_M + speed * _HEADWAY_S
