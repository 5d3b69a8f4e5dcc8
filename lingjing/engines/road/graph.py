"""The road network: edges, their lanes, the links between them, and the lanes near a point.

It is read once from the running simulation, and holds only what passenger cars may use. Positions along a lane are
SUMO's: metres from its start, scaled if the lane's length differs from that of its drawn shape.
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
from lingjing.sums import total

CAR = "passenger"
"""SUMO's vehicle class of passenger cars."""

_CELL_M = 50.0
"""Side of a square of the index of lanes, metres (chosen)."""

_NEAR_CELL_M = 4.0
"""Side of a square of the cache of `is_near_road`, metres (chosen)."""

_BESIDE_M = 12.0
"""Distance beyond the nearest lane up to which lanes count as beside it, metres (chosen)."""

_ALONG_DEG = 75.0
"""Largest difference of headings of a lane that leads in the same direction, degrees (chosen)."""


@dataclass(frozen=True, slots=True)
class RoadLink:
    """A link from the end of an edge to another edge."""

    edge: str
    """The edge that follows."""
    direction: str
    """SUMO's direction: `s` straight, `l` left, `r` right, `L` half left, `R` half right, `t` turn back."""
    length_m: float
    """Length within the junction, metres."""


@dataclass(frozen=True, slots=True)
class RoadLane:
    """One lane that cars may use."""

    id: str
    """SUMO's id."""
    edge: str
    """Its edge."""
    index: int
    """Index from the right, from 0."""
    shape: tuple[Vector2, ...]
    """Centre line, (east, north) metres."""
    length_m: float
    """Length in SUMO's metres."""
    width_m: float
    """Width, metres."""


@dataclass(frozen=True, slots=True)
class RoadEdge:
    """One direction of a street."""

    id: str
    """SUMO's id."""
    lanes: tuple[RoadLane, ...]
    """The lanes that cars may use, from the right."""
    links: tuple[RoadLink, ...]
    """One link to each edge that follows."""
    length_m: float
    """Length of the shortest lane, metres."""
    speed_mps: float
    """Permitted speed, m/s."""
    through: bool = True
    """False if only traffic that begins or ends there may use it."""

    @property
    def time_s(self) -> float:
        """Driving time at the permitted speed, seconds."""
        return self.length_m / max(self.speed_mps, 0.1)


@dataclass(frozen=True, slots=True)
class LanePoint:
    """A point on a lane."""

    lane: RoadLane
    """The lane."""
    at_m: float
    """Distance from the lane's start, metres."""
    off_m: float
    """Distance of the query point from it, metres."""
    heading_deg: float
    """Heading of the lane, degrees clockwise from north."""


