"""What the operators and functions of expressions mean over bounds: what is certain before a mission runs.

A number is known to lie between `Bounds`; one of which nothing is known is `ANYTHING`. A comparison is true or false
where every pair of numbers between the bounds has that in common, and None otherwise.
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
        """Whether it is one number."""
        return self.low == self.high


ANYTHING = Bounds(-math.inf, math.inf)


class Estimate(NamedTuple):
    """Where something is in the plane, metres, and how far off that may be."""

    east: float
    north: float
    off_m: float


def exactly(value: float) -> Bounds:
    """One number."""
    return Bounds(float(value), float(value))


def negative(value: Bounds) -> Bounds:
    """`-x`."""
    return Bounds(-value.high, -value.low)


def plus(left: Bounds, right: Bounds) -> Bounds:
    """`a + b`."""
    return Bounds(left.low + right.low, left.high + right.high)


def minus(left: Bounds, right: Bounds) -> Bounds:
    """`a - b`."""
    return Bounds(left.low - right.high, left.high - right.low)


def times(left: Bounds, right: Bounds) -> Bounds:
    """`a * b`."""
    products = [a * b for a, b in itertools.product(left, right)]
    return ANYTHING if any(map(math.isnan, products)) else Bounds(min(products), max(products))


def over(left: Bounds, right: Bounds) -> Bounds:
    """`a / b`; anything where b may be zero."""
    if right.low <= 0.0 <= right.high:
        return ANYTHING
    return times(left, Bounds(1.0 / right.high, 1.0 / right.low))


def least(*values: Bounds) -> Bounds:
    """`min(a, b)`."""
    return Bounds(min(value.low for value in values), min(value.high for value in values))


def greatest(*values: Bounds) -> Bounds:
    """`max(a, b)`."""
    return Bounds(max(value.low for value in values), max(value.high for value in values))


def total(*values: Bounds) -> Bounds:
    """`sum(… for x in group)`."""
    return Bounds(math.fsum(value.low for value in values), math.fsum(value.high for value in values))


def magnitude(value: Bounds) -> Bounds:
    """`abs(x)`."""
    ends = abs(value.low), abs(value.high)
    return Bounds(0.0 if value.low <= 0.0 <= value.high else min(ends), max(ends))


def distance(one: Estimate | Bounds, other: Estimate | Bounds) -> Bounds:
    """Horizontal metres between two places, as far as both are known."""
    if not isinstance(one, Estimate) or not isinstance(other, Estimate):
        return Bounds(0.0, math.inf)
    apart, off = math.dist(one[:2], other[:2]), one.off_m + other.off_m
    return Bounds(max(0.0, apart - off), apart + off)


def monotone(function: Callable[[float], float]) -> Callable[[Bounds], Bounds]:
    """A function that never falls, over bounds; anything where an end has no value."""

    def applied(value: Bounds) -> Bounds:
        try:
            return Bounds(float(function(value.low)), float(function(value.high)))
        except (ValueError, OverflowError):
            return ANYTHING

    return applied


def less(left: Bounds, right: Bounds) -> bool | None:
    """`a < b`."""
    return True if left.high < right.low else False if left.low >= right.high else None


def at_most(left: Bounds, right: Bounds) -> bool | None:
    """`a <= b`."""
    return True if left.high <= right.low else False if left.low > right.high else None


def more(left: Bounds, right: Bounds) -> bool | None:
    """`a > b`."""
    return less(right, left)


def at_least(left: Bounds, right: Bounds) -> bool | None:
    """`a >= b`."""
    return at_most(right, left)


def same(left: Bounds, right: Bounds) -> bool | None:
    """`a == b`."""
    if left.high < right.low or left.low > right.high:
        return False
    return True if left.exact and left == right else None


def different(left: Bounds, right: Bounds) -> bool | None:
    """`a != b`."""
    equal = same(left, right)
    return None if equal is None else not equal


def both(one: bool | None, other: bool | None) -> bool | None:
    """`a and b`."""
    if one is False or other is False:
        return False
    return None if one is None or other is None else True


def either(one: bool | None, other: bool | None) -> bool | None:
    """`a or b`."""
    if one is True or other is True:
        return True
    return None if one is None or other is None else False
