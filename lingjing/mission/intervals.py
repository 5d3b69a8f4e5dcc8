"""The operators and functions of expressions over bounds (interval arithmetic): results that hold in every run.

A number lies within its `Bounds`; an unknown one is `ANYTHING`. A comparison is true or false if it is so for every
pair of numbers within the bounds, and None otherwise.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable
from typing import NamedTuple


class Bounds(NamedTuple):
    """The least and the greatest value of a number."""

    low: float
    high: float

    @property
    def exact(self) -> bool:
        """True if the number is known."""
        return self.low == self.high


ANYTHING = Bounds(-math.inf, math.inf)
"""The bounds of an unknown number."""


class Estimate(NamedTuple):
    """A position in the plane, metres, with its largest error."""

    east: float
    north: float
    off_m: float
    """Largest distance from the true position, metres."""


def exactly(value: float) -> Bounds:
    """The bounds of a known number."""
    return Bounds(float(value), float(value))


def negative(value: Bounds) -> Bounds:
    """Return the bounds of `-x`."""
    return Bounds(-value.high, -value.low)


def plus(left: Bounds, right: Bounds) -> Bounds:
    """Return the bounds of `a + b`."""
    return Bounds(left.low + right.low, left.high + right.high)


def minus(left: Bounds, right: Bounds) -> Bounds:
    """Return the bounds of `a - b`."""
    return Bounds(left.low - right.high, left.high - right.low)


def times(left: Bounds, right: Bounds) -> Bounds:
    """Return the bounds of `a * b`."""
    products = [a * b for a, b in itertools.product(left, right)]
    return ANYTHING if any(map(math.isnan, products)) else Bounds(min(products), max(products))


def over(left: Bounds, right: Bounds) -> Bounds:
    """Return the bounds of `a / b`; anything if b may be zero."""
    if right.low <= 0.0 <= right.high:
        return ANYTHING
    return times(left, Bounds(1.0 / right.high, 1.0 / right.low))


def least(*values: Bounds) -> Bounds:
    """Return the bounds of `min(a, b)`."""
    return Bounds(min(value.low for value in values), min(value.high for value in values))


def greatest(*values: Bounds) -> Bounds:
    """Return the bounds of `max(a, b)`."""
    return Bounds(max(value.low for value in values), max(value.high for value in values))


def total(*values: Bounds) -> Bounds:
    """Return the bounds of `sum(… for x in group)`."""
    return Bounds(math.fsum(value.low for value in values), math.fsum(value.high for value in values))


def magnitude(value: Bounds) -> Bounds:
    """Return the bounds of `abs(x)`."""
    ends = abs(value.low), abs(value.high)
    return Bounds(0.0 if value.low <= 0.0 <= value.high else min(ends), max(ends))


def distance(first: Estimate | Bounds, second: Estimate | Bounds) -> Bounds:
    """Horizontal metres between two places, as far as both are known."""
    if not isinstance(first, Estimate) or not isinstance(second, Estimate):
        return Bounds(0.0, math.inf)
    apart, off = math.dist(first[:2], second[:2]), first.off_m + second.off_m
    return Bounds(max(0.0, apart - off), apart + off)


def share(first: Estimate | Bounds, second: Estimate | Bounds) -> Bounds:
    """A part of a whole: the overlap of two boxes, whatever they are."""
    return Bounds(0.0, 1.0)


def monotone(function: Callable[[float], float]) -> Callable[[Bounds], Bounds]:
    """A non-decreasing function over bounds; anything if it has no value at an end."""

    def bounds_of(value: Bounds) -> Bounds:
        try:
            return Bounds(float(function(value.low)), float(function(value.high)))
        except (ValueError, OverflowError):
            return ANYTHING

    return bounds_of


def less(left: Bounds, right: Bounds) -> bool | None:
    """Return the truth of `a < b`."""
    return True if left.high < right.low else False if left.low >= right.high else None


def at_most(left: Bounds, right: Bounds) -> bool | None:
    """Return the truth of `a <= b`."""
    return True if left.high <= right.low else False if left.low > right.high else None


def more(left: Bounds, right: Bounds) -> bool | None:
    """Return the truth of `a > b`."""
    return less(right, left)


def at_least(left: Bounds, right: Bounds) -> bool | None:
    """Return the truth of `a >= b`."""
    return at_most(right, left)


def same(left: Bounds, right: Bounds) -> bool | None:
    """Return the truth of `a == b`."""
    if left.high < right.low or left.low > right.high:
        return False
    return True if left.exact and left == right else None


def different(left: Bounds, right: Bounds) -> bool | None:
    """Return the truth of `a != b`."""
    equal = same(left, right)
    return None if equal is None else not equal


def both(left: bool | None, right: bool | None) -> bool | None:
    """Return the truth of `a and b`."""
    if left is False or right is False:
        return False
    return None if left is None or right is None else True


def either(left: bool | None, right: bool | None) -> bool | None:
    """Return the truth of `a or b`."""
    if left is True or right is True:
        return True
    return None if left is None or right is None else False
