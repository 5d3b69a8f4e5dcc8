"""What lets nobody pass, and where it stands on the route of a vehicle that is inspected, as the truth has it."""

from __future__ import annotations

from itertools import pairwise

from lingjing.plugins.policy import Datum, Entity, Route
from lingjing_agents.ground_plane import GroundPoint, distance_to_segment_m
from lingjing_agents.oracle.privileged_state import PrivilegedState


def jams(truth: PrivilegedState) -> list[Entity]:
    """What is there and lets nobody pass."""
    entities = truth.plan.instance.entities
    return [entity for entity in entities if entity.properties.get("blocks") is True and truth.present(entity.id)]


def jams_on(truth: PrivilegedState, route: Route) -> list[Entity]:
    """What blocks a route, in the order in which it comes to it."""
    found = [jam for jam in jams(truth) if off_route(truth, route, jam) <= jam.number_or("radius_m", 0.0)]
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


def _line(truth: PrivilegedState, route: Route) -> list[GroundPoint]:
    start = truth.plan.entities[route.entity].position[:2] if route.number == 1 else truth.place(route.entity)
    return [start, *(point[:2] for point in route.waypoints)]
