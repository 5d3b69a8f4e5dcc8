"""Queues that stand where a target blocks the road: real vehicles on the lanes around it, as long as it is there.

A queue stands on every lane that passes within the target's radius: from somewhat ahead of the place back against the
traffic. Nothing tells routing about it: it has to be seen. When the target is cleared the queue drives off.
"""

from __future__ import annotations

import math
from collections.abc import Container, Iterator
from dataclasses import dataclass, field

from lingjing.engines.road.graph import Graph, RoadLane
from lingjing.engines.road.simulation import FOREVER_S, Simulation, SumoError
from lingjing.engines.road.traffic import Occupied
from lingjing.engines.road.vehicle import NOWHERE_M, body_state
from lingjing.mission.instance import Entity
from lingjing.mission.seeding import Stream
from lingjing.scene.sizes import SIZES
from lingjing.trace.records import BodyState

QUEUE_M = 45.0
"""How far a queue reaches back beyond the target's radius."""

MOST = 20
MOST_A_LANE = 9
_GAPS_M = (1.2, 2.4)
_BRAKING_MPS2 = 4.0
_MIX = ("car", "car", "car", "car", "delivery_van", "car", "truck")


@dataclass(slots=True)
class Jam:
    """A target that blocks: where, and the vehicles that stand there now, each with its kind."""

    id: str
    x: float
    y: float
    radius_m: float
    stream: Stream
    queue: dict[str, str] = field(default_factory=dict)
    blocking: bool = False
    lanes: tuple[RoadLane, ...] = ()
    rounds: int = 0


def jam_of(entity: Entity, seed: int) -> Jam:
    """The jam that a target makes; its vehicles come from a stream of its own."""
    x, y, _ = entity.position
    return Jam(entity.id, x, y, entity.blocked_m or 0.0, Stream(seed, f"road/jam/{entity.id}"))


class Congestion:
    """All jams of an episode."""

    def __init__(self, sim: Simulation, graph: Graph, jams: tuple[Jam, ...]) -> None:
        self.jams = jams
        self._sim = sim
        self._graph = graph
        self._leaving: dict[str, str] = {}

    def appear(self, jam: Jam, occupied: Occupied | None = None) -> None:
        """Let the queue stand there from the next step on, where it would not stand in somebody."""
        near = self._graph.places(jam.x, jam.y, jam.radius_m)
        jam.blocking, jam.lanes = True, tuple(place.lane for place in near)
        jam.rounds += 1
        for place in near:
            each = min(MOST_A_LANE, MOST - len(jam.queue))
            reach = math.sqrt(max(jam.radius_m**2 - place.off_m**2, 0.0))
            front = min(place.at_m + reach * 0.5, place.lane.length_m - 1.0)
            self._line_up(jam, place.lane, front, place.at_m - reach - QUEUE_M, each, occupied)

    def clear(self, jam: Jam) -> None:
        """Let the queue drive off."""
        jam.blocking = False
        for name in jam.queue:
            try:
                self._sim.vehicle.resume(name)
                self._sim.vehicle.changeTarget(name, self._graph.core[jam.stream.below(len(self._graph.core))])
            except SumoError:  # it leaves by the end of its edge
                continue
        self._leaving.update(jam.queue)
        jam.queue = {}

    @property
    def blocked(self) -> frozenset[str]:
        """The edges on which a queue stands."""
        return frozenset(lane.edge for jam in self.jams if jam.blocking for lane in jam.lanes)

    def at(self, x: float, y: float) -> Jam | None:
        """The jam whose queue stands at a place, if one does."""
        standing = (jam for jam in self.jams if jam.blocking)
        return next((jam for jam in standing if math.dist((x, y), (jam.x, jam.y)) <= 2.0 * jam.radius_m), None)

    def is_over(self, name: str) -> bool:
        """Whether a jam of that name has stood and stands no more."""
        return any(jam.id == name and not jam.blocking for jam in self.jams)

    def states(self, there: Container[str], ahead_s: float) -> Iterator[BodyState]:
        """The vehicles of all queues that are `there`, also of those that are driving off."""
        everyone = dict(self._leaving)
        for jam in self.jams:
            everyone.update(jam.queue)
        for name in [name for name in self._leaving if name not in there]:
            del self._leaving[name]
        for name, kind in everyone.items():
            if name in there:
                body = body_state(self._sim, name, SIZES[kind].length_m, ahead_s, kind)
                if body.position[0] > NOWHERE_M:
                    yield body

    def _line_up(
        self, jam: Jam, lane: RoadLane, front_m: float, back_m: float, most: int, occupied: Occupied | None
    ) -> None:
        taken = () if occupied is not None else self._standing_on(lane)
        for _ in range(most):
            kind = _MIX[jam.stream.below(len(_MIX))]
            length = SIZES[kind].length_m
            gap = jam.stream.uniform(*_GAPS_M)
            if front_m - length < max(back_m, 0.5):
                return
            free = occupied.take(lane.id, front_m, length) if occupied else _is_free(taken, front_m, length)
            if free:
                self._stand(jam, kind, lane, front_m)
            front_m -= length + gap

    def _stand(self, jam: Jam, kind: str, lane: RoadLane, front_m: float) -> None:
        name = f"traffic/{jam.id}/{jam.rounds}.{len(jam.queue) + 1}"
        following = self._graph.edges[lane.edge].links
        edges = [lane.edge, *(link.edge for link in following[:1])]
        self._sim.enter(name, edges, f"traffic/{kind}", lane.index, front_m)
        self._sim.vehicle.setStop(name, lane.edge, front_m, lane.index, FOREVER_S)
        jam.queue[name] = kind

    def _standing_on(self, lane: RoadLane) -> tuple[tuple[float, float], ...]:
        """Stretches of a lane that are taken, with what who drives there needs to brake."""
        vehicles = self._sim.vehicle
        spans = []
        for name in self._sim.lane.getLastStepVehicleIDs(lane.id):
            front, speed = vehicles.getLanePosition(name), vehicles.getSpeed(name)
            spans.append((front - vehicles.getLength(name), front + speed * speed / (2.0 * _BRAKING_MPS2) + 2.5))
        return tuple(spans)


def _is_free(taken: tuple[tuple[float, float], ...], front_m: float, length_m: float) -> bool:
    return all(front_m < lower - 1.0 or front_m - length_m > upper for lower, upper in taken)
