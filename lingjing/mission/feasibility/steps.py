"""Sets of macro-steps of an episode, and the step at which a condition of `now` begins or ends to hold.

Macro-steps are counted from 0, the start. Every `per_tick`-th one is a decision boundary. A set is a tuple of disjoint
inclusive ranges in rising order.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import msgspec

from lingjing.mission.instance import Instance

Steps = tuple[tuple[int, int], ...]
"""Disjoint inclusive ranges of macro-steps in rising order."""

NEVER = 1 << 62
"""A macro-step that no episode reaches."""

_SLACK_S = 1e-6
"""Tolerance of a duration that is rounded up to whole macro-steps, seconds (chosen)."""


class StepClock(msgspec.Struct, frozen=True):
    """The macro-steps of an episode."""

    ticks: int
    per_tick: int
    """Macro-steps of one tick."""
    tick_s: float
    sync_s: float

    @property
    def last(self) -> int:
        """The macro-step of the last boundary."""
        return self.ticks * self.per_tick

    @property
    def always(self) -> Steps:
        """All macro-steps of the episode."""
        return ((0, self.last),)

    def time_s(self, step: int) -> float:
        """The time of a macro-step, computed as the kernel computes it, so that comparisons have the same result."""
        tick, inner = divmod(step, self.per_tick)
        return tick * self.tick_s + inner * self.sync_s

    def after(self, step: int, seconds: float) -> int:
        """The first macro-step that is at least `seconds` later."""
        if step >= NEVER or math.isinf(seconds):
            return NEVER
        return step + max(0, math.ceil((seconds - _SLACK_S) / self.sync_s - 1e-9))

    def boundary(self, step: int) -> int:
        """The first boundary at or after a macro-step."""
        return step if step >= NEVER else -(-step // self.per_tick) * self.per_tick

    def first_boundary(self, steps: Steps, at_least: int = 0) -> int:
        """The first boundary in a set of steps from `at_least` on; `NEVER` if there is none."""
        for low, high in steps:
            boundary = self.boundary(max(low, at_least))
            if boundary <= high:
                return boundary
        return NEVER

    def since(self, step: int) -> Steps:
        """All macro-steps from `step` on."""
        return ((step, self.last),) if step <= self.last else ()

    def until(self, step: int) -> Steps:
        """All macro-steps up to `step`."""
        return ((0, min(step, self.last)),) if step >= 0 else ()

    def where(self, holds: Callable[[float], bool], *, rising: bool) -> Steps:
        """The macro-steps with a time at which a monotone predicate holds: the last steps if `rising`, else the first
        ones."""
        low, high = 0, self.last + 1  # the first step at which the predicate has its later value
        while low < high:
            middle = (low + high) // 2
            if holds(self.time_s(middle)) == rising:
                high = middle
            else:
                low = middle + 1
        return self.since(low) if rising else self.until(low - 1)

    def other(self, steps: Steps) -> Steps:
        """The macro-steps of the episode that are not in the set."""
        gaps, start = [], 0
        for low, high in steps:
            if start < low:
                gaps.append((start, low - 1))
            start = high + 1
        if start <= self.last:
            gaps.append((start, self.last))
        return tuple(gaps)


def step_clock(instance: Instance) -> StepClock:
    """The macro-steps of an instance."""
    clock = instance.clock
    per_tick = max(1, round(clock.tick_s / clock.sync_s))
    return StepClock(max(0, instance.budget.ticks), per_tick, clock.tick_s, clock.sync_s)


def common(left: Steps, right: Steps) -> Steps:
    """The steps in both sets."""
    if left is right or (len(left) == 1 and len(right) == 1 and left == right):
        return left
    shared = []
    for low, high in left:
        for other_low, other_high in right:
            first, last = max(low, other_low), min(high, other_high)
            if first <= last:
                shared.append((first, last))
    return tuple(sorted(shared))


def joined(left: Steps, right: Steps) -> Steps:
    """The steps in one of the sets or both."""
    if not right or left is right:
        return left
    if not left:
        return right
    ranges: list[tuple[int, int]] = []
    for low, high in sorted((*left, *right)):
        if ranges and low <= ranges[-1][1] + 1:
            ranges[-1] = ranges[-1][0], max(ranges[-1][1], high)
        else:
            ranges.append((low, high))
    return tuple(ranges)


def at_least_of(least: int, sets: tuple[Steps, ...], clock: StepClock) -> Steps:
    """The steps that at least `least` of the sets have."""
    if least <= 0:
        return clock.always
    changes: dict[int, int] = {}
    for steps in sets:
        for low, high in steps:
            changes[low] = changes.get(low, 0) + 1
            changes[high + 1] = changes.get(high + 1, 0) - 1
    ranges: list[tuple[int, int]] = []
    count, start = 0, 0
    for step in sorted(changes):
        before, count = count, count + changes[step]
        if before < least <= count:
            start = step
        elif count < least <= before:
            ranges.append((start, step - 1))
    return tuple(ranges)


def first(steps: Steps) -> int:
    """The first step of a set; `NEVER` for an empty one."""
    return steps[0][0] if steps else NEVER
