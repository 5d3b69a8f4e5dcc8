"""Flight levels: each aircraft of a team has levels of its own, so that no two fly at the same height.

All aircraft of a team compute the same levels from their briefs, without communication. The levels of the first
aircraft lie one period apart, those of the second one layer above them, and so on. For any wanted height, an aircraft
has a level less than one period above it, and levels of different aircraft differ by at least one layer. If the
altitude band is thinner than a period, each aircraft has one level.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from lingjing.plugins.policy import Vector

LAYER_M = 2.5
"""Distance between two levels in metres. Chosen: twice the vertical error of an aircraft in gusts, with a margin."""

CROWDED_M = 20.0
"""Distance in metres between two pads below which an aircraft takes off vertically. Chosen."""

_OVERHEAD_M = 12.0
"""Horizontal distance in metres within which another aircraft counts as overhead. Chosen."""


@dataclass(frozen=True, slots=True)
class FlightLevels:
    """The flight levels of one aircraft between two elevations."""

    index: int
    """The place of the aircraft in its team, from 0."""
    count: int
    """The size of the team."""
    low_m: float = 0.0
    """The lowest elevation in metres."""
    high_m: float = math.inf
    """The highest elevation in metres."""
    anchor_m: float = 0.0
    """An elevation in metres that is a level of the first aircraft."""

    def level(self, z_m: float) -> float:
        """Return the lowest own level that is not below `z_m`, or the highest one of the band."""
        wanted = min(max(z_m, self.low_m), self.high_m)
        if self.count <= 1:
            return wanted
        period = LAYER_M * self.count
        if self.high_m - self.low_m < period:
            room = max(self.high_m - self.low_m, 0.0)
            return self.low_m + self.index * min(LAYER_M, room / max(self.count - 1, 1))
        own = self.anchor_m + LAYER_M * self.index
        least = math.ceil((self.low_m - own) / period)
        most = math.floor((self.high_m - own) / period) if math.isfinite(self.high_m) else math.inf
        return own + period * min(max(math.ceil((wanted - own) / period - 1e-9), least), most)


def crowded(here: Vector, others: Iterable[Vector]) -> bool:
    """Return whether another aircraft is so near that a take-off must be vertical."""
    return any(math.dist(here[:2], other[:2]) < CROWDED_M for other in others)


def overhead(here: Vector, others: Iterable[Vector]) -> bool:
    """Return whether another aircraft is directly above one that stands on the ground."""
    return any(math.dist(here[:2], other[:2]) < _OVERHEAD_M and other[2] > here[2] + 2.0 for other in others)
