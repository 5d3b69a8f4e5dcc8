"""The effect of commands on vehicles, or the reason of a refusal.

`setDestination` follows the last published route if it leads to the same place. `forward` goes straight on at
junctions. `left` and `right` turn at the next junction with a choice and halt just behind it. `stop` brakes. The kernel
sends `route` and `replan`: they plan and publish a route without motion, but a vehicle on its way follows its new
route.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable

from lingjing.engines.road.graph import Graph, RoadLink
from lingjing.engines.road.routing import Avoided, edges_at, find_way, measure, straight_on
from lingjing.engines.road.simulation import Simulation
from lingjing.engines.road.vehicle import DrivingPlan, RouteStart, Vehicle
from lingjing.engines.road.waypoints import waypoints
from lingjing.mission.instance import Vector
from lingjing.mission.kinds import builtin_engines
from lingjing.plugins.requests import STOP, Refusal, number, number_at_least
from lingjing.trace.records import Command, Route

KIND = builtin_engines()["road"]
"""The declared kind of this engine."""

PLANNING = ("route", "replan")
"""Verbs that only plan. They complete at once and may be sent while a vehicle moves."""

SAME_PLACE_M = 5.0
"""Distance within which a destination counts as the planned one, metres (chosen)."""

FARTHEST_M = 150.0
"""Largest distance of a destination from a road, metres (chosen)."""

NAMED_M = 25.0
"""Largest distance of a named place from the street that is avoided, metres: the paper's radius of congestion."""

STREET_M = 10.0
"""Distance beyond the nearest lane up to which the other lanes of the named street are avoided, metres (chosen). It is
less than the distance of a jam from the crossing street."""

_OTHER_SIDE_M = 20.0
"""Distance beyond the nearest lane up to which other lanes serve as goal, metres: a street's other side (chosen)."""

_BEHIND_TURN_M = 8.0
"""Distance behind a turn at which a vehicle halts, metres, in addition to its length (chosen)."""

_MOST_EDGES = 50
"""Most edges in the search for the next junction (chosen)."""

_TURNS = {"left": "lL", "right": "rR"}
"""SUMO's directions of links for each verb, the best first."""

_NAMES = {"l": "left", "L": "left", "r": "right", "R": "right", "s": "straight on", "t": "back"}
"""Words for SUMO's directions of links."""


