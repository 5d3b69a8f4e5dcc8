"""How a decision tick and the macro-step in it must fit: one rule for the checker and for instances."""

from __future__ import annotations

MOST_STEPS = 100_000
"""Macro-steps of one tick: an hour in steps of 36 ms. Beyond that a unit was mistaken, and a tick would never end."""

TOLERANCE = 1e-9
"""Relative: how far tick / sync may be from a whole number, because neither is exact in binary."""


def clock_fault(tick_s: float, sync_s: float) -> str:
    """What is wrong with a clock, or ""; seconds."""
    if not (tick_s > 0 and sync_s > 0):
        return f"tick = {tick_s:g} s and sync = {sync_s:g} s must be above 0"
    steps = tick_s / sync_s
    if not steps <= MOST_STEPS:
        return f"tick = {tick_s:g} s has {steps:.3g} steps of sync = {sync_s:g} s, at most {MOST_STEPS:,} are possible"
    if abs(steps - round(steps)) > TOLERANCE * steps or round(steps) < 1:
        return f"tick = {tick_s:g} s is no whole multiple of sync = {sync_s:g} s"
    return ""
