"""Background traffic: a number of vehicles that are kept driving from one random edge to the next.

A vehicle that comes near the end of its trip is given a new destination, so none appears or vanishes while it is
looked at; one that stood for minutes in a jam that does not dissolve is taken out and starts elsewhere. Edges on which
a queue stands are driven around where a way around exists.
"""

from __future__ import annotations

from collections.abc import Collection, Container, Iterator
from dataclasses import dataclass

from lingjing.engines.road.graph import Graph
from lingjing.engines.road.kinds import VEHICLE_KINDS, declare
from lingjing.engines.road.lateral_motion import LateralOffsets, shifted
from lingjing.engines.road.routing import NO_THROUGH_S
from lingjing.engines.road.simulation import Simulation, SumoError
from lingjing.engines.road.vehicle import NOWHERE_M, body_state
from lingjing.mission.seeding import Stream
from lingjing.scene.sizes import SIZES
from lingjing.trace.records import BodyState

MIX = (("car", 70), ("delivery_van", 10), ("truck", 8), ("motorcycle", 7), ("bus", 5))
"""Kinds of background vehicles and their shares in percent."""

PATIENCE_S = 150.0
"""Standing this long, a background vehicle is taken out of the jam."""

REACTION_S = 0.3
"""How often a background driver decides: like a person, and at half the price of deciding in each step."""

BLOCKED_S = 100_000.0
_GAP_M = 3.0
_ROUND = 10
_NEARLY_THERE = 3
_TRIES = 30


@dataclass(slots=True)
class BackgroundVehicle:
    """A background vehicle: its id, its kind, how many edges its route has."""

    id: str
    kind: str
    edges: int


class Occupied:
    """Which parts of lanes are taken while vehicles are put on the road before time 0."""

    def __init__(self) -> None:
        self._taken: dict[str, list[tuple[float, float]]] = {}

    def take(self, lane: str, front_m: float, length_m: float, gap_m: float = _GAP_M) -> bool:
        """Take the length behind a front if it is free, with a gap before and behind."""
        low, high = front_m - length_m - gap_m, front_m + gap_m
        spans = self._taken.setdefault(lane, [])
        if any(low < upper and high > lower for lower, upper in spans):
            return False
        spans.append((front_m - length_m, front_m))
        return True

    def add(self, lane: str, front_m: float, length_m: float) -> None:
        """Take it, free or not."""
        self._taken.setdefault(lane, []).append((front_m - length_m, front_m))


class Traffic:
    """The background vehicles of an episode, drawn from one stream."""

    def __init__(self, sim: Simulation, graph: Graph, seed: int) -> None:
        self._sim = sim
        self._graph = graph
        self._stream = Stream(seed, "road/traffic")
        self._movers: list[BackgroundVehicle] = []
        self._blocked: frozenset[str] = frozenset()
        self._turn = 0
        self._sideways = LateralOffsets()
        for edge in graph.edges.values():
            if not edge.through:
                sim.edge.adaptTraveltime(edge.id, self._usual_s(edge.id))
        for name, _ in MIX:
            declare(sim, f"traffic/{name}", VEHICLE_KINDS[name], VEHICLE_KINDS[name].top_mps, reaction_s=REACTION_S)

    def populate(self, count: int, occupied: Occupied) -> None:
        """Put vehicles at random places; fewer where the streets are full."""
        for number in range(count if self._graph.core else 0):
            self._populate(f"traffic/{number + 1}", occupied)

    def step(self) -> None:
        """Give new destinations, a tenth of the vehicles each step; bring back those that got lost."""
        arrived = set(self._sim.simulation.getArrivedIDList()) if self._movers else set()
        for mover in self._movers:
            if mover.id in arrived:
                self._enter(mover)
        for mover in self._movers[self._turn :: _ROUND]:
            if mover.id not in arrived:
                self._look_after(mover)
        self._turn = (self._turn + 1) % _ROUND

    def keep_off(self, edges: Collection[str]) -> None:
        """The edges that are blocked now: routes are changed where they lead there."""
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
        """Every background vehicle that is `there`, `ahead_s` after the last step, `after_s` after they were last asked
        for."""
        for mover in self._movers:
            if mover.id in there:
                length = SIZES[mover.kind].length_m
                body = body_state(self._sim, mover.id, length, ahead_s, mover.kind)
                if body.position[0] > NOWHERE_M:
                    yield shifted(body, self._sideways.follow(body, after_s))

    def _populate(self, name: str, occupied: Occupied) -> None:
        mover = BackgroundVehicle(name, self._draw_kind(), 1)
        length = SIZES[mover.kind].length_m
        for _ in range(_TRIES):
            edge = self._graph.edges[self._draw_edge()]
            lane = edge.lanes[self._stream.below(len(edge.lanes))]
            front = length + self._stream.unit() * max(lane.length_m - length, 0.0)
            if front <= lane.length_m and occupied.take(lane.id, front, length):
                self._add(mover, edge.id, lane.index, front)
                self._movers.append(mover)
                return

    def _enter(self, mover: BackgroundVehicle) -> None:
        """Start again on an edge that is empty, or be tried again at the next step."""
        for _ in range(_TRIES):
            edge = self._graph.edges[self._draw_edge()]
            length = SIZES[mover.kind].length_m
            if self._sim.edge.getLastStepVehicleNumber(edge.id) == 0 and edge.length_m > length + 1.0:
                self._add(mover, edge.id, edge.lanes[0].index, length)
                return

    def _add(self, mover: BackgroundVehicle, edge: str, lane: int, front_m: float) -> None:
        self._sideways.forget(mover.id)
        self._sim.enter(mover.id, [edge], f"traffic/{mover.kind}", lane, front_m)
        self._redirect(mover)

    def _look_after(self, mover: BackgroundVehicle) -> None:
        vehicles = self._sim.vehicle
        try:
            index = vehicles.getRouteIndex(mover.id)
        except SumoError:  # it could not enter
            self._enter(mover)
            return
        if index >= mover.edges - _NEARLY_THERE:
            self._redirect(mover)
        elif vehicles.getWaitingTime(mover.id) > PATIENCE_S:
            vehicles.remove(mover.id)
            self._enter(mover)

    def _redirect(self, mover: BackgroundVehicle) -> None:
        vehicles = self._sim.vehicle
        for _ in range(_TRIES):
            try:
                vehicles.changeTarget(mover.id, self._draw_edge())
            except SumoError:  # no way there for this one
                continue
            mover.edges = len(vehicles.getRoute(mover.id))
            if mover.edges > _NEARLY_THERE:
                return

    def _evade(self, mover: BackgroundVehicle, blocked: frozenset[str]) -> None:
        vehicles = self._sim.vehicle
        try:
            route = vehicles.getRoute(mover.id)
            if blocked.intersection(route[max(0, vehicles.getRouteIndex(mover.id)) + 1 :]):
                vehicles.rerouteTraveltime(mover.id)
                mover.edges = len(vehicles.getRoute(mover.id))
        except SumoError:  # no way around, or not on the road yet: it will wait its turn
            return

    def _usual_s(self, name: str) -> float:
        """What an edge costs on which no queue stands."""
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