@dataclass(frozen=True)
class Graph:
    """All edges, and an index of their lanes."""

    edges: Mapping[str, RoadEdge]
    """Edges by id, in the network's order."""
    _cells: Mapping[tuple[int, int], tuple[RoadLane, ...]]
    """Lanes by square of `_CELL_M`."""
    _near: dict[tuple[int, int], bool] = field(default_factory=dict)
    """Cache of `is_near_road`, by square of `_NEAR_CELL_M`."""

    @cached_property
    def core(self) -> tuple[str, ...]:
        """The edges of the largest strongly connected component of the network."""
        return max(_components(self.edges), key=len, default=())

    def places(self, x: float, y: float, within_m: float) -> tuple[LanePoint, ...]:
        """Return the nearest point of each lane within a distance, the nearest first; ties keep the network's order."""
        near = ((lane, project(lane.shape, x, y)) for lane in self._lanes_near(x, y, within_m))
        points = (_on_lane(lane, place) for lane, place in near if place.off_m <= within_m)
        return tuple(sorted(points, key=lambda place: place.off_m))

    def nearest(self, x: float, y: float, heading_deg: float | None = None, most_m: float = 2000.0) -> LanePoint | None:
        """Return the nearest lane point within `most_m`, or None.

        With a heading, a lane beside the nearest one is preferred if it leads in that direction.
        """
        reach = min(_CELL_M, most_m)
        while not (near := self.places(x, y, reach)):
            if reach >= most_m:
                return None
            reach = min(2.0 * reach, most_m)
        close = (place for place in near if place.off_m <= near[0].off_m + _BESIDE_M)
        if heading_deg is None:
            return near[0]
        return next((place for place in close if abs(turn_deg(heading_deg, place.heading_deg)) < _ALONG_DEG), near[0])

    def is_near_road(self, x: float, y: float) -> bool:
        """Return whether a lane's edge is within a few metres. Answers are cached by small squares."""
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
    """Return the graph of the network that the simulation has loaded."""
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
    """Return the elevations of the lowest and the highest point of all lanes, metres."""
    heights = [0.0] if not graph.edges else []
    for lane in (lane for edge in graph.edges.values() for lane in edge.lanes):
        steps = [math.dist(*pair) for pair in itertools.pairwise(lane.shape)]
        scale = lane.length_m / (total(steps) or 1.0)
        for at_m in (0.0, *itertools.accumulate(steps)):
            at = min(at_m * scale, lane.length_m)
            heights.append(float(sim.simulation.convert3D(lane.edge, at, lane.index)[2]))
    return min(heights), max(heights)


def _on_lane(lane: RoadLane, place: LinePlace[Vector2]) -> LanePoint:
    at_m = min(place.at_m * lane.length_m / (place.length_m or 1.0), lane.length_m)
    return LanePoint(lane, at_m, place.off_m, place.heading_deg)


def _drivable(sim: Simulation, lane: str) -> bool:
    allowed = sim.lane.getAllowed(lane)
    return (CAR in allowed) if allowed else CAR not in sim.lane.getDisallowed(lane)


def _through(sim: Simulation, via: str) -> float:
    """Return the length of the lanes within a junction that begin with `via`, metres.

    There are two of them if a vehicle can wait inside the junction.
    """
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
    return {cell: tuple(own) for cell, own in cells.items()}


def _crossed(shape: Sequence[Vector2]) -> Iterator[tuple[int, int]]:
    """Return the squares in which a line has a point, sampled every quarter square."""
    seen: dict[tuple[int, int], None] = {}
    for (ax, ay), (bx, by) in itertools.pairwise(shape):
        parts = max(1, math.ceil(math.hypot(bx - ax, by - ay) / (_CELL_M / 4.0)))
        for part in range(parts + 1):
            x, y = ax + (bx - ax) * part / parts, ay + (by - ay) * part / parts
            seen[math.floor(x / _CELL_M), math.floor(y / _CELL_M)] = None
    return iter(seen)


def _components(edges: Mapping[str, RoadEdge]) -> Iterator[tuple[str, ...]]:
    """Return the strongly connected components (Kosaraju): finish order on the graph, then floods against it."""
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
    """Return the edges without those from which there is no way back, such as one-way streets that leave the map."""
    core = max(_components(edges), key=len, default=())
    kept = frozenset(_flood(core[0], _before(edges), dict.fromkeys(edges))) if core else frozenset()
    return {
        name: replace(edge, links=tuple(link for link in edge.links if link.edge in kept))
        for name, edge in edges.items()
        if name in kept
    }


def _before(edges: Mapping[str, RoadEdge]) -> dict[str, list[str]]:
    """Return the edges that lead to each edge."""
    before: dict[str, list[str]] = {name: [] for name in edges}
    for name, edge in edges.items():
        for link in edge.links:
            before[link.edge].append(name)
    return before


def _flood(root: str, before: Mapping[str, Sequence[str]], left: dict[str, None]) -> tuple[str, ...]:
    del left[root]
    reached = [root]
    for name in reached:
        for neighbour in before[name]:
            if neighbour in left:
                del left[neighbour]
                reached.append(neighbour)
    return tuple(reached)
