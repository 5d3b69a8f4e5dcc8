"""Values of expressions and their kinds, as used by all evaluations with exact values.

Numbers are in SI units, angles in degrees. A position is a `Place`, or a tuple of two or three numbers if it comes from
an engine's state or from a message.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Protocol, TypeGuard

import msgspec

from lingjing.errors import MissionError
from lingjing.mission import geometry2d

Value = Any
"""A flag, a number, a word, a `Place`, an `Interval`, an `Area`, `Members` or a tuple of values; in a running mission
also an entity, a message or a true box."""


class Place(msgspec.Struct, frozen=True):
    """A point in metres."""

    east: float
    north: float
    elevation: float | None = None
    """Elevation, metres; None if the author gave two components."""


class Interval(msgspec.Struct, frozen=True):
    """An inclusive range of numbers."""

    low: float
    high: float


class Area(msgspec.Struct, frozen=True):
    """A region's outline."""

    polygon: geometry2d.Polygon


class Members(msgspec.Struct, frozen=True):
    """Ids of the entities that an expression names, in order of their index."""

    ids: tuple[str, ...]


class EvaluationContext(Protocol):
    """The inputs of operations besides their operands."""

    def place(self, value: Value) -> Place | None:
        """The position of a place or an entity; None for other values and for unknown positions."""
        ...

    def note(self, name: str, number: float) -> None:
        """Record a number that decided a condition, as evidence of an event."""
        ...

    def fact(self, name: str, arguments: Sequence[Value]) -> Value:
        """The value of a function of a running mission. Raises `MissionError` before the run."""
        ...


def is_number(value: Value) -> TypeGuard[float]:
    """True if a value is a number and no flag."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def is_finite(value: object) -> TypeGuard[float]:
    """True if a value is a finite number and no flag."""
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < math.inf


def as_number(value: Value) -> float:
    """The value as a finite number. Raises `MissionError` if it is none."""
    if type(value) is float and abs(value) < math.inf:  # the common case, checked first for speed
        return value
    if not is_number(value):
        raise MissionError(f"expected a number, got {describe(value)}")
    if not math.isfinite(value):
        raise MissionError(f"expected a finite number, got {value}")
    return float(value)


def as_whole(value: Value) -> int:
    """The value as a whole number. Raises `MissionError` if it is none."""
    amount = as_number(value)
    if amount != round(amount):
        raise MissionError(f"expected a whole number, got {amount:g}")
    return round(amount)


def as_flag(value: Value) -> bool:
    """The value as true or false. Raises `MissionError` if it is no flag."""
    if not isinstance(value, bool):
        raise MissionError(f"expected true or false, got {describe(value)}")
    return value


def as_area(value: Value) -> Area:
    """The value as a region. Raises `MissionError` if it is none."""
    if not isinstance(value, Area):
        raise MissionError(f"expected a region, got {describe(value)}")
    return value


def describe(value: Value) -> str:
    """A value in words, for messages."""
    match value:
        case bool():
            return "true" if value else "false"
        case int() | float():
            return f"the number {value:g}"
        case str():
            return f"the word '{value}'"
        case Place():
            return "a point"
        case Interval():
            return "a range"
        case Area():
            return "a region"
        case Members(ids=ids):
            return " and ".join(ids) or "an empty group"
        case _:
            return "a list"
