"""Values of expressions, and how they are told apart: what every reading of values computes with.

Numbers are in SI units, angles in degrees. A position is a `Place`, or a tuple of two or three numbers where it comes
from engine state or from a message.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Protocol, TypeGuard

import msgspec

from lingjing.errors import MissionError
from lingjing.mission import geometry2d

Value = Any
"""A flag, a number, a word, a `Place`, an `Interval`, an `Area`, `Members`, a tuple of values; in a running mission
also an entity, a message or a true box."""


class Place(msgspec.Struct, frozen=True):
    """A point in metres; `elevation` is None where the author gave two components."""

    east: float
    north: float
    elevation: float | None = None


class Interval(msgspec.Struct, frozen=True):
    """An inclusive range of numbers."""

    low: float
    high: float


class Area(msgspec.Struct, frozen=True):
    """A region's outline, as given."""

    polygon: geometry2d.Polygon


class Members(msgspec.Struct, frozen=True):
    """Ids of the entities an expression names, in order of their index."""

    ids: tuple[str, ...]


class EvaluationContext(Protocol):
    """What operations ask beyond their operands."""

    def place(self, value: Value) -> Place | None:
        """Where a position, or an entity, is; None for anything else, or where that is not known."""
        ...

    def note(self, name: str, number: float) -> None:
        """Keep a number that decided: evidence of an event."""
        ...

    def fact(self, name: str, arguments: Sequence[Value]) -> Value:
        """What a function of a running mission answers. `MissionError` where no mission runs."""
        ...


def is_number(value: Value) -> TypeGuard[float]:
    """Whether a value is a number and no flag."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def is_finite(value: object) -> TypeGuard[float]:
    """Whether a value is a finite number and no flag."""
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) < math.inf


def as_number(value: Value) -> float:
    """The value as a finite number."""
    if type(value) is float and abs(value) < math.inf:  # nearly always
        return value
    if not is_number(value):
        raise MissionError(f"a number is due here, this is {describe(value)}")
    if not math.isfinite(value):
        raise MissionError(f"a finite number is due here, this is {value}")
    return float(value)


def as_whole(value: Value) -> int:
    """The value as a whole number."""
    amount = as_number(value)
    if amount != round(amount):
        raise MissionError(f"a whole number is due here, this is {amount:g}")
    return round(amount)


def as_flag(value: Value) -> bool:
    """The value as true or false."""
    if not isinstance(value, bool):
        raise MissionError(f"true or false is due here, this is {describe(value)}")
    return value


def as_area(value: Value) -> Area:
    """The value as a region."""
    if not isinstance(value, Area):
        raise MissionError(f"a region is due here, this is {describe(value)}")
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
