"""`RoadMap`: the public roads of a city as a graph of road segments, for policies and analyses that plan routes.

It is read from the network file that the traffic engine also loads, without that engine. Routes follow the network's
connections, so they contain no forbidden turn. Costs are those of empty roads: metres, and seconds at the permitted
speed. Traffic is not included.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from collections.abc import Set as AbstractSet
from functools import cached_property, lru_cache
from pathlib import Path
from xml.etree.ElementTree import Element, ParseError

import msgspec

from lingjing.errors import UsageError
from lingjing.mission.geometry2d import Vector2
from lingjing.scene.lines import project
from lingjing.scene.network import THROUGH_KEY, car_lanes, elements_of

NO_THROUGH_M = 20_000.0
"""Detour in metres that a route accepts to avoid a street without through traffic (chosen: longer than any city is
wide)."""


class RoadSegment(msgspec.Struct, frozen=True, kw_only=True):
    """One direction of a street between two junctions."""

    id: str
    """The edge's id in the traffic network."""
    start: str
    """Id of the first junction."""
    end: str
    """Id of the last junction."""
    shape: tuple[Vector2, ...]
    """Centre line of the first lane for cars."""
    length_m: float
    """Metres."""
    speed_mps: float
    """Permitted speed, m/s."""
    following: tuple[str, ...] = ()
    """Ids of the segments that may be entered next."""
    through: bool = True
    """False if only traffic that begins or ends there may drive on it."""

    @property
    def time_s(self) -> float:
        """Driving time at the permitted speed, seconds."""
        return self.length_m / max(self.speed_mps, 0.1)


class RoadWay(msgspec.Struct, frozen=True, kw_only=True):
    """The shortest route between two places."""

    length_m: float
    """Metres."""
    time_s: float
    """Driving time at the permitted speeds, seconds."""
    segments: tuple[str, ...]
    """Ids of the segments, in driving order."""
    points: tuple[Vector2, ...]
    """The start, the junctions between the segments, and the end."""


class RoadPlace(msgspec.Struct, frozen=True, kw_only=True):
    """The point of the road network that is nearest to a place."""

    segment: str
    """Id of the segment."""
    at_m: float
    """Distance of the point from the segment's start, metres."""
    off_m: float
    """Distance of the place from the point, metres."""
    point: Vector2
    """The point itself."""


class RoadMap:
    """The segments of a network by id, in the order of its file."""

    def __init__(self, segments: Sequence[RoadSegment]) -> None:
        self.segments = {segment.id: segment for segment in segments}
        self._known: dict[Vector2, RoadPlace | None] = {}

    @cached_property
    def connected(self) -> frozenset[str]:
        """The ids of the largest set of segments of which each leads to every other (strongly connected)."""
        backward: dict[str, list[str]] = {name: [] for name in self.segments}
        for name, segment in self.segments.items():
            for after in segment.following:
                backward[after].append(name)
        order = _finished(self.segments, {name: segment.following for name, segment in self.segments.items()})
        left, best = set(self.segments), frozenset[str]()
        for name in reversed(order):
            if name in left:
                group = _reached(name, backward, left)
                left -= group
                if len(group) > len(best):
                    best = frozenset(group)
        return best

    def nearest(self, place: Vector2) -> RoadPlace | None:
        """Return the nearest point of the network to a place; None without roads."""
        if place not in self._known:
            candidates = (_on(segment, place) for segment in self.segments.values())
            self._known[place] = min(candidates, key=lambda candidate: candidate.off_m, default=None)
        return self._known[place]

    def way(self, start: Vector2, end: Vector2) -> RoadWay | None:
        """Return the shortest route between two places (A* over segments); None if there is none."""
        first, last = self.nearest(start), self.nearest(end)
        if first is None or last is None:
            return None
        if first.segment == last.segment and last.at_m >= first.at_m:
            ids: tuple[str, ...] | None = (first.segment,)
        else:
            ids = self._path(first.segment, last.segment, last.point)
        return None if ids is None else self._way(ids, first, last)

    def _path(self, start: str, goal: str, end: Vector2) -> tuple[str, ...] | None:
        """The ids of the segments from `start` to `goal`, with at least one step; None if there is no route."""
        done: set[str] = set()
        waiting: list[tuple[float, float, tuple[str, ...]]] = [(0.0, 0.0, (start,))]
        while waiting:
            _, cost, path = heapq.heappop(waiting)
            if path[-1] == goal and len(path) > 1:
                return path
            if path[-1] in done and len(path) > 1:
                continue
            done.add(path[-1])
            for name in self.segments[path[-1]].following:
                if name in self.segments and (name not in done or name == goal):
                    segment = self.segments[name]
                    step = cost + segment.length_m + math.dist(self.segments[path[-1]].shape[-1], segment.shape[0])
                    if self.segments[path[-1]].through and not segment.through:
                        step += NO_THROUGH_M
                    ahead = math.dist(segment.shape[-1], end) if name != goal else 0.0
                    heapq.heappush(waiting, (step + ahead, step, (*path, name)))
        return None

    def _way(self, ids: tuple[str, ...], first: RoadPlace, last: RoadPlace) -> RoadWay:
        length, time, points = 0.0, 0.0, [first.point]
        for number, name in enumerate(ids):
            segment = self.segments[name]
            begin = first.at_m if number == 0 else 0.0
            end = last.at_m if number == len(ids) - 1 else segment.length_m
            driven = max(0.0, end - begin)
            if number:
                gap = math.dist(self.segments[ids[number - 1]].shape[-1], segment.shape[0])
                driven += gap
                points.append(segment.shape[0])
            length += driven
            time += driven / max(segment.speed_mps, 0.1)
        return RoadWay(length_m=length, time_s=time, segments=ids, points=(*points, last.point))


