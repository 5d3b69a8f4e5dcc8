"""The relation of decision tick and macro-step: one rule for the checker and for instances."""

from __future__ import annotations

_MAX_STEPS = 100_000
"""The largest number of macro-steps of one tick (chosen): an hour in steps of 36 ms. A larger number comes from a
mistaken unit, and such a tick would not end in practice."""

_TOLERANCE = 1e-9
"""Relative deviation of tick / sync from a whole number that is accepted, because neither is exact in binary (chosen).
"""


def clock_fault(tick_s: float, sync_s: float) -> str:
    """The error of a clock as text, or "" if it has none. Both arguments in seconds."""
    if not (tick_s > 0 and sync_s > 0):
        return f"tick = {tick_s:g} s and sync = {sync_s:g} s must be above 0"
    steps = tick_s / sync_s
    if not steps <= _MAX_STEPS:
        return f"tick = {tick_s:g} s has {steps:.3g} steps of sync = {sync_s:g} s, at most {_MAX_STEPS:,} are possible"
    if abs(steps - round(steps)) > _TOLERANCE * steps or round(steps) < 1:
        return f"tick = {tick_s:g} s is no whole multiple of sync = {sync_s:g} s"
    return ""
