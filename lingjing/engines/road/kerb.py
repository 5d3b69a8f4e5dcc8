"""The kerb: where vehicles of the mission park beside the road, who stands there, and who comes by in the lane.

A place is a stretch of the lane beside which a vehicle stands, named by the metres of its front along the lane. Whoever
is on the way to a place has it promised, so that two vehicles sent to one door park one behind the other. There is no
kerb on bridges, in tunnels and within junctions.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from lingjing.engines.road.graph import Graph, RoadLane
from lingjing.engines.road.simulation import Simulation
from lingjing.scene.tiles import Tiles

GAP_M = 3.5
"""Between two that are parked: who pulls out at walking speed sideways passes the one before it."""

REACH_M = 40.0
"""A place this far from the one asked for is still there."""

SIGHT_M = 80.0
"""How far back along the road one looks before pulling out."""

_STEP_M = 0.5
_END_M = 0.2
"""What a stop keeps from the end of its lane."""


@dataclass(frozen=True, slots=True)
class ParkingPlace:
    """A place at the kerb: the lane beside it and metres of the front along it."""

    lane: RoadLane
    at_m: float


@dataclass(frozen=True, slots=True)
class LaneVehicle:
    """A vehicle in the lane: metres of its front from the lane's start (negative: not on it yet), length and speed."""

    id: str
    front_m: float
    length_m: float
    speed_mps: float


class Kerb:
    """Who stands where beside the lanes, and who is going to."""

    def __init__(self, sim: Simulation, graph: Graph, tiles: Tiles) -> None:
        self._sim = sim
        self._graph = graph
        self._tiles = tiles
        self._bare: dict[str, bool] = {}
        self._standing: dict[str, tuple[str, float, float]] = {}
        self._promised: dict[str, tuple[str, float, float]] = {}
        self._before: dict[str, list[str]] = {}

    def promise(
        self, name: str, edge: str, front_m: float, length_m: float, least_m: float = 0.0, *, bare: bool = False
    ) -> ParkingPlace | None:
        """Keep the free place nearest to a front for a vehicle, not before `least_m`; None: none is near.

        `bare`: also beside an edge without a kerb, for who would block the road otherwise.
        """
        self._promised.pop(name, None)
        lane = self._graph.edges[edge].lanes[0]
        if not bare and self._is_bare(lane):
            return None
        taken = [span for who, span in self._spans() if who != name and span[0] == lane.id]
        lowest, highest = max(least_m, min(length_m, lane.length_m - _END_M)), lane.length_m - _END_M
        for at_m in _outwards(min(max(front_m, lowest), highest)):
            free = all(at_m < low - GAP_M or at_m - length_m > high + GAP_M for _, low, high in taken)
            if free and lowest <= at_m <= highest:
                self._promised[name] = (lane.id, at_m - length_m, at_m)
                return ParkingPlace(lane, at_m)
        return None

    def take(self, name: str, room: ParkingPlace, length_m: float) -> None:
        """A vehicle stands there now."""
        self._promised.pop(name, None)
        self._standing[name] = (room.lane.id, room.at_m - length_m, room.at_m)

    def leave(self, name: str) -> None:
        """A vehicle stands there no more."""
        self._standing.pop(name, None)

    def forgo(self, name: str) -> None:
        """A vehicle is not going to its place any more."""
        self._promised.pop(name, None)

    def passing(self, lane: RoadLane) -> Iterator[LaneVehicle]:
        """Who is on the lane, is just leaving it or comes towards it within sight."""
        yield from self._on(lane.id, 0.0)
        for _, _, _, _, via, *_ in self._sim.lane.getLinks(lane.id):
            if via:
                yield from self._on(via, lane.length_m)
        ahead, seen = [(lane.id, 0.0)], {lane.id}
        for name, offset_m in ahead:
            for before in self._lanes_before(name):
                if before in seen:
                    continue
                seen.add(before)
                start_m = offset_m - float(self._sim.lane.getLength(before))
                yield from self._on(before, start_m)
                if start_m > -SIGHT_M:
                    ahead.append((before, start_m))

    def _on(self, lane: str, start_m: float) -> Iterator[LaneVehicle]:
        vehicles = self._sim.vehicle
        for name in self._sim.lane.getLastStepVehicleIDs(lane):
            front, length = start_m + vehicles.getLanePosition(name), vehicles.getLength(name)
            yield LaneVehicle(name, front, length, vehicles.getSpeed(name))

    def _is_bare(self, lane: RoadLane) -> bool:
        """Whether its edge has no kerb."""
        if lane.edge not in self._bare:
            near = self._tiles.near(*lane.shape[0], 1.0)
            road = next((road for tile in near for road in tile.roads if road.id == lane.edge), None)
            self._bare[lane.edge] = road is not None and (road.bridge or road.tunnel)
        return self._bare[lane.edge]

    def _spans(self) -> Iterator[tuple[str, tuple[str, float, float]]]:
        yield from self._standing.items()
        yield from self._promised.items()

    def _lanes_before(self, lane: str) -> list[str]:
        """The lanes, those within junctions included, from which one drives onto a lane."""
        if not self._before:
            lanes = self._sim.lane
            for name in lanes.getIDList():
                for to, _, _, _, via, *_ in lanes.getLinks(name):
                    self._before.setdefault(via or to, []).append(name)
        return self._before.get(lane, [])


def _outwards(middle_m: float) -> Iterator[float]:
    """Metres along a lane by their distance from a middle; of two that are as far the one behind first."""
    yield middle_m
    for number in range(1, round(REACH_M / _STEP_M) + 1):
        yield middle_m - number * _STEP_M
        yield middle_m + number * _STEP_M
