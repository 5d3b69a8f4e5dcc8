"""The kerb: parking places beside the road, and the vehicles that pass them.

A place is a stretch beside a lane, named by the position of the vehicle's front along the lane. A vehicle reserves its
place before it arrives, so two vehicles with one destination park one behind the other. Bridges, tunnels and junctions
have no kerb.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from lingjing.engines.road.graph import Graph, RoadLane
from lingjing.engines.road.simulation import Simulation
from lingjing.scene.tiles import Tiles

GAP_M = 3.5
"""Gap between two parked vehicles, metres. A vehicle that pulls out sideways at walking speed passes the one
before it."""

REACH_M = 40.0
"""Largest distance of a parking place from the requested one, metres (chosen)."""

SIGHT_M = 80.0
"""Distance back along the road within which approaching vehicles matter to one that pulls out, metres (chosen)."""

_STEP_M = 0.5
"""Distance between two candidates in the search for a place, metres (chosen)."""
_END_M = 0.2
"""Distance of a stop from the end of its lane, metres (chosen)."""


@dataclass(frozen=True, slots=True)
class ParkingPlace:
    """A place at the kerb."""

    lane: RoadLane
    """The lane beside it."""
    at_m: float
    """Position of the vehicle's front along the lane, metres."""


@dataclass(frozen=True, slots=True)
class LaneVehicle:
    """A vehicle on a lane."""

    id: str
    """Id in the simulation."""
    front_m: float
    """Position of its front from the lane's start, metres; negative before the lane."""
    length_m: float
    """Length, metres."""
    speed_mps: float
    """Speed, m/s."""


class Kerb:
    """The occupied and reserved places beside all lanes."""

    def __init__(self, sim: Simulation, graph: Graph, tiles: Tiles) -> None:
        self._sim = sim
        self._graph = graph
        self._tiles = tiles
        self._without_kerb: dict[str, bool] = {}
        self._standing: dict[str, tuple[str, float, float]] = {}
        self._reserved: dict[str, tuple[str, float, float]] = {}
        self._before: dict[str, list[str]] = {}

    def reserve(
        self, name: str, edge: str, front_m: float, length_m: float, least_m: float = 0.0, *, without_kerb: bool = False
    ) -> ParkingPlace | None:
        """Reserve the free place nearest to a front position, not before `least_m`; None if none is near.

        `without_kerb` also allows an edge without a kerb, for a vehicle that would block the road otherwise.
        """
        self._reserved.pop(name, None)
        lane = self._graph.edges[edge].lanes[0]
        if not without_kerb and self._has_no_kerb(lane):
            return None
        spans = [span for owner, span in self._spans() if owner != name and span[0] == lane.id]
        lowest, highest = max(least_m, min(length_m, lane.length_m - _END_M)), lane.length_m - _END_M
        for at_m in _outwards(min(max(front_m, lowest), highest)):
            free = all(at_m < low - GAP_M or at_m - length_m > high + GAP_M for _, low, high in spans)
            if free and lowest <= at_m <= highest:
                self._reserved[name] = (lane.id, at_m - length_m, at_m)
                return ParkingPlace(lane, at_m)
        return None

    def take(self, name: str, room: ParkingPlace, length_m: float) -> None:
        """Record that a vehicle stands at a place."""
        self._reserved.pop(name, None)
        self._standing[name] = (room.lane.id, room.at_m - length_m, room.at_m)

    def leave(self, name: str) -> None:
        """Record that a vehicle has left its place."""
        self._standing.pop(name, None)

    def cancel(self, name: str) -> None:
        """Cancel the reservation of a vehicle."""
        self._reserved.pop(name, None)

    def passing(self, lane: RoadLane) -> Iterator[LaneVehicle]:
        """Return the vehicles that are on the lane, just leave it or approach it within `SIGHT_M`."""
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

    def _has_no_kerb(self, lane: RoadLane) -> bool:
        """Return whether the lane's edge has no kerb."""
        if lane.edge not in self._without_kerb:
            near = self._tiles.near(*lane.shape[0], 1.0)
            road = next((road for tile in near for road in tile.roads if road.id == lane.edge), None)
            self._without_kerb[lane.edge] = road is not None and (road.bridge or road.tunnel)
        return self._without_kerb[lane.edge]

    def _spans(self) -> Iterator[tuple[str, tuple[str, float, float]]]:
        yield from self._standing.items()
        yield from self._reserved.items()

    def _lanes_before(self, lane: str) -> list[str]:
        """Return the lanes that lead onto a lane, with those inside junctions."""
        if not self._before:
            lanes = self._sim.lane
            for name in lanes.getIDList():
                for to, _, _, _, via, *_ in lanes.getLinks(name):
                    self._before.setdefault(via or to, []).append(name)
        return self._before.get(lane, [])


def _outwards(middle_m: float) -> Iterator[float]:
    """Yield positions along a lane by their distance from a middle, metres. The rear one of two equally far ones comes
    first."""
    yield middle_m
    for number in range(1, round(REACH_M / _STEP_M) + 1):
        yield middle_m - number * _STEP_M
        yield middle_m + number * _STEP_M
