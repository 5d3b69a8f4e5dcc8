"""Which bodies of a fleet are close to each other, without comparing each with all."""

from __future__ import annotations

import math
from collections.abc import Sequence

from lingjing.mission.instance import Vector


def close_pairs(places: Sequence[Vector], distance_m: float) -> list[tuple[int, int]]:
    """The pairs of places less than `distance_m` apart, by their numbers and in their order (a sweep along x)."""
    order = sorted(range(len(places)), key=lambda number: places[number][0])
    found = []
    for rank, one in enumerate(order):
        for next_rank in range(rank + 1, len(order)):
            other = order[next_rank]
            if places[other][0] - places[one][0] >= distance_m:
                break
            if math.dist(places[one], places[other]) < distance_m:
                found.append((min(one, other), max(one, other)))
    return sorted(found)
