"""Who flies how high: each aircraft of a team has flight levels of its own, so that no two fly level at one height.

All of a team compute the same levels from what their briefs tell them; nothing has to be said. The levels of the first
lie a whole period apart, those of the next a layer above them, and so on: whatever height a task asks for, an own level
lies less than a period above it, and two levels of different aircraft are at least a layer apart. Where the band is too
thin for that, each has one level.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from lingjing.plugins.policy import Vector

LAYER_M = 2.5
"""Between two levels: what an aircraft errs in gusts, and the other too, with room between."""

CROWDED_M = 20.0
"""Pads nearer to each other than this are left straight up."""

_OVERHEAD_M = 12.0


@dataclass(frozen=True, slots=True)
class FlightLevels:
    """The flight levels of one aircraft: the `index`-th of `count`, between two elevations, metres.

    `anchor_m` is an elevation that is a level of the first one.
    """

    index: int
    count: int
    low_m: float = 0.0
    high_m: float = math.inf
    anchor_m: float = 0.0

    def level(self, z_m: float) -> float:
        """The lowest own level that is not below an elevation; below it only where the band ends."""
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
    """Whether another aircraft is so near that one leaves the ground straight up."""
    return any(math.dist(here[:2], other[:2]) < CROWDED_M for other in others)


def overhead(here: Vector, others: Iterable[Vector]) -> bool:
    """Whether another aircraft is right above one that stands on the ground."""
    return any(math.dist(here[:2], other[:2]) < _OVERHEAD_M and other[2] > here[2] + 2.0 for other in others)
