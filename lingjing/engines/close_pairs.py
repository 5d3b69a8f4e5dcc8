"""Search for pairs of bodies that are close to each other, by a sweep along x."""

from __future__ import annotations

import math
from collections.abc import Sequence

from lingjing.mission.instance import Vector


def close_pairs(places: Sequence[Vector], distance_m: float) -> list[tuple[int, int]]:
    """Return the pairs of indices of places less than `distance_m` apart; each pair and the list are in ascending
    order."""
    order = sorted(range(len(places)), key=lambda number: places[number][0])
    pairs = []
    for rank, first in enumerate(order):
        for next_rank in range(rank + 1, len(order)):
            second = order[next_rank]
            if places[second][0] - places[first][0] >= distance_m:
                break
            if math.dist(places[first], places[second]) < distance_m:
                pairs.append((min(first, second), max(first, second)))
    return sorted(pairs)
