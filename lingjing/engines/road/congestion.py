"""Queues of standing vehicles at targets that block a road.

A queue stands on every lane that passes within the target's radius. It reaches from a point ahead of the target back
against the traffic. Routing does not know it; agents must observe it. When the target is cleared, the queue drives off.
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
"""Length of a queue beyond the target's radius, metres (chosen)."""

MOST = 20
"""Most vehicles in a queue (chosen)."""

MOST_A_LANE = 9
"""Most vehicles of a queue on one lane (chosen)."""

_GAPS_M = (1.2, 2.4)
"""Bounds of the gaps between two vehicles of a queue, metres (chosen)."""

_BRAKING_MPS2 = 4.0
"""Deceleration that a moving vehicle needs to stop before a new queue, m/s^2 (chosen)."""

_MIX = ("car", "car", "car", "car", "delivery_van", "car", "truck")
"""Kinds of vehicles, drawn with equal probability (chosen)."""


@dataclass(slots=True)
class Jam:
    """A target that blocks the road, with its queue."""

    id: str
    """Id of the target."""
    x: float
    """East coordinate of the target, metres."""
    y: float
    """North coordinate of the target, metres."""
    radius_m: float
    """Radius within which it blocks lanes, metres."""
    stream: Stream
    """Random stream of its vehicles."""
    queue: dict[str, str] = field(default_factory=dict)
    """Kinds of the vehicles that stand there now, by id."""
    blocking: bool = False
    """True while the queue stands."""
    lanes: tuple[RoadLane, ...] = ()
    """The lanes on which it stands."""
    rounds: int = 0
    """Number of times that the queue has appeared."""


def jam_of(entity: Entity, seed: int) -> Jam:
    """Return the jam of a target; it has its own random stream."""
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
        """Let the queue stand from the next step on, at the places that are free."""
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
            except SumoError:  # there is no route: it leaves at the end of its edge
                continue
        self._leaving.update(jam.queue)
        jam.queue = {}

    @property
    def blocked(self) -> frozenset[str]:
        """The edges on which a queue stands."""
        return frozenset(lane.edge for jam in self.jams if jam.blocking for lane in jam.lanes)

    def states(self, there: Container[str], ahead_s: float) -> Iterator[BodyState]:
        """Return the states of the vehicles of all queues that are in `there`, with those that are driving off."""
        kinds = dict(self._leaving)
        for jam in self.jams:
            kinds.update(jam.queue)
        for name in [name for name in self._leaving if name not in there]:
            del self._leaving[name]
        for name, kind in kinds.items():
            if name in there:
                body = body_state(self._sim, name, SIZES[kind].length_m, ahead_s, kind)
                if body.position[0] > NOWHERE_M:
                    yield body

    def _line_up(
        self, jam: Jam, lane: RoadLane, front_m: float, back_m: float, most: int, occupied: Occupied | None
    ) -> None:
        spans = () if occupied is not None else self._standing_on(lane)
        for _ in range(most):
            kind = _MIX[jam.stream.below(len(_MIX))]
            length = SIZES[kind].length_m
            gap = jam.stream.uniform(*_GAPS_M)
            if front_m - length < max(back_m, 0.5):
                return
            free = occupied.take(lane.id, front_m, length) if occupied else _is_free(spans, front_m, length)
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
        """Return the occupied stretches of a lane, (from, to) metres, with the stopping distances of moving
        vehicles."""
        vehicles = self._sim.vehicle
        spans = []
        for name in self._sim.lane.getLastStepVehicleIDs(lane.id):
            front, speed = vehicles.getLanePosition(name), vehicles.getSpeed(name)
            spans.append((front - vehicles.getLength(name), front + speed * speed / (2.0 * _BRAKING_MPS2) + 2.5))
        return tuple(spans)


def _is_free(spans: tuple[tuple[float, float], ...], front_m: float, length_m: float) -> bool:
    return all(front_m < lower - 1.0 or front_m - length_m > upper for lower, upper in spans)