@lru_cache(maxsize=4)
def read_road_map(path: str) -> RoadMap:
    """Read the roads of a `.net.xml` that are open to cars. Raises `UsageError` for a file that is no network."""
    segments: dict[str, RoadSegment] = {}
    following: dict[str, dict[str, None]] = {}
    try:
        for element in elements_of(Path(path), ("edge", "connection")):
            if element.tag == "connection":
                following.setdefault(element.get("from", ""), {})[element.get("to", "")] = None
            elif element.get("function", "normal") == "normal":
                segments.update((segment.id, segment) for segment in _segments(element))
    except (OSError, ParseError, ValueError) as error:
        raise UsageError(f"{path} is no road network: {error}") from error
    return RoadMap(
        [
            msgspec.structs.replace(segment, following=tuple(to for to in following.get(name, ()) if to in segments))
            for name, segment in segments.items()
        ]
    )


def _finished(names: Iterable[str], following: Mapping[str, Sequence[str]]) -> list[str]:
    """The segments in the order in which a depth-first search leaves them (Kosaraju's first pass)."""
    seen: set[str] = set()
    order: list[str] = []
    for root in names:
        stack = [(root, 0)] if root not in seen else []
        seen.add(root)
        while stack:
            name, number = stack.pop()
            if number < len(following[name]):
                stack.append((name, number + 1))
                after = following[name][number]
                if after not in seen:
                    seen.add(after)
                    stack.append((after, 0))
            else:
                order.append(name)
    return order


def _reached(start: str, ways: Mapping[str, Sequence[str]], within: AbstractSet[str]) -> set[str]:
    """The segments that can be reached, without leaving `within`."""
    reached, stack = {start}, [start]
    while stack:
        for name in ways[stack.pop()]:
            if name in within and name not in reached:
                reached.add(name)
                stack.append(name)
    return reached


def _segments(edge: Element) -> Iterator[RoadSegment]:
    lanes = car_lanes(edge)
    if lanes:
        shape, length, speed = lanes[0]
        yield RoadSegment(
            id=edge.get("id", ""), start=edge.get("from", ""), end=edge.get("to", ""),
            shape=tuple((x, y) for x, y, _ in shape), length_m=length, speed_mps=speed,
            through=all(item.get("value") != "no" for item in edge.findall("param") if item.get("key") == THROUGH_KEY),
        )  # fmt: skip


def _on(segment: RoadSegment, place: Vector2) -> RoadPlace:
    near = project(segment.shape, *place)
    return RoadPlace(segment=segment.id, at_m=min(near.at_m, segment.length_m), off_m=near.off_m, point=near.point)
