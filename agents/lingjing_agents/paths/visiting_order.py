"""Orders of visits: the shortest tour of one body, and the assignment of places to several bodies."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import islice, pairwise, permutations

from lingjing_agents.ground_plane import GroundPoint

MAX_TOURS = 5040
"""Number of orders that are compared: all those of seven places. Chosen."""


def shortest(start: GroundPoint, places: Mapping[str, GroundPoint]) -> tuple[str, ...]:
    """Return the names of all places in the order of the shortest open tour from `start`; the first of equal tours."""

    def length(order: Sequence[str]) -> float:
        return sum(math.dist(a, b) for a, b in pairwise([start, *(places[name] for name in order)]))

    return min(islice(permutations(places), MAX_TOURS), key=length)


def shares(
    bodies: Mapping[str, GroundPoint], order: Sequence[str], places: Mapping[str, GroundPoint]
) -> dict[str, list[str]]:
    """Assign each place, in `order`, to the body that would reach it first; bodies move from place to place."""
    free = {name: (0.0, place) for name, place in bodies.items()}
    assigned: dict[str, list[str]] = {name: [] for name in bodies}
    for target in order:
        if not free:
            break
        goal = places[target]
        name = min(free, key=lambda name: (free[name][0] + math.dist(free[name][1], goal), name))
        free[name] = free[name][0] + math.dist(free[name][1], goal), goal
        assigned[name].append(target)
    return assigned
