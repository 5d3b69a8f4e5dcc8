"""Background traffic: a fixed number of vehicles that drive from one random edge to the next.

A vehicle near the end of its trip gets a new destination, so vehicles do not appear or vanish in view. A vehicle that
has stood for minutes in a jam starts again elsewhere. Vehicles drive around edges with a queue if there is a way.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Container, Iterator
from dataclasses import dataclass
from functools import partial
from itertools import takewhile

from lingjing.engines.road.driving_conditions import DRY_DAY, DrivingConditions
from lingjing.engines.road.graph import Graph
from lingjing.engines.road.kinds import EMERGENCY_MPS2, TAU_S, VEHICLE_KINDS, declare
from lingjing.engines.road.lateral_motion import LateralOffsets, shifted
from lingjing.engines.road.routing import NO_THROUGH_S
from lingjing.engines.road.simulation import Simulation, SumoError
from lingjing.engines.road.vehicle import NOWHERE_M, body_state
from lingjing.mission.seeding import Stream
from lingjing.scene.sizes import SIZES
from lingjing.trace.records import BodyState

MIX = (("car", 70), ("delivery_van", 10), ("truck", 8), ("motorcycle", 7), ("bus", 5))
"""Kinds of background vehicles and their shares in percent (chosen)."""

CYCLIST = "bicycle"
"""Kind of background cyclists, and SUMO's vehicle class of them: SUMO's own model of bicycles on the road."""

_KINDS = (*(name for name, _ in MIX), CYCLIST)
"""All kinds of background vehicles."""

PATIENCE_S = 150.0
"""Waiting time after which a background vehicle is removed and starts elsewhere, seconds (chosen)."""

REACTION_S = 0.3
"""Interval of a background driver's decisions, seconds: human-like, and half the cost of a decision in each step."""

BLOCKED_S = 100_000.0
"""Travel time that SUMO's routing assumes on an edge with a queue, seconds: more than any detour."""

_GAP_M = 3.0
"""Gap between vehicles that are placed before time 0, metres (chosen)."""

_ROUND_S = 1.0
"""Time in which every vehicle is checked once, seconds (chosen)."""

_NEARLY_THERE = 3
"""Edges before the end of a route at which a vehicle gets a new destination (chosen)."""

_TRIES = 30
"""Draws of a place or destination before a vehicle is skipped (chosen)."""


@dataclass(slots=True)
class _BackgroundVehicle:
    """A background vehicle."""

    id: str
    """Id in the simulation."""
    kind: str
    """Name of its kind."""
    edges: int
    """Number of edges of its route."""


class Occupied:
    """The occupied stretches of lanes while vehicles are placed before time 0."""

    def __init__(self) -> None:
        self._taken: dict[str, list[tuple[float, float]]] = {}

    def take(self, lane: str, front_m: float, length_m: float, gap_m: float = _GAP_M) -> bool:
        """Occupy the length behind a front position if it is free with a gap before and behind; return whether it
        was."""
        low, high = front_m - length_m - gap_m, front_m + gap_m
        spans = self._taken.setdefault(lane, [])
        if any(low < upper and high > lower for lower, upper in spans):
            return False
        spans.append((front_m - length_m, front_m))
        return True

    def add(self, lane: str, front_m: float, length_m: float) -> None:
        """Occupy a stretch, whether it is free or not."""
        self._taken.setdefault(lane, []).append((front_m - length_m, front_m))


