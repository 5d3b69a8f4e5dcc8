"""What lets nobody pass, and where it stands on the route of a vehicle that is inspected, as the truth has it."""

from __future__ import annotations

import math
from itertools import pairwise

from lingjing.plugins.policy import Datum, Entity, Route
from lingjing_agents.ground_plane import GroundPoint, distance_to_segment_m
from lingjing_agents.oracle.privileged_state import PrivilegedState

PATIENCE_TICKS, PATIENCE_S = 5, 200.0
"""How long a vehicle waits for another route while its inspection does not go on: so many ticks, and so long."""


def jams(truth: PrivilegedState) -> list[Entity]:
    """What is there and lets nobody pass."""
    entities = truth.plan.instance.entities
    return [entity for entity in entities if entity.blocked_m is not None and truth.present(entity.id)]


def is_blocked(truth: PrivilegedState, place: GroundPoint) -> bool:
    """Whether something stands at a place that lets nobody pass."""
    return any(math.dist(truth.place(jam.id), place) <= (jam.blocked_m or 0.0) for jam in jams(truth))


def jams_on(truth: PrivilegedState, route: Route) -> list[Entity]:
    """What blocks a route, in the order in which it comes to it."""
    found = [jam for jam in jams(truth) if off_route(truth, route, jam) <= (jam.blocked_m or 0.0)]
    return sorted(found, key=lambda entity: segment(truth, route, entity))


def off_route(truth: PrivilegedState, route: Route, entity: Entity) -> float:
    """How far something stands from a route, in metres."""
    here = truth.place(entity.id)
    return min(distance_to_segment_m(here, a, b) for a, b in pairwise(_line(truth, route)))


def segment(truth: PrivilegedState, route: Route, entity: Entity) -> int:
    """The place of the waypoint before which an entity stands on a route."""
    here = truth.place(entity.id)
    pieces = list(pairwise(_line(truth, route)))
    return min(range(len(pieces)), key=lambda number: (round(distance_to_segment_m(here, *pieces[number]), 1), number))


def another_way(truth: PrivilegedState, route: Route, jam: Entity) -> dict[str, Datum]:
    """What is said of a jam when another route is asked for because of it."""
    number = min(segment(truth, route, jam) + 1, len(route.waypoints))
    return {"waypoint": number, "position": truth.states[jam.id].position, "confidence": 1.0}


class RouteWatch:
    """Whether a vehicle had better wait: its route is not known yet that is to be inspected, or something blocks it
    that did not block the one before, so that another may still be asked for. What a new route still passes cannot be
    avoided."""

    def __init__(self, vehicle: str) -> None:
        self._vehicle = vehicle
        self._before: frozenset[str] = frozenset()
        self._now: frozenset[str] = frozenset()
        self._state, self._since = (0, 0), 0

    def is_to_wait(self, truth: PrivilegedState) -> bool:
        """Ask at every boundary: it remembers what blocked earlier routes and when the inspection last went on."""
        checks = [one for one in truth.plan.instance.inspections if one.asset == self._vehicle and one.replan]
        route = truth.routes.get(self._vehicle)
        seen = sum(len(truth.known.inspected.get(one.name, ())) for one in checks)
        state = (0 if route is None else route.number, seen)
        if state[0] != self._state[0]:
            self._before |= self._now
        if state != self._state:
            self._state, self._since = state, truth.tick
        if truth.tick - self._since >= max(PATIENCE_TICKS, PATIENCE_S / truth.brief.tick_s):
            return False
        if route is None:
            return any(one.destination for one in checks)
        self._now = frozenset(jam.id for jam in jams_on(truth, route)) if checks else frozenset()
        return not self._now <= self._before


def _line(truth: PrivilegedState, route: Route) -> list[GroundPoint]:
    start = truth.plan.entities[route.entity].position[:2] if route.number == 1 else truth.place(route.entity)
    return [start, *(point[:2] for point in route.waypoints)]
