"""`RouteGuidance`: the paper's staged interventions on an inspected route (last-mile delivery), A0 to A3.

- A0 gives pictures alone. It removes coordinates from the goal and the task, routes, and the places of vehicles with an
  inspected route. A body that begins near an end of the route would tell that end: it has no place and no pictures
  until it has left.
- A1 gives the ends of the route.
- A2 also gives the roads around it and the shortest way.
- A3 chooses the next node of that way by A* in the model's place: a vehicle that the model moves drives on along the
  shortest way to the end of its route, node by node, whatever direction the model names.

Without an intervention the brief and the observation stay unchanged. Ends and roads are public, so nothing hidden is
given.
"""

from __future__ import annotations

import math
import re
from dataclasses import replace

import msgspec

from lingjing.plugins.geometry import distance_xy
from lingjing.plugins.policy import PHOTO, STOP, Action, Brief, Datum, EntityView, Observation, RouteEnds, Vector
from lingjing.plugins.roads import RoadMap, read_road_map
from lingjing_agents.capability import route_to
from lingjing_agents.react.facts import phrases_of

NOT_GIVEN = "(not given: find it in pictures)"
REACHED_M = 20.0
"""The distance at which a node counts as visited, metres. Chosen: an inspection of the paper's missions needs 25 m."""

NEAR_END_M = 30.0
"""The distance from an end of the route within which a place tells it, metres: the paper's radius of road vehicles."""

AROUND_M = 250.0
"""The distance from the ends of the route up to which roads are given, metres. Chosen."""

_PLACE = re.compile(r"\(-?\d+(?:\.\d+)?, -?\d+(?:\.\d+)?\)")


class RouteGuidance:
    """The intervention on the first inspected route, for one agent."""

    def __init__(self, brief: Brief, intervention: str) -> None:
        self._name = intervention
        self._ends: RouteEnds | None = brief.route_ends[0] if brief.route_ends and intervention else None
        self._roads, self._way = None, None
        if self._ends is not None and intervention in ("A2", "A3") and brief.road_network:
            self._roads = read_road_map(brief.road_network)
            self._way = self._roads.way(self._ends.start[:2], self._ends.end[:2])
        self._drivers = {
            resource.id: going for resource in brief.resources if resource.embodied and (going := route_to(resource))
        }
        self._next = 0
        self._first: dict[str, Vector] = {}

    def brief(self, brief: Brief) -> Brief:
        """Return the brief: in A0 without coordinates in its texts."""
        if self._ends is None or self._name != "A0":
            return brief
        goal, task = (_PLACE.sub(phrases_of(brief)(NOT_GIVEN), text) for text in (brief.goal, brief.prompt))
        return msgspec.structs.replace(brief, goal=goal, prompt=task, road_network="", route_ends=())

    def observation(self, observation: Observation) -> Observation:
        """Return the observation: with routes from A2 on, with the places of bodies at the route's ends from A1 on.
        Follows the vehicle along the way."""
        if self._ends is None:
            return observation
        for view in observation.entities:
            if view.id == self._ends.vehicle and view.position is not None:
                self._pass_nodes(view.position)
        withheld = {view.id for view in observation.entities if self._tells_an_end(view)}
        return replace(
            observation,
            entities=tuple(self._shown(view, placed=view.id not in withheld) for view in observation.entities),
            pictures=tuple(picture for picture in observation.pictures if picture.entity not in withheld),
        )

    def section(self) -> dict[str, object]:
        """Return the content of the intervention for the system text: the ends, the roads and the way."""
        if self._ends is None or self._name == "A0":
            return {}
        ends = {"vehicle": self._ends.vehicle, "start": _rounded(self._ends.start), "target": _rounded(self._ends.end)}
        if self._roads is None or self._way is None:
            return {"endpoints": ends}
        return {
            "endpoints": ends,
            "road_graph": _graph(self._roads, self._ends),
            "route_hint": [_rounded(point) for point in self._way.points],
        }

    def next_node(self) -> list[float] | None:
        """Return the next node of the way, in A3; None when all were visited."""
        if self._name != "A3" or self._way is None or self._next >= len(self._way.points):
            return None
        return _rounded(self._way.points[self._next])

    def command(self, command: Action | None) -> Action | None:
        """Return the command to send: in A3 a vehicle that the model moves goes on along the way to its end.

        The destination is the end and not the node: a new destination would be a new route, which no UAV has inspected.
        """
        if self.next_node() is None or self._ends is None or command is None or command.verb in (STOP, PHOTO):
            return command
        vehicle = command.resource or next(iter(self._drivers), "")
        if vehicle != self._ends.vehicle or vehicle not in self._drivers:
            return command
        x, y = _rounded(self._ends.end)
        place: dict[str, Datum] = {"x": x, "y": y}
        return msgspec.structs.replace(command, verb=self._drivers[vehicle], arguments=place)

    def _tells_an_end(self, view: EntityView) -> bool:
        """Return whether the place of a body tells an end of the route, in A0."""
        if self._name != "A0" or self._ends is None:
            return False
        if view.id == self._ends.vehicle:
            return True
        if view.position is None:
            return False
        first = self._first.setdefault(view.id, view.position)
        begins_near = any(distance_xy(first, end) <= NEAR_END_M for end in (self._ends.start, self._ends.end))
        return begins_near and distance_xy(view.position, first) <= NEAR_END_M

    def _pass_nodes(self, place: Vector) -> None:
        points = () if self._way is None else self._way.points
        while self._next < len(points) and distance_xy(place, points[self._next]) <= REACHED_M:
            self._next += 1

    def _shown(self, view: EntityView, *, placed: bool) -> EntityView:
        route = view.route if self._name in ("A2", "A3") else None
        return msgspec.structs.replace(view, route=route, position=view.position if placed else None)


def _graph(roads: RoadMap, ends: RouteEnds) -> dict[str, object]:
    """Return the junctions around the route with their places, and the roads between them."""
    west, east = sorted((ends.start[0], ends.end[0]))
    south, north = sorted((ends.start[1], ends.end[1]))
    places: dict[str, list[tuple[float, float]]] = {}
    links: list[tuple[str, str]] = []
    for segment in roads.segments.values():
        middle = segment.shape[len(segment.shape) // 2]
        inside_x = west - AROUND_M <= middle[0] <= east + AROUND_M
        if inside_x and south - AROUND_M <= middle[1] <= north + AROUND_M:
            places.setdefault(segment.start, []).append(segment.shape[0])
            places.setdefault(segment.end, []).append(segment.shape[-1])
            links.append((segment.start, segment.end))
    number = {name: at for at, name in enumerate(places)}
    middles = [
        [round(math.fsum(axis) / len(points)) for axis in zip(*points, strict=True)] for points in places.values()
    ]
    return {"nodes_east_north": middles, "roads_from_to": [[number[a], number[b]] for a, b in dict.fromkeys(links)]}


def _rounded(point: tuple[float, ...]) -> list[float]:
    return [round(value, 1) for value in point[:2]]
