"""The network as the engine asks for it: edges, their lanes, the links between them, and the nearest lane to a point.

Read once from the running simulation. Only what a passenger car may use counts. Positions along a lane are SUMO's:
metres from its start, scaled where a lane's length is not that of its drawn shape.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

from lingjing.engines.road.simulation import Simulation
from lingjing.mission.geometry2d import Vector2
from lingjing.scene.camera_geometry import turn_deg
from lingjing.scene.lines import LinePlace, project
from lingjing.scene.network import THROUGH_KEY

CAR = "passenger"
_CELL_M = 50.0
_NEAR_CELL_M = 4.0
_BESIDE_M = 12.0
_ALONG_DEG = 75.0


@dataclass(frozen=True, slots=True)
class RoadLink:
    """A way from the end of an edge onto another: SUMO's direction (`s`, `l`, `r`, `L`, `R`, `t`), metres between."""

    edge: str
    direction: str
    length_m: float


@dataclass(frozen=True, slots=True)
class RoadLane:
    """One lane that cars may use; `index` counts from the right, `shape` is its centre line."""

    id: str
    edge: str
    index: int
    shape: tuple[Vector2, ...]
    length_m: float
    width_m: float


@dataclass(frozen=True, slots=True)
class RoadEdge:
    """One direction of a street. `lanes` are those that cars may use; `links` one to each edge that follows.

    `through` is False where only traffic that begins or ends there may drive.
    """

    id: str
    lanes: tuple[RoadLane, ...]
    links: tuple[RoadLink, ...]
    length_m: float
    speed_mps: float
    through: bool = True

    @property
    def time_s(self) -> float:
        """How long it takes to drive along at the permitted speed."""
        return self.length_m / max(self.speed_mps, 0.1)


@dataclass(frozen=True, slots=True)
class LanePoint:
    """A point on a lane: metres from the lane's start, how far the point asked for lies off, the lane's heading."""

    lane: RoadLane
    at_m: float
    off_m: float
    heading_deg: float


@dataclass(frozen=True)
class Graph:
    """All edges by id in the network's order, and an index of their lanes by squares."""

    edges: Mapping[str, RoadEdge]
    _cells: Mapping[tuple[int, int], tuple[RoadLane, ...]]
    _near: dict[tuple[int, int], bool] = field(default_factory=dict)

    @cached_property
    def core(self) -> tuple[str, ...]:
        """The edges of the largest part of the network in which every edge can be reached from every other."""
        return max(_components(self.edges), key=len, default=())

    def places(self, x: float, y: float, within_m: float) -> tuple[LanePoint, ...]:
        """The nearest point of each lane within a distance, nearest first (ties in the network's order)."""
        near = ((lane, project(lane.shape, x, y)) for lane in self._lanes_near(x, y, within_m))
        found = (_on_lane(lane, place) for lane, place in near if place.off_m <= within_m)
        return tuple(sorted(found, key=lambda place: place.off_m))

    def nearest(self, x: float, y: float, heading_deg: float | None = None, most_m: float = 2000.0) -> LanePoint | None:
        """The nearest lane point within `most_m`; with a heading, of the lanes beside it one that leads that way."""
        reach = min(_CELL_M, most_m)
        while not (near := self.places(x, y, reach)):
            if reach >= most_m:
                return None
            reach = min(2.0 * reach, most_m)
        close = (place for place in near if place.off_m <= near[0].off_m + _BESIDE_M)
        if heading_deg is None:
            return near[0]
        return next((one for one in close if abs(turn_deg(heading_deg, one.heading_deg)) < _ALONG_DEG), near[0])

    def is_near_road(self, x: float, y: float) -> bool:
        """Whether a lane's edge is within a few metres; answers come from a memory of small squares."""
        cell = (math.floor(x / _NEAR_CELL_M), math.floor(y / _NEAR_CELL_M))
        known = self._near.get(cell)
        if known is None:
            middle = ((cell[0] + 0.5) * _NEAR_CELL_M, (cell[1] + 0.5) * _NEAR_CELL_M)
            known = any(place.off_m <= place.lane.width_m / 2.0 + 8.0 for place in self.places(*middle, within_m=12.0))
            self._near[cell] = known
        return known

    def _lanes_near(self, x: float, y: float, within_m: float) -> Iterator[RoadLane]:
        columns = range(math.floor((x - within_m) / _CELL_M), math.floor((x + within_m) / _CELL_M) + 1)
        rows = range(math.floor((y - within_m) / _CELL_M), math.floor((y + within_m) / _CELL_M) + 1)
        lanes = (lane for column in columns for row in rows for lane in self._cells.get((column, row), ()))
        return iter({lane.id: lane for lane in lanes}.values())


