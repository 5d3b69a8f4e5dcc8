"""Fixed-step clocks: an engine's own time grid, independent of the intervals into which the kernel cuts an episode.

Steps are counted as integers, so neither the number of intervals nor their rounding changes the result. The state
between two grid points is the last state, moved along its velocity for the remainder.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from lingjing.errors import InfrastructureError


@dataclass(slots=True)
class StepClock:
    """A counter of steps."""

    dt_s: float
    """The step, seconds."""
    done: int = 0
    """The number of steps taken."""
    time_s: float = 0.0
    """The time of the last boundary, seconds."""

    @property
    def now_s(self) -> float:
        """Simulation time of the last step taken."""
        return self.done * self.dt_s

    @property
    def remainder_s(self) -> float:
        """Seconds from the last step to the last boundary, in [0, dt)."""
        return max(0.0, self.time_s - self.now_s)

    def steps_until(self, until: float) -> int:
        """Return the steps to take to reach `until`, and set `time_s`. Raises `InfrastructureError` for a time before
        the last boundary."""
        if not math.isfinite(until) or until < self.time_s - 1e-9:
            raise InfrastructureError(f"an engine at {self.time_s} s was asked to advance to {until} s")
        self.time_s = until
        return max(0, math.floor(until / self.dt_s + 1e-6) - self.done)

    def is_boundary(self, period_s: float) -> bool:
        """Return True if the last boundary is a whole multiple of `period_s` (a decision boundary)."""
        ratio = self.time_s / period_s
        return abs(ratio - round(ratio)) < 1e-6


__all__ = ["StepClock"]