class Planner:
    """Plans for vehicles on one network; `publish` receives each route."""

    def __init__(
        self,
        sim: Simulation,
        graph: Graph,
        publish: Callable[[Route], None],
    ) -> None:
        self._sim = sim
        self._graph = graph
        self._publish = publish
        self.closed: frozenset[str] = frozenset()
        """The edges that events have closed."""

    def evade(self, vehicle: Vehicle, time_s: float) -> bool:
        """Plan a way around closed edges for a vehicle with a task over one. Return False if there is none."""
        task = vehicle.task
        if task is None or task.kind not in ("drive", "distance"):
            return True
        edges = task.plan.way.edges if task.plan is not None else task.edges
        start = vehicle.route_start()
        rest = edges[edges.index(start.edge) + 1 :] if start.edge in edges else edges
        if self.closed.isdisjoint(rest):
            return True
        if task.plan is None:
            return False
        try:
            plan = self._plan(vehicle, task.plan.x, task.plan.y)
        except Refusal:
            return False
        self._announce(vehicle, plan, "", time_s)
        vehicle.drive(plan)
        return True

    def start(self, vehicle: Vehicle, command: Command, time_s: float) -> None:
        """Begin a command; raises `Refusal` if it cannot be carried out."""
        if command.verb == "setDestination":
            self._set_destination(vehicle, command, time_s)
        elif command.verb == "forward":
            self._forward(vehicle, command)
        elif command.verb in _TURNS:
            self._turn(vehicle, command.verb)
        elif command.verb == STOP:
            vehicle.halt()
        elif command.verb in PLANNING:
            self._plan_only(vehicle, command, time_s)
        else:
            raise Refusal("unknown_verb", f"a road vehicle has no verb `{command.verb}`")

    def _set_destination(self, vehicle: Vehicle, command: Command, time_s: float) -> None:
        x, y = number(command, "x"), number(command, "y")
        planned = vehicle.plan
        if planned is not None and math.dist((x, y), (planned.x, planned.y)) <= SAME_PLACE_M:
            followed = self._from_here(vehicle, planned)
            if followed is not None:
                vehicle.drive(followed)
                return
        plan = self._plan(vehicle, x, y)
        self._announce(vehicle, plan, command.id, time_s)
        vehicle.drive(plan)

    def _plan_only(self, vehicle: Vehicle, command: Command, time_s: float) -> None:
        if command.origin != "kernel" and all(verb.name != command.verb for verb in vehicle.entity.verbs):
            raise Refusal("no_authority", f"only the kernel asks for `{command.verb}`")
        x, y = number(command, "x"), number(command, "y")
        if command.verb == "route":
            plan = self._plan(vehicle, x, y)
        else:
            plan = self._replan(vehicle, x, y)
        self._announce(vehicle, plan, command.id, time_s)
        if vehicle.task is not None and vehicle.task.kind == "drive":
            vehicle.drive(plan)

    def _replan(self, vehicle: Vehicle, x: float, y: float) -> DrivingPlan:
        planned = vehicle.plan
        if planned is None:
            raise Refusal("no_route", f"`{vehicle.id}` has no route yet that could be replaced")
        before = vehicle.avoided
        vehicle.avoided = (*before, self._avoided_at(x, y))
        try:
            return self._plan(vehicle, planned.x, planned.y)
        except Refusal:
            vehicle.avoided = before
            raise

    def _avoided_at(self, x: float, y: float) -> Avoided:
        """Return the street at the place that an agent named. The places of jams are hidden and not read here."""
        near = self._graph.nearest(x, y, most_m=NAMED_M)
        return Avoided(x, y, 0.0 if near is None else near.off_m + STREET_M)

    def _plan(self, vehicle: Vehicle, x: float, y: float) -> DrivingPlan:
        near = self._graph.nearest(x, y, most_m=FARTHEST_M)
        if near is None:
            raise Refusal("unreachable", f"there is no road within {FARTHEST_M:g} m of ({x:.1f}, {y:.1f})")
        start = vehicle.route_start()
        origin = (start.edge, _middle(vehicle, start))
        for goal in self._graph.places(x, y, near.off_m + _OTHER_SIDE_M):
            avoid = {name for spot in vehicle.avoided for name in edges_at(self._graph, spot, goal)}
            avoid |= self.closed - {start.edge}
            if start.edge in avoid:  # the vehicle is on it and must leave by one of the following edges
                avoid -= {link.edge for link in self._graph.edges[start.edge].links}
            way = find_way(self._graph, origin, (goal.lane.edge, goal.at_m), avoid, vehicle.braking_m())
            if way is not None:
                return DrivingPlan(x, y, goal, way)
        around = " around the places to avoid" if vehicle.avoided else " around the closed roads" if self.closed else ""
        raise Refusal("unreachable", f"no road leads from `{vehicle.id}` to ({x:.1f}, {y:.1f}){around}")

    def _from_here(self, vehicle: Vehicle, planned: DrivingPlan) -> DrivingPlan | None:
        """Return the rest of a plan from the vehicle's place, or None if the vehicle has left the plan."""
        start, edges, goal = vehicle.route_start(), planned.way.edges, planned.goal
        if start.edge not in edges:
            return None
        rest = edges[edges.index(start.edge) :]
        if not self.closed.isdisjoint(rest[1:]):
            return None
        if len(rest) == 1 and goal.at_m < _middle(vehicle, start) + vehicle.braking_m() - 1.0:
            return None
        way = measure(self._graph, rest, _middle(vehicle, start), goal.at_m)
        return DrivingPlan(planned.x, planned.y, goal, way)

    def _announce(self, vehicle: Vehicle, plan: DrivingPlan, request: str, time_s: float) -> None:
        vehicle.plan = plan
        vehicle.routes += 1
        start = vehicle.route_start()
        points: tuple[Vector, ...] = waypoints(
            self._sim, self._graph, plan.way, _middle(vehicle, start), plan.goal.at_m
        )
        self._publish(
            Route(
                entity=vehicle.id,
                number=vehicle.routes,
                waypoints=points,
                length_m=plan.way.length_m,
                duration_s=plan.way.duration_s,
                time_s=time_s,
                request=request,
            )
        )

    def _forward(self, vehicle: Vehicle, command: Command) -> None:
        distance = number_at_least(command, "distance", KIND)
        start = vehicle.route_start()
        edges, ahead = [start.edge], self._graph.edges[start.edge].length_m - start.at_m
        while ahead < distance:
            link = straight_on(self._graph, edges[-1])
            if link is None:
                break
            edges.append(link.edge)
            ahead += link.length_m + self._graph.edges[link.edge].length_m
        if ahead < distance:
            raise Refusal("unreachable", f"the road ends {ahead:.0f} m ahead of `{vehicle.id}`")
        self._check_open(edges[1:], vehicle)
        vehicle.cover(tuple(edges), distance)

    def _turn(self, vehicle: Vehicle, verb: str) -> None:
        start = vehicle.route_start()
        edges, ahead = [start.edge], self._graph.edges[start.edge].length_m - start.at_m
        links = self._forward_links(edges[-1])
        while len(links) == 1 and links[0].direction == "s" and len(edges) <= _MOST_EDGES:
            edges.append(links[0].edge)
            ahead += links[0].length_m + self._graph.edges[links[0].edge].length_m
            links = self._forward_links(edges[-1])
        turns = [link for link in links if link.direction in _TURNS[verb]]
        if not turns:
            raise Refusal("no_turn", f"no way leads {verb} at the next junction; it leads {_possible(links)}")
        turns = [link for link in turns if link.edge not in self.closed] or turns
        turn = min(turns, key=lambda link: _TURNS[verb].index(link.direction))
        self._check_open((*edges[1:], turn.edge), vehicle)
        behind = min(vehicle.size.length_m + _BEHIND_TURN_M, self._graph.edges[turn.edge].length_m - 0.5)
        vehicle.cover((*edges, turn.edge), ahead + turn.length_m + behind, onto=turn.edge)

    def _check_open(self, edges: Iterable[str], vehicle: Vehicle) -> None:
        if not self.closed.isdisjoint(edges):
            raise Refusal("unreachable", f"the road ahead of `{vehicle.id}` is closed")

    def _forward_links(self, edge: str) -> list[RoadLink]:
        return [link for link in self._graph.edges[edge].links if link.direction != "t"]


def _middle(vehicle: Vehicle, start: RouteStart) -> float:
    return max(0.0, start.at_m - vehicle.size.length_m / 2.0)


def _possible(links: list[RoadLink]) -> str:
    names = dict.fromkeys(_NAMES.get(link.direction, link.direction) for link in links)
    return " and ".join(names) or "nowhere but back"