class Traffic:
    """The background vehicles of an episode, drawn from one random stream."""

    def __init__(self, sim: Simulation, graph: Graph, seed: int) -> None:
        self._sim = sim
        self._graph = graph
        self._stream = Stream(seed, "road/traffic")
        self._movers: list[_BackgroundVehicle] = []
        self._blocked: frozenset[str] = frozenset()
        self._turn = 0
        self._round = round(_ROUND_S / sim.step_s)
        self._conditions = DRY_DAY
        self._sideways = LateralOffsets()
        for edge in graph.edges.values():
            if not edge.through:
                sim.edge.adaptTraveltime(edge.id, self._usual_s(edge.id))
        for name in _KINDS:
            declare(sim, f"traffic/{name}", VEHICLE_KINDS[name], VEHICLE_KINDS[name].top_mps, reaction_s=REACTION_S)
        sim.vehicletype.setVehicleClass(f"traffic/{CYCLIST}", CYCLIST)

    def populate(self, count: int, occupied: Occupied) -> None:
        """Place up to `count` vehicles at random places; full streets take fewer."""
        for number in range(count if self._graph.core else 0):
            self._populate(f"traffic/{number + 1}", self._draw_kind(), occupied)

    def populate_cyclists(self, count: int, occupied: Occupied) -> None:
        """Place up to `count` cyclists at random places."""
        for number in range(count if self._graph.core else 0):
            self._populate(f"cyclist/{number + 1}", CYCLIST, occupied)

    def step(self) -> None:
        """Give new destinations to a share of the vehicles, and insert again those that SUMO has removed."""
        arrived = set(self._sim.simulation.getArrivedIDList()) if self._movers else set()
        for mover in self._movers:
            if mover.id in arrived:
                self._enter(mover)
        for mover in self._movers[self._turn :: self._round]:
            if mover.id not in arrived:
                self._check(mover)
        self._turn = (self._turn + 1) % self._round

    def drive_in(self, conditions: DrivingConditions) -> None:
        """Take over the driving conditions: for the kinds of vehicles, and for the vehicles on the road."""
        if conditions == self._conditions:
            return
        self._conditions = conditions
        types, vehicles = self._sim.vehicletype, self._sim.vehicle
        for name in _KINDS:
            kind, type_id = VEHICLE_KINDS[name], f"traffic/{name}"
            types.setSpeedFactor(type_id, conditions.speed_share)
            types.setTau(type_id, TAU_S * conditions.headway_share)
            types.setDecel(type_id, kind.decel_mps2 * conditions.grip)
            types.setEmergencyDecel(type_id, EMERGENCY_MPS2 * conditions.grip)
            types.setMaxSpeed(type_id, min(kind.top_mps, conditions.sight_mps))
        there = frozenset(vehicles.getIDList())
        for mover in self._movers:
            if mover.id in there:  # a later one has the factor of its kind
                vehicles.setSpeedFactor(mover.id, conditions.speed_share)

    def set_blocked(self, edges: Collection[str]) -> None:
        """Set the blocked edges, and change the routes that use them."""
        blocked = frozenset(edges)
        if blocked == self._blocked:
            return
        for name in sorted(self._blocked - blocked):
            self._sim.edge.adaptTraveltime(name, self._usual_s(name))
        for name in sorted(blocked - self._blocked):
            self._sim.edge.adaptTraveltime(name, BLOCKED_S)
        fresh, self._blocked = blocked - self._blocked, blocked
        for mover in self._movers if fresh else ():
            self._evade(mover, fresh)

    def states(self, there: Container[str], ahead_s: float, after_s: float) -> Iterator[BodyState]:
        """Return the states of the background vehicles that are in `there`.

        `ahead_s` is the time after the last step, `after_s` the time since the last call.
        """
        for mover in self._movers:
            if mover.id in there:
                length = SIZES[mover.kind].length_m
                body = body_state(self._sim, mover.id, length, ahead_s, mover.kind)
                if body.position[0] > NOWHERE_M:
                    yield shifted(body, self._sideways.follow(body, after_s))

    def _populate(self, name: str, kind: str, occupied: Occupied) -> None:
        mover = _BackgroundVehicle(name, kind, 1)
        length = SIZES[mover.kind].length_m
        for _ in range(_TRIES):
            edge = self._graph.edges[self._draw_edge()]
            lane = edge.lanes[self._stream.below(len(edge.lanes))]
            front = length + self._stream.unit() * max(lane.length_m - length, 0.0)
            if front <= lane.length_m and occupied.take(lane.id, front, length):
                self._add(mover, edge.id, lane.index, front)
                self._movers.append(mover)
                return

    def _enter(self, mover: _BackgroundVehicle) -> None:
        """Insert a vehicle on an empty edge; if none is drawn, the next step tries again."""
        for _ in range(_TRIES):
            edge = self._graph.edges[self._draw_edge()]
            length = SIZES[mover.kind].length_m
            if self._sim.edge.getLastStepVehicleNumber(edge.id) == 0 and edge.length_m > length + 1.0:
                self._add(mover, edge.id, edge.lanes[0].index, length)
                return

    def _add(self, mover: _BackgroundVehicle, edge: str, lane: int, front_m: float) -> None:
        self._sideways.forget(mover.id)
        self._sim.enter(mover.id, [edge], f"traffic/{mover.kind}", lane, front_m)
        self._redirect(mover)

    def _check(self, mover: _BackgroundVehicle) -> None:
        vehicles = self._sim.vehicle
        try:
            index = vehicles.getRouteIndex(mover.id)
        except SumoError:  # SUMO could not insert it
            self._enter(mover)
            return
        if index >= mover.edges - _NEARLY_THERE:
            self._redirect(mover)
        elif vehicles.getWaitingTime(mover.id) > PATIENCE_S:
            vehicles.remove(mover.id)
            self._enter(mover)

    def _redirect(self, mover: _BackgroundVehicle) -> None:
        vehicles = self._sim.vehicle
        for _ in range(_TRIES):
            edge = self._draw_edge()
            try:
                is_new = self._reroute(mover, partial(vehicles.changeTarget, mover.id, edge))
            except SumoError:  # this vehicle has no way there
                continue
            if is_new and mover.edges > _NEARLY_THERE:
                return

    def _reroute(self, mover: _BackgroundVehicle, change: Callable[[], None]) -> bool:
        """Change the route of a vehicle and return True, or keep the old route and return False.

        The old route stays if the vehicle passes the end of the routes' common part before its next decision. Until
        then it drives as it decided before, and SUMO 1.28 crashes if a vehicle is beside its route (on short edges of
        roundabouts).
        """
        vehicles = self._sim.vehicle
        before = self._route_ahead(mover.id)
        change()
        after = self._route_ahead(mover.id)
        common = sum(1 for _ in takewhile(lambda edges: edges[0] == edges[1], zip(before, after, strict=False)))
        lane, time_s = vehicles.getLaneID(mover.id), REACTION_S + self._sim.step_s
        decided_m = (vehicles.getSpeed(mover.id) + 0.5 * vehicles.getAccel(mover.id) * time_s) * time_s
        free_m = self._sim.lane.getLength(lane) - vehicles.getLanePosition(mover.id) if lane else decided_m
        free_m += sum(self._sim.lane.getLength(f"{edge}_0") for edge in before[1:common])
        is_possible = free_m >= decided_m or common == len(before)
        if not is_possible:
            vehicles.setRoute(mover.id, before)
        mover.edges = len(vehicles.getRoute(mover.id))
        return is_possible

    def _route_ahead(self, name: str) -> tuple[str, ...]:
        """Return the edges of a vehicle's route from the one that it is on, or that it has left into a junction."""
        route: tuple[str, ...] = self._sim.vehicle.getRoute(name)
        return route[max(0, self._sim.vehicle.getRouteIndex(name)) :]

    def _evade(self, mover: _BackgroundVehicle, blocked: frozenset[str]) -> None:
        try:
            if blocked.intersection(self._route_ahead(mover.id)[1:]):
                self._reroute(mover, partial(self._sim.vehicle.rerouteTraveltime, mover.id))
        except SumoError:  # there is no way around, or the vehicle is not inserted yet: its route stays
            return

    def _usual_s(self, name: str) -> float:
        """Return the travel time of an edge without a queue, seconds."""
        edge = self._graph.edges[name]
        return edge.time_s if edge.through else edge.time_s + NO_THROUGH_S

    def _draw_edge(self) -> str:
        return self._graph.core[self._stream.below(len(self._graph.core))]

    def _draw_kind(self) -> str:
        drawn = self._stream.below(sum(share for _, share in MIX))
        for name, share in MIX:
            drawn -= share
            if drawn < 0:
                return name
        raise AssertionError("shares add up to the bound of the draw")
