"""The fastest way through the graph: Dijkstra over edges by free-flow time and the time of turns.

Routes do not take account of traffic. They avoid only the places that an agent has named after an inspection.
"""

from __future__ import annotations

import heapq
import itertools
import math
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass

from lingjing.engines.road.graph import Graph, LanePoint, RoadLink
from lingjing.mission.geometry2d import Polygon, Vector2, contains

TURN_S = {"s": 1.0, "r": 3.0, "R": 2.0, "l": 6.0, "L": 4.0, "t": 25.0}
"""Time that a link of each direction adds to its driving time, seconds: slowing down and giving way (chosen)."""

NO_THROUGH_S = 1800.0
"""Longest detour around streets that are closed to through traffic, seconds (chosen)."""

_SAMPLE_M = 2.0
"""Distance between the points of a lane that are compared with a closed region, metres (chosen)."""

_SAME_EDGE_MARGIN_M = 1.0
"""Distance by which a goal on the same edge may lie behind the vehicle, metres (chosen)."""


@dataclass(frozen=True, slots=True)
class DrivingWay:
    """A route along edges of the road network."""

    edges: tuple[str, ...]
    """Edges from the start's to the goal's."""
    length_m: float
    """Length, metres."""
    duration_s: float
    """Free-flow driving time, seconds."""


@dataclass(frozen=True, slots=True)
class Avoided:
    """A place to avoid."""

    x: float
    """East coordinate, metres."""
    y: float
    """North coordinate, metres."""
    radius_m: float
    """Radius, metres."""


def find_way(
    graph: Graph,
    start: tuple[str, float],
    goal: tuple[str, float],
    avoid: Collection[str] = (),
    ahead_m: float = 0.0,
) -> DrivingWay | None:
    """Return the fastest way between two places, each an edge and the metres along it; None if there is none.

    The way leaves the start's edge at its end even if that edge is to be avoided, because the vehicle is on it. A goal
    less than `ahead_m` ahead on the same edge is reached by a way around.
    """
    (origin, from_m), (target, to_m) = start, goal
    if origin == target and to_m >= from_m + ahead_m - _SAME_EDGE_MARGIN_M:
        length = max(0.0, to_m - from_m)
        return DrivingWay((origin,), length, length / graph.edges[origin].speed_mps)
    edges = _search(graph, origin, target, frozenset(avoid))
    return None if edges is None else measure(graph, edges, from_m, to_m)


def straight_on(graph: Graph, edge: str) -> RoadLink | None:
    """Return the link that continues an edge: straight, else a slight turn, else the only one; None if there is
    none."""
    links = [link for link in graph.edges[edge].links if link.direction != "t"]
    slight = [link for direction in "sRL" for link in links if link.direction == direction]
    return slight[0] if slight else links[0] if len(links) == 1 else None


def onward(graph: Graph, edges: Sequence[str], reserve_m: float) -> tuple[str, ...]:
    """Return the edges, extended by those that continue for `reserve_m`; they turn back where a road ends."""
    route, ahead = list(edges), 0.0
    while ahead < reserve_m:
        links = graph.edges[route[-1]].links
        link = straight_on(graph, route[-1]) or next(iter(links), None)
        if link is None:
            break
        route.append(link.edge)
        ahead += graph.edges[link.edge].length_m
    return tuple(route)


def edges_at(graph: Graph, place: Avoided, goal: LanePoint | None = None) -> frozenset[str]:
    """Return the edges that pass a place, without the goal's edge if the goal comes before the place."""
    passing = set()
    for near in graph.places(place.x, place.y, place.radius_m):
        here = goal is not None and near.lane.edge == goal.lane.edge
        if here and goal is not None and goal.at_m < near.at_m - place.radius_m:
            continue
        passing.add(near.lane.edge)
    return frozenset(passing)


def edges_in(graph: Graph, outline: Polygon) -> frozenset[str]:
    """Return the edges with a lane that passes through a polygon."""
    return frozenset(
        name
        for name, edge in graph.edges.items()
        if any(contains(outline, *point) for lane in edge.lanes for point in _points(lane.shape))
    )


def _points(shape: Sequence[Vector2]) -> Iterator[Vector2]:
    """Yield points on a line, at most `_SAMPLE_M` apart."""
    for (ax, ay), (bx, by) in itertools.pairwise(shape):
        steps = max(1, math.ceil(math.dist((ax, ay), (bx, by)) / _SAMPLE_M))
        yield from ((ax + (bx - ax) * n / steps, ay + (by - ay) * n / steps) for n in range(steps + 1))


def _search(graph: Graph, origin: str, target: str, avoid: frozenset[str]) -> tuple[str, ...] | None:
    best: dict[str, float] = {}
    came: dict[str, str] = {}
    heap: list[tuple[float, int, str]] = []
    count = 0

    def push(name: str, cost: float) -> None:
        nonlocal count
        for link in graph.edges[name].links:
            if link.edge in avoid or link.edge not in graph.edges:
                continue
            reached = cost + _link_s(graph, link)
            if graph.edges[name].through and not graph.edges[link.edge].through:
                reached += NO_THROUGH_S
            if reached < best.get(link.edge, math.inf):
                best[link.edge] = reached
                came[link.edge] = name
                count += 1
                heapq.heappush(heap, (reached, count, link.edge))

    push(origin, 0.0)
    while heap:
        cost, _, name = heapq.heappop(heap)
        if name == target:
            return _unwound(came, origin, target)
        if cost <= best[name]:
            push(name, cost + graph.edges[name].time_s)
    return None


def _unwound(came: dict[str, str], origin: str, target: str) -> tuple[str, ...]:
    edges = [target, came[target]]
    while edges[-1] != origin:
        edges.append(came[edges[-1]])
    return tuple(reversed(edges))


def _link_s(graph: Graph, link: RoadLink) -> float:
    return link.length_m / max(graph.edges[link.edge].speed_mps, 0.1) + TURN_S.get(link.direction, 3.0)


def measure(graph: Graph, edges: tuple[str, ...], from_m: float, to_m: float) -> DrivingWay:
    """Return the way along connected edges, from a point on the first to a point on the last."""
    length, duration = -from_m, -from_m / graph.edges[edges[0]].speed_mps
    for name, following in itertools.pairwise(edges):
        edge = graph.edges[name]
        link = next(link for link in edge.links if link.edge == following)
        length += edge.length_m + link.length_m
        duration += edge.time_s + _link_s(graph, link)
    return DrivingWay(edges, length + to_m, duration + to_m / graph.edges[edges[-1]].speed_mps)
