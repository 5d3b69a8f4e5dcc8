"""Fixed-step clocks: an engine's own time grid, reached exactly however the kernel cuts an episode into intervals.

Steps are counted as integers, so neither the number of intervals nor their rounding changes what is computed. A time
between two grid points is answered by moving the last state on along its velocity for the remainder.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from lingjing.errors import InfrastructureError


@dataclass(slots=True)
class StepClock:
    """Counts steps of `dt_s`; `done` is how many have been taken, `time_s` what the kernel has been told."""

    dt_s: float
    done: int = 0
    time_s: float = 0.0

    @property
    def now_s(self) -> float:
        """Simulation time of the last step taken."""
        return self.done * self.dt_s

    @property
    def remainder_s(self) -> float:
        """What lies between the last step and the time asked for, in [0, dt)."""
        return max(0.0, self.time_s - self.now_s)

    def steps_until(self, until: float) -> int:
        """Steps to take to reach `until`; sets `time_s`. Time that runs backwards is a broken caller."""
        if not math.isfinite(until) or until < self.time_s - 1e-9:
            raise InfrastructureError(f"an engine at {self.time_s} s was asked to advance to {until} s")
        self.time_s = until
        return max(0, math.floor(until / self.dt_s + 1e-6) - self.done)

    def is_boundary(self, period_s: float) -> bool:
        """Whether the time asked for is a whole multiple of `period_s` (a decision boundary)."""
        ratio = self.time_s / period_s
        return abs(ratio - round(ratio)) < 1e-6


__all__ = ["StepClock"]
