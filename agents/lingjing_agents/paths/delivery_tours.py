"""Tours from a depot: the stops of each load, by the savings method (Clarke and Wright, 1964), and their order.

A demand above a load is split into full loads and a rest. All agents with the same stops compute the same tours.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

from lingjing_agents.ground_plane import GroundPoint


@dataclass(frozen=True, slots=True)
class DeliveryTour:
    """One tour from the depot and back."""

    stops: tuple[str, ...]
    """The stops in order."""
    amounts: tuple[float, ...]
    """The amount for each stop."""
    length_m: float
    """The length along streets in metres."""

    @property
    def load(self) -> float:
        """The total amount of the tour."""
        return sum(self.amounts)


def street_m(a: GroundPoint, b: GroundPoint) -> float:
    """Return the distance between two places in a town of square blocks (Manhattan metric)."""
    return abs(a[0] - b[0]) + abs(a[1] - b[1])


def tours(
    depot: GroundPoint, places: Mapping[str, GroundPoint], demands: Mapping[str, float], load: float
) -> tuple[DeliveryTour, ...]:
    """Return tours that serve all demands with at most `load` each, the longest first."""
    visits = _visits(demands, load)
    routes: list[list[int]] = [[number] for number in range(len(visits))]
    where = [places[stop] for stop, _ in visits]
    savings = sorted(
        (-(street_m(depot, where[a]) + street_m(depot, where[b]) - street_m(where[a], where[b])), a, b)
        for a in range(len(visits))
        for b in range(a + 1, len(visits))
    )
    for saving, a, b in savings:
        first, second = _route_of(routes, a), _route_of(routes, b)
        heavy = sum(visits[number][1] for number in (*first, *second)) > load + 1e-6
        if saving >= 0.0 or first is second or heavy:
            continue
        joined = _joined(first, second, a, b)
        if joined is not None:
            routes.remove(first)
            routes.remove(second)
            routes.append(joined)
    made = [_tour(depot, where, visits, route) for route in routes]
    return tuple(sorted(made, key=lambda tour: (-tour.length_m, tour.stops)))


def shared_out(plan: tuple[DeliveryTour, ...], vans: tuple[str, ...]) -> dict[str, list[DeliveryTour]]:
    """Assign tours to vans, the longest first, each to the van with the shortest total so far (ties in the vans'
    order).
    """
    queue: dict[str, list[DeliveryTour]] = {van: [] for van in vans}
    for tour in plan:
        name = min(vans, key=lambda van: (sum(each.length_m for each in queue[van]), vans.index(van)))
        queue[name].append(tour)
    return queue


def _visits(demands: Mapping[str, float], load: float) -> list[tuple[str, float]]:
    visits: list[tuple[str, float]] = []
    for stop, demand in demands.items():
        full, rest = divmod(demand, load) if load > 0 else (0, 0.0)
        visits += [(stop, load)] * int(full) + ([(stop, rest)] if rest > 1e-6 else [])
    return visits


def _route_of(routes: list[list[int]], number: int) -> list[int]:
    return next(route for route in routes if number in route)


def _joined(first: list[int], second: list[int], a: int, b: int) -> list[int] | None:
    """Return both routes joined with `a` and `b` as neighbours, or None if one of them lies inside its route."""
    head = first if first[-1] == a else first[::-1] if first[0] == a else None
    tail = second if second[0] == b else second[::-1] if second[-1] == b else None
    return head + tail if head is not None and tail is not None else None


def _tour(
    depot: GroundPoint, where: list[GroundPoint], visits: list[tuple[str, float]], route: list[int]
) -> DeliveryTour:
    if math.dist(depot, where[route[-1]]) < math.dist(depot, where[route[0]]):
        route = route[::-1]
    path = [depot, *(where[number] for number in route), depot]
    length = sum(street_m(a, b) for a, b in pairwise(path))
    return DeliveryTour(
        tuple(visits[number][0] for number in route), tuple(visits[number][1] for number in route), length
    )
