"""The quickest way through the graph: Dijkstra over edges by free-flow time, with what turning costs.

Routes know nothing of traffic but the places that somebody said to avoid: that is what inspection is for.
"""

from __future__ import annotations

import heapq
import itertools
import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass

from lingjing.engines.road.graph import Graph, LanePoint, RoadLink

TURN_S = {"s": 1.0, "r": 3.0, "R": 2.0, "l": 6.0, "L": 4.0, "t": 25.0}
"""Seconds that a link of each direction costs beyond driving it: slowing down, giving way."""

NO_THROUGH_S = 1800.0
"""The detour that a way takes rather than lead through streets that are open to their own traffic alone."""

_SAME_EDGE_MARGIN_M = 1.0


@dataclass(frozen=True, slots=True)
class DrivingWay:
    """Edges from the start's to the goal's, with what driving them takes."""

    edges: tuple[str, ...]
    length_m: float
    duration_s: float


@dataclass(frozen=True, slots=True)
class Avoided:
    """A place to keep away from, as long as the jam `because` blocks it (always, where none is known)."""

    x: float
    y: float
    radius_m: float
    because: str = ""


def find_way(
    graph: Graph,
    start: tuple[str, float],
    goal: tuple[str, float],
    avoid: Collection[str] = (),
    ahead_m: float = 0.0,
) -> DrivingWay | None:
    """The quickest way from (edge, metres along it) to (edge, metres), not by the edges to avoid; None: there is none.

    The start's edge is left by its end, avoided or not, for the vehicle is there; what lies less than `ahead_m` ahead
    on it is reached by coming back.
    """
    (origin, from_m), (target, to_m) = start, goal
    if origin == target and to_m >= from_m + ahead_m - _SAME_EDGE_MARGIN_M:
        length = max(0.0, to_m - from_m)
        return DrivingWay((origin,), length, length / graph.edges[origin].speed_mps)
    edges = _search(graph, origin, target, frozenset(avoid))
    return None if edges is None else measure(graph, edges, from_m, to_m)


def straight_on(graph: Graph, edge: str) -> RoadLink | None:
    """The link by which one drives on at the end of an edge: straight, else a slight turn, else the only way on."""
    links = [link for link in graph.edges[edge].links if link.direction != "t"]
    slight = [link for direction in "sRL" for link in links if link.direction == direction]
    return slight[0] if slight else links[0] if len(links) == 1 else None


def onward(graph: Graph, edges: Sequence[str], reserve_m: float) -> tuple[str, ...]:
    """The edges and those by which one could go on for `reserve_m` behind the last: back where the road ends."""
    found, ahead = list(edges), 0.0
    while ahead < reserve_m:
        links = graph.edges[found[-1]].links
        link = straight_on(graph, found[-1]) or next(iter(links), None)
        if link is None:
            break
        found.append(link.edge)
        ahead += graph.edges[link.edge].length_m
    return tuple(found)


def edges_at(graph: Graph, place: Avoided, goal: LanePoint | None = None) -> frozenset[str]:
    """The edges that pass a place, without the goal's where the goal is reached before the place is."""
    found = set()
    for near in graph.places(place.x, place.y, place.radius_m):
        here = goal is not None and near.lane.edge == goal.lane.edge
        if here and goal is not None and goal.at_m < near.at_m - place.radius_m:
            continue
        found.add(near.lane.edge)
    return frozenset(found)


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
    """The way along edges that follow each other, from a point on the first to one on the last."""
    length, duration = -from_m, -from_m / graph.edges[edges[0]].speed_mps
    for name, following in itertools.pairwise(edges):
        edge = graph.edges[name]
        link = next(link for link in edge.links if link.edge == following)
        length += edge.length_m + link.length_m
        duration += edge.time_s + _link_s(graph, link)
    return DrivingWay(edges, length + to_m, duration + to_m / graph.edges[edges[-1]].speed_mps)
