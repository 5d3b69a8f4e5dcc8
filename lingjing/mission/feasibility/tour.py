"""Tours: several visits by one vehicle or by a few take at least the shortest path through all of them."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import msgspec

from lingjing.mission.conditions.needs import NeedLeaf, VisitNeed
from lingjing.mission.conditions.outline import Body, Outline
from lingjing.mission.conditions.spread import gap
from lingjing.mission.feasibility.limits import TimeLimit
from lingjing.mission.feasibility.proof import Proof, both, exceeds, spelled
from lingjing.mission.feasibility.travel import meeting, movers_of

_MAX_EXACT_STOPS = 8
"""Most stops of one vehicle for which the shortest order is computed exactly; beyond, a spanning tree is the lower
bound (chosen for run time, which doubles with each stop)."""

_MAX_STOPS = 100
"""Tours of more stops are not checked (chosen): run time grows with the square of the number."""


class Tour(msgspec.Struct, frozen=True):
    """Visits that some of the movers must make."""

    movers: tuple[Body, ...]
    visits: tuple[VisitNeed, ...]
    metres: float
    """Lower bound of the distance that the movers drive together."""


def tours(leaves: Sequence[NeedLeaf], limit: TimeLimit, outline: Outline) -> list[Tour]:
    """The tour of every set of movers that must share two or more visits."""
    visits = [leaf for leaf in leaves if isinstance(leaf, VisitNeed)]
    sets = {frozenset(mover.id for mover in visit.movers): visit.movers for visit in visits}
    result = []
    for ids, movers in sets.items():
        served = _nearest_of_each_goal([v for v in visits if ids >= {mover.id for mover in v.movers}])
        if 2 <= len(served) <= _MAX_STOPS and not any(math.isinf(mover.speed_mps) or mover.aboard for mover in movers):
            result.append(Tour(movers, served, length(movers, served, limit, outline)))
    return result


def refute_tours(leaves: Sequence[NeedLeaf], limit: TimeLimit, outline: Outline) -> list[Proof]:
    """Proofs that the visits of a tour do not fit into the time limit or the batteries."""
    proofs = []
    for tour in tours(leaves, limit, outline):
        speed = sum(mover.speed_mps for mover in tour.movers)
        flown = sum(mover.speed_mps * min(limit.seconds, mover.flight_s) for mover in tour.movers)
        if speed > 0 and exceeds(tour.metres / speed, limit.seconds):
            proofs.append(_no_schedule(tour, speed, limit))
        elif speed > 0 and exceeds(tour.metres, flown):
            proofs.append(_no_battery(tour, flown))
    return proofs


def length(movers: tuple[Body, ...], visits: tuple[VisitNeed, ...], limit: TimeLimit, outline: Outline) -> float:
    """Lower bound of the distance that the movers cover together, metres. Within the limit, a goal moves at most by its
    speed."""
    goals = [meeting(visit, outline) for visit in visits]
    reach = [goal.radius_m + goal.speed_mps * limit.seconds for goal in goals]
    if any(math.isinf(metres) for metres in reach):
        return 0.0
    first = [
        min(_less(gap(mover.where, goal.where), r) for mover in movers) for goal, r in zip(goals, reach, strict=True)
    ]

    def leg(i: int, j: int) -> float:
        return _less(gap(goals[i].where, goals[j].where), reach[i] + reach[j])

    if len(movers) == 1 and len(goals) <= _MAX_EXACT_STOPS:
        return _shortest_path(first, leg)
    return _spanning_tree(first, leg)


def _nearest_of_each_goal(visits: Sequence[VisitNeed]) -> tuple[VisitNeed, ...]:
    """One visit for each goal: the one with the smallest radius."""
    nearest: dict[object, VisitNeed] = {}
    for visit in visits:
        key = visit.goal.id if isinstance(visit.goal, Body) else visit.goal
        known = nearest.get(key)
        if known is None or visit.radius_m < known.radius_m:
            nearest[key] = visit
    return tuple(nearest.values())


def _less(metres: float, radius: float) -> float:
    return max(0.0, metres - radius)


def _shortest_path(first: Sequence[float], leg: Callable[[int, int], float]) -> float:
    """The length of the shortest path from the start through all stops (Held and Karp 1962)."""
    count = len(first)
    legs = [[leg(i, j) if i != j else 0.0 for j in range(count)] for i in range(count)]
    best = {(1 << i, i): first[i] for i in range(count)}
    for visited in range(1, 1 << count):
        for last in range(count):
            here = best.get((visited, last))
            if here is None:
                continue
            for stop in range(count):
                if visited & 1 << stop:
                    continue
                key = visited | 1 << stop, stop
                best[key] = min(best.get(key, math.inf), here + legs[last][stop])
    return min(best[(1 << count) - 1, last] for last in range(count))


def _spanning_tree(first: Sequence[float], leg: Callable[[int, int], float]) -> float:
    """The length of the shortest tree that joins all stops to the starts (Prim 1957); every set of paths contains a
    tree."""
    nearest = dict(enumerate(first))
    total = 0.0
    while nearest:
        stop = min(nearest, key=lambda i: nearest[i])
        total += nearest.pop(stop)
        for other in nearest:
            nearest[other] = min(nearest[other], leg(stop, other))
    return total


def _no_schedule(tour: Tour, speed: float, limit: TimeLimit) -> Proof:
    needed, _ = both(tour.metres / speed, limit.seconds)
    together = "" if len(tour.movers) == 1 else " together"
    return Proof(
        "LJ0602",
        tour.visits[0].at,
        f"no schedule fits: to come within {_radii(tour)} of {_stops(tour)}, {movers_of(tour.movers)} must cover at "
        f"least {spelled(round(tour.metres, 3))} m{together}, which at {spelled(round(speed, 3))} m/s at most, "
        f"margins included, takes {needed} s, {limit.words}",
        "raise the budget, lower the number of goals, or add vehicles",
        ((limit.at, "the budget"), (tour.movers[0].path, "the vehicle"), *_goals(tour)),
    )


def _no_battery(tour: Tour, metres: float) -> Proof:
    needed, available = both(tour.metres, metres)
    return Proof(
        "LJ0603",
        tour.visits[0].at,
        f"no battery lasts: to come within {_radii(tour)} of {_stops(tour)}, {movers_of(tour.movers)} must cover at "
        f"least {needed} m, the batteries last for {available} m at most",
        "raise `endurance`, lower the number of goals, or add vehicles",
        ((tour.movers[0].path, "the vehicle"), *_goals(tour)),
    )


def _radii(tour: Tour) -> str:
    radii = sorted({visit.radius_m for visit in tour.visits})
    return f"{spelled(radii[0])} m" if len(radii) == 1 else f"{spelled(radii[0])} to {spelled(radii[-1])} m"


def _stops(tour: Tour) -> str:
    groups: dict[str, int] = {}
    for visit in tour.visits:
        word = visit.goal.entity.group if isinstance(visit.goal, Body) else ""
        groups[word] = groups.get(word, 0) + 1
    return " and ".join(f"{count} `{name}`" if name else f"{count} places" for name, count in groups.items())


def _goals(tour: Tour) -> tuple[tuple[str, str], ...]:
    paths = dict.fromkeys(visit.goal.path for visit in tour.visits if isinstance(visit.goal, Body))
    return tuple((path, "the destination") for path in paths)
