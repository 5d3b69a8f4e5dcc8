"""The past of the conditions in one call of a function over time, and the value of the call."""

from __future__ import annotations

import msgspec

TOLERANCE_S = 1e-9
"""Tolerance of comparisons of durations, seconds (chosen: far below a macro-step)."""


class ConditionPast(msgspec.Struct, frozen=True):
    """The past of the conditions of one call, in their order."""

    true: tuple[bool, ...]
    """Their truth at the last instant that was examined."""
    since_s: tuple[float | None, ...]
    """The time at which each last became true, seconds; None if it never did."""
    first_s: tuple[float | None, ...]
    """The time at which each first became true, seconds; None if it never did."""
    gap_s: float | None = None
    """The shortest time from the first condition's becoming true to that of the second, seconds; None if the second
    never became true after the first."""

    def held(self, duration_s: float, time_s: float) -> bool:
        """Return whether the condition is true, and was for at least a duration."""
        since = self.since_s[0]
        return self.true[0] and since is not None and time_s - since >= duration_s - TOLERANCE_S

    def within(self, duration_s: float) -> bool:
        """Return whether the second condition became true at most a duration after the first."""
        return self.gap_s is not None and self.gap_s <= duration_s + TOLERANCE_S

    def before(self) -> bool:
        """Return whether the first condition became true before the second."""
        first, second = self.first_s
        return first is not None and (second is None or first < second)
