"""Who goes where in which order: shortest tours of one body, shares of several."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import islice, pairwise, permutations

from lingjing_agents.ground_plane import GroundPoint

MAX_TOURS = 5040
"""So many orders of one tour are tried: all of those of seven places."""


def shortest(start: GroundPoint, places: Mapping[str, GroundPoint]) -> tuple[str, ...]:
    """The names of all places in the order of the shortest open tour from `start`; the first of equal ones."""

    def length(order: Sequence[str]) -> float:
        return sum(math.dist(a, b) for a, b in pairwise([start, *(places[name] for name in order)]))

    return min(islice(permutations(places), MAX_TOURS), key=length)


def shares(
    bodies: Mapping[str, GroundPoint], order: Sequence[str], places: Mapping[str, GroundPoint]
) -> dict[str, list[str]]:
    """Each place, in `order`, goes to the body that would be there first; bodies go from place to place."""
    free = {name: (0.0, place) for name, place in bodies.items()}
    found: dict[str, list[str]] = {name: [] for name in bodies}
    for target in order:
        if not free:
            break
        there = places[target]
        name = min(free, key=lambda name: (free[name][0] + math.dist(free[name][1], there), name))
        free[name] = free[name][0] + math.dist(free[name][1], there), there
        found[name].append(target)
    return found