def read_graph(sim: Simulation) -> Graph:
    """The graph of the network that the simulation has loaded."""
    lanes: dict[str, list[RoadLane]] = {}
    links: dict[str, dict[str, RoadLink]] = {}
    speeds: dict[str, float] = {}
    for name in sim.lane.getIDList():
        if name.startswith(":") or not _drivable(sim, name):
            continue
        edge = sim.lane.getEdgeID(name)
        lanes.setdefault(edge, []).append(_lane(sim, name, edge))
        speeds[edge] = sim.lane.getMaxSpeed(name)
        following = links.setdefault(edge, {})
        for to, _, _, _, via, _, direction, _ in sim.lane.getLinks(name):
            if not to.startswith(":") and _drivable(sim, to):
                target = sim.lane.getEdgeID(to)
                following.setdefault(target, RoadLink(target, direction, _through(sim, via)))
    edges = _without_traps(
        {
            name: RoadEdge(
                name,
                tuple(own),
                tuple(links[name].values()),
                min(lane.length_m for lane in own),
                speeds[name],
                sim.edge.getParameter(name, THROUGH_KEY) != "no",
            )
            for name, own in lanes.items()
        }
    )
    return Graph(edges, _indexed(lane for edge in edges.values() for lane in edge.lanes))


def elevations(sim: Simulation, graph: Graph) -> tuple[float, float]:
    """Elevations of the lowest and the highest point of all lanes, metres."""
    found = [0.0] if not graph.edges else []
    for lane in (lane for edge in graph.edges.values() for lane in edge.lanes):
        steps = [math.dist(*pair) for pair in itertools.pairwise(lane.shape)]
        scale = lane.length_m / (sum(steps) or 1.0)
        for at_m in (0.0, *itertools.accumulate(steps)):
            at = min(at_m * scale, lane.length_m)
            found.append(float(sim.simulation.convert3D(lane.edge, at, lane.index)[2]))
    return min(found), max(found)


def _on_lane(lane: RoadLane, place: LinePlace[Vector2]) -> LanePoint:
    at_m = min(place.at_m * lane.length_m / (place.length_m or 1.0), lane.length_m)
    return LanePoint(lane, at_m, place.off_m, place.heading_deg)


def _drivable(sim: Simulation, lane: str) -> bool:
    allowed = sim.lane.getAllowed(lane)
    return (CAR in allowed) if allowed else CAR not in sim.lane.getDisallowed(lane)


def _through(sim: Simulation, via: str) -> float:
    """Length of the lanes within a junction that begin with `via`: where one waits for others there are two."""
    length = 0.0
    while via:
        length += sim.lane.getLength(via)
        following = sim.lane.getLinks(via)
        via = following[0][4] if following else ""
    return length


def _lane(sim: Simulation, name: str, edge: str) -> RoadLane:
    index = int(name.rsplit("_", 1)[1])
    shape = tuple((float(point[0]), float(point[1])) for point in sim.lane.getShape(name))
    return RoadLane(name, edge, index, shape, sim.lane.getLength(name), sim.lane.getWidth(name))


def _indexed(lanes: Iterator[RoadLane]) -> dict[tuple[int, int], tuple[RoadLane, ...]]:
    cells: dict[tuple[int, int], list[RoadLane]] = {}
    for lane in lanes:
        for cell in _crossed(lane.shape):
            cells.setdefault(cell, []).append(lane)
    return {cell: tuple(found) for cell, found in cells.items()}


def _crossed(shape: Sequence[Vector2]) -> Iterator[tuple[int, int]]:
    """The squares in which a line has a point, taken each half square."""
    seen: dict[tuple[int, int], None] = {}
    for (ax, ay), (bx, by) in itertools.pairwise(shape):
        parts = max(1, math.ceil(math.hypot(bx - ax, by - ay) / (_CELL_M / 4.0)))
        for part in range(parts + 1):
            x, y = ax + (bx - ax) * part / parts, ay + (by - ay) * part / parts
            seen[math.floor(x / _CELL_M), math.floor(y / _CELL_M)] = None
    return iter(seen)


def _components(edges: Mapping[str, RoadEdge]) -> Iterator[tuple[str, ...]]:
    """Strongly connected components (Kosaraju): finish order on the graph, then floods against it."""
    order: list[str] = []
    seen: set[str] = set()
    for root in edges:
        stack = [(root, iter(edges[root].links))] if root not in seen else []
        seen.add(root)
        while stack:
            name, links = stack[-1]
            following = next((link.edge for link in links if link.edge not in seen), None)
            if following is None:
                order.append(name)
                stack.pop()
            else:
                seen.add(following)
                stack.append((following, iter(edges[following].links)))
    before = _before(edges)
    left = dict.fromkeys(order)
    for root in reversed(order):
        if root in left:
            yield _flood(root, before, left)


def _without_traps(edges: Mapping[str, RoadEdge]) -> dict[str, RoadEdge]:
    """Without the edges from which there is no way back, such as one-way streets that leave the map."""
    core = max(_components(edges), key=len, default=())
    kept = frozenset(_flood(core[0], _before(edges), dict.fromkeys(edges))) if core else frozenset()
    return {
        name: replace(edge, links=tuple(link for link in edge.links if link.edge in kept))
        for name, edge in edges.items()
        if name in kept
    }


def _before(edges: Mapping[str, RoadEdge]) -> dict[str, list[str]]:
    """The edges that lead to each."""
    before: dict[str, list[str]] = {name: [] for name in edges}
    for name, edge in edges.items():
        for link in edge.links:
            before[link.edge].append(name)
    return before


def _flood(root: str, before: Mapping[str, Sequence[str]], left: dict[str, None]) -> tuple[str, ...]:
    del left[root]
    found = [root]
    for name in found:
        for neighbour in before[name]:
            if neighbour in left:
                del left[neighbour]
                found.append(neighbour)
    return tuple(found)
