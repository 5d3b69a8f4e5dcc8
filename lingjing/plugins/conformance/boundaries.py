"""The checks of each boundary: its engine, its time, its entities, finite numbers, and the owners of bodies."""

from __future__ import annotations

import math
from collections.abc import Iterable

from lingjing.plugins.conformance.case import EngineCase, require, require_finite
from lingjing.plugins.engine import Boundary
from lingjing.trace.records import BodyState, Route


def check_boundary(case: EngineCase, boundary: Boundary, until: float) -> None:
    """Check one boundary: its engine, time, entities and numbers. Raises `ConformanceError`."""
    require(boundary.engine == case.plugin.name, f"a boundary of `{boundary.engine}`, not `{case.plugin.name}`")
    require(abs(boundary.time_s - until) < 1e-9, f"a boundary at {boundary.time_s} s instead of {until} s")
    wanted, got = sorted(case.spec.owns), sorted(state.id for state in boundary.states)
    require(wanted == got, f"the boundary at {until} s has {got} instead of the owned {wanted}")
    for state in (*boundary.states, *boundary.ambient):
        _check_numbers(state, until)
    _check_ambient(case, boundary.ambient, until)
    _check_links(case, boundary.unreachable_links, until)
    for route in boundary.routes:
        _check_route(case, route, until)


def check_events(boundary: Boundary, start: float, until: float) -> None:
    """Check that events lie in the interval, name entities and have finite values. Raises `ConformanceError`."""
    for event in boundary.events:
        inside = start - 1e-9 <= event.time_s <= until + 1e-9
        require(inside, f"advance: event `{event.kind}` at {event.time_s} s, outside of {start}..{until} s")
        require(bool(event.entities), f"advance: event `{event.kind}` names no entity")
        finite = all(math.isfinite(value) for value in event.values.values())
        require(finite, f"advance: event `{event.kind}` holds a value that is not finite: {event.values}")


def check_route_numbers(routes: Iterable[Route]) -> None:
    """Check that each entity's routes have the numbers 1, 2, 3, … Raises `ConformanceError`."""
    numbers: dict[str, int] = {}
    for route in routes:
        wanted = numbers.get(route.entity, 0) + 1
        require(route.number == wanted, f"route {route.number} of `{route.entity}` should have number {wanted}")
        numbers[route.entity] = wanted


def _check_numbers(state: BodyState, until: float) -> None:
    require_finite(state, until)
    require(0.0 <= state.heading_deg < 360.0, f"`{state.id}` at {until} s: heading {state.heading_deg} not in 0..360")


def _check_ambient(case: EngineCase, ambient: Iterable[BodyState], until: float) -> None:
    entities = {entity.id for entity in case.instance.entities}
    seen: set[str] = set()
    for state in ambient:
        what = f"the ambient body `{state.id}` at {until} s"
        require(state.id not in entities, f"{what} has the id of an entity")
        require(state.id not in seen, f"{what} occurs twice")
        require(state.kind != "", f"{what} has no `kind`")
        seen.add(state.id)


def _check_links(case: EngineCase, links: Iterable[tuple[str, str]], until: float) -> None:
    order = {entity.id: place for place, entity in enumerate(case.instance.entities)}
    for first, second in links:
        what = f"unreachable_links at {until} s: ({first}, {second})"
        require(first in order and second in order, f"{what} is not a pair of entities")
        require(order[first] < order[second], f"{what} is not in the instance's order")


def _check_route(case: EngineCase, route: Route, until: float) -> None:
    what = f"route {route.number} of `{route.entity}`"
    require(route.entity in case.spec.owns, f"{what} at {until} s is for an entity of another engine")
    require(bool(route.waypoints), f"{what} has no waypoints")
    numbers = [number for point in route.waypoints for number in point]
    finite = all(math.isfinite(number) for number in (*numbers, route.length_m, route.duration_s))
    require(
        finite and route.length_m >= 0.0 and route.duration_s >= 0.0,
        f"{what} has a number that is not finite or a negative length",
    )
    require(route.time_s <= until + 1e-9, f"{what} was planned at {route.time_s} s, after {until} s")


__all__ = ["check_boundary", "check_events", "check_route_numbers"]
