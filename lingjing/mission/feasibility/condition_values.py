"""Values of expressions over an episode, and the `World` that supplies the moments of facts.

A number that changes during the mission is a `Gauge` or a `Span` of the time, a distance `Apart`, a count a `Tally`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Protocol

import msgspec

from lingjing.mission import expression as ex
from lingjing.mission.conditions.episode import AnyMessage, EpisodeKnowledge
from lingjing.mission.conditions.outline import Body
from lingjing.mission.conditions.spread import PossiblePlaces
from lingjing.mission.feasibility.steps import NEVER, StepClock
from lingjing.mission.feasibility.truths import (
    Moment,
    Quantity,
    Truth,
    constant,
    unknown,
)
from lingjing.mission.intervals import ANYTHING, Bounds, exactly
from lingjing.mission.values import Value, is_number

SENT = "sent"
"""The kind of the quantity; a record may declare a field of this name, which is another quantity."""

AXIS_NAMES = ("east", "north", "elevation")
_ROUNDING_S = 1e-6
"""Tolerance of a difference of two times, seconds (chosen)."""


class Message(AnyMessage, frozen=True):
    """An arbitrary message, bound by one quantifier or parameter."""

    mark: str = "*"
    """Tells the messages of different quantifiers apart."""


class Span(msgspec.Struct, frozen=True):
    """`factor` times the time of the mission, plus `offset`, seconds."""

    factor: float
    offset: float


class Apart(msgspec.Struct, frozen=True):
    """The distance in metres between two bodies or places."""

    first: Value
    second: Value
    in_space: bool = False
    """True for the distance in three dimensions, which is at least the horizontal one."""


class Gauge(msgspec.Struct, frozen=True):
    """A number of a body that changes during the mission."""

    key: Quantity
    bounds: Bounds
    """Its bounds during the episode."""


class SentTime(Gauge, frozen=True):
    """The time at which a message was sent, which rules receive one tick later."""

    @classmethod
    def of(cls, message: Message, clock: StepClock) -> SentTime:
        """The time of a message that a rule can still receive."""
        latest = clock.time_s(max(0, clock.last - clock.per_tick))
        return cls((SENT, message.mark, message.kind, "sent"), Bounds(0.0, latest))


def age(now: Span, sent: SentTime, clock: StepClock) -> Gauge:
    """`now - r.sent`: at least one tick. `now` is the time of the mission plus an offset."""
    least = clock.tick_s - _ROUNDING_S
    return Gauge(("age", *sent.key[1:3]), Bounds(least + now.offset, clock.time_s(clock.last) + now.offset))


class WordOf(msgspec.Struct, frozen=True):
    """A text of a message."""

    key: Quantity
    words: frozenset[str] | None = None
    """The words that it can be; None for any."""


class Tally(msgspec.Struct, frozen=True):
    """The number of conditions that hold."""

    parts: tuple[Truth, ...]


class MessageTally(msgspec.Struct, frozen=True):
    """The number of messages for which a condition holds."""

    some: Truth
    """The condition of some message."""


class Occurrences(msgspec.Struct, frozen=True):
    """The number of times of an event of the mission or of an interaction."""

    key: Quantity
    moments: tuple[Moment, ...]
    """The earliest moments of the first times, in order."""
    pause: int | None = None
    """The least number of macro-steps from each further time to the one before; None if there is none."""
    fact: Quantity = ()
    """The fact that it has happened once."""
    certain: int = NEVER
    """The macro-step from which on it has certainly happened once."""


class Extremum(msgspec.Struct, frozen=True):
    """The smallest or the largest of several values."""

    parts: tuple[Value, ...]
    smallest: bool


class Pictured(msgspec.Struct, frozen=True):
    """A value from the true box of a body in the picture of a message."""

    body: Body
    bounds: Bounds = ANYTHING
    message: Message | None = None
    """The message that names the picture; None if it is not known."""


class World(Protocol):
    """The moments of facts, and the bounds of quantities."""

    clock: StepClock
    knowledge: EpisodeKnowledge

    def exhausted(self) -> bool:
        """True if the condition is too large to be evaluated further. Counts one node."""
        ...

    def defined(self, node: ex.Expr) -> bool:
        """True if every value in the expression exists at all times."""
        ...

    def fresh_mark(self) -> str:
        """A mark for the messages of one quantifier."""
        ...

    def rule(self, call: ex.Call, values: list[Value]) -> Truth:
        """The truth of a rule's event."""
        ...

    def emitted(self, name: str, body: Body | None) -> Truth:
        """The truth of a performed interaction."""
        ...

    def occurrences(self, name: str, body: Body | None) -> Occurrences | None:
        """The times of an event or an interaction; None if nothing is known of them."""
        ...

    def without(self, barred: ex.Expr, wanted: ex.Expr, names: Mapping[str, Value]) -> Truth:
        """The truth of a condition in an episode in which another one has never held."""
        ...

    def is_always_there(self, body: Body) -> bool:
        """True if the body is present during the whole episode."""
        ...

    def top_speed(self, body: Body) -> float:
        """Upper bound of the speed of a body in space, m/s."""
        ...

    def assigned(self, asset: Body, target: Body) -> Truth:
        """The truth of an assignment."""
        ...

    def photographed(self, asset: Body) -> Truth:
        """The truth of a picture taken by a camera of the asset."""
        ...

    def message(self, kind: str) -> Moment:
        """The moment of the first message of a kind."""
        ...

    def reported_picture(self, body: Body) -> Moment:
        """The moment of the first message that names a picture of the body."""
        ...

    def status(self, body: Body, word: str) -> Truth:
        """The truth of `body.status == word`."""
        ...

    def near(self, first: Value, second: Value, radius: float) -> Moment:
        """The moment at which two bodies or places can be within the radius."""
        ...

    def inside(self, body: Body, places: PossiblePlaces) -> Moment:
        """The moment at which a body can be in a region."""
        ...

    def apart(self, first: Value, second: Value) -> float:
        """Upper bound of the distance between two bodies or places during the episode, metres."""
        ...

    def entering(self, gauge: Gauge, low: float, high: float) -> Moment:
        """The moment at which a number can lie between two bounds."""
        ...


def truth_of(value: Value, on: World) -> Truth:
    """The value of a condition as a truth."""
    if isinstance(value, bool):
        return constant(value, on.clock)
    return value if isinstance(value, Truth) else unknown(on.clock)


def bounds_of(value: Value) -> Bounds:
    """Bounds of a number that hold at all times."""
    match value:
        case Bounds():
            return value
        case Gauge(bounds=bounds) | Pictured(bounds=bounds):
            return bounds
        case Apart():
            return Bounds(0.0, math.inf)
        case Tally(parts=parts):
            return Bounds(0.0, float(len(parts)))
        case MessageTally() | Occurrences():
            return Bounds(0.0, math.inf)
    return exactly(value) if is_number(value) else ANYTHING


def linear(value: Value) -> Span | None:
    """A number as a linear function of the time; None if it is none."""
    if isinstance(value, Bounds) and value.exact:
        return Span(0.0, value.low)
    return value if isinstance(value, Span) else None


__all__ = [
    "AXIS_NAMES",
    "SENT",
    "Apart",
    "Extremum",
    "Gauge",
    "Message",
    "MessageTally",
    "Occurrences",
    "Pictured",
    "SentTime",
    "Span",
    "Tally",
    "WordOf",
    "World",
    "age",
    "bounds_of",
    "linear",
    "truth_of",
]
