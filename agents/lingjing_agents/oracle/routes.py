"""Obstacles that block traffic, and their position on inspected routes, from the ground truth."""

from __future__ import annotations

import math
from itertools import pairwise

from lingjing.plugins.policy import Datum, Entity, Route
from lingjing_agents.ground_plane import GroundPoint, distance_to_segment_m
from lingjing_agents.oracle.privileged_state import PrivilegedState

PATIENCE_TICKS, PATIENCE_S = 5, 200.0
"""Bounds on a vehicle's wait for another route while its inspection makes no progress, in ticks and seconds. Chosen."""


def jams(truth: PrivilegedState) -> list[Entity]:
    """Return the present entities that block traffic."""
    entities = truth.plan.instance.entities
    return [entity for entity in entities if entity.blocked_m is not None and truth.present(entity.id)]


def is_blocked(truth: PrivilegedState, place: GroundPoint) -> bool:
    """Return whether an entity blocks traffic at a place."""
    return any(math.dist(truth.place(jam.id), place) <= (jam.blocked_m or 0.0) for jam in jams(truth))


def jams_on(truth: PrivilegedState, route: Route) -> list[Entity]:
    """Return the obstacles on a route, in the order of the route."""
    blocking = [jam for jam in jams(truth) if _off_route(truth, route, jam) <= (jam.blocked_m or 0.0)]
    return sorted(blocking, key=lambda entity: segment(truth, route, entity))


def _off_route(truth: PrivilegedState, route: Route, entity: Entity) -> float:
    """Return the distance in metres between an entity and a route."""
    here = truth.place(entity.id)
    return min(distance_to_segment_m(here, a, b) for a, b in pairwise(_line(truth, route)))


def segment(truth: PrivilegedState, route: Route, entity: Entity) -> int:
    """Return the index of the waypoint before which an entity stands on a route."""
    here = truth.place(entity.id)
    pieces = list(pairwise(_line(truth, route)))
    return min(range(len(pieces)), key=lambda number: (round(distance_to_segment_m(here, *pieces[number]), 1), number))


def another_way(truth: PrivilegedState, route: Route, jam: Entity) -> dict[str, Datum]:
    """Return the body of a message that requests another route because of a jam."""
    number = min(segment(truth, route, jam) + 1, len(route.waypoints))
    return {"waypoint": number, "position": truth.states[jam.id].position, "confidence": 1.0}


class RouteWatch:
    """Decides whether a vehicle should wait for another route.

    It waits while a route that must be inspected is unknown, or while an obstacle on the present route was not on the
    one before, since another route may be requested. An obstacle that a new route still passes cannot be avoided.
    """

    def __init__(self, vehicle: str) -> None:
        self._vehicle = vehicle
        self._before: frozenset[str] = frozenset()
        self._now: frozenset[str] = frozenset()
        self._state, self._since = (0, 0), 0

    def is_to_wait(self, truth: PrivilegedState) -> bool:
        """Return whether to wait. Call it at every boundary: it stores obstacles of earlier routes and the last
        progress.
        """
        own = (spec for spec in truth.plan.instance.inspections if spec.asset == self._vehicle)
        checks = [spec for spec in own if spec.replan]
        route = truth.routes.get(self._vehicle)
        seen = sum(len(truth.known.inspected.get(check.name, ())) for check in checks)
        state = (0 if route is None else route.number, seen)
        if state[0] != self._state[0]:
            self._before |= self._now
        if state != self._state:
            self._state, self._since = state, truth.tick
        if truth.tick - self._since >= max(PATIENCE_TICKS, PATIENCE_S / truth.brief.tick_s):
            return False
        if route is None:
            return any(check.destination for check in checks)
        self._now = frozenset(jam.id for jam in jams_on(truth, route)) if checks else frozenset()
        return not self._now <= self._before


def _line(truth: PrivilegedState, route: Route) -> list[GroundPoint]:
    start = truth.plan.entities[route.entity].position[:2] if route.number == 1 else truth.place(route.entity)
    return [start, *(point[:2] for point in route.waypoints)]
