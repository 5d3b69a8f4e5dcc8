"""Comparisons over an episode: of the time exactly, of everything else by bounds and by the moments of facts."""

from __future__ import annotations

import math
from collections.abc import Sequence

import msgspec

from lingjing.mission import expression as ex
from lingjing.mission.conditions.episode import PositionOf, StatusOf
from lingjing.mission.conditions.outline import Body
from lingjing.mission.conditions.spread import PossiblePlaces, outlines_of
from lingjing.mission.expression_text import spell
from lingjing.mission.feasibility.condition_values import (
    AXIS_NAMES,
    Apart,
    Extremum,
    Gauge,
    MessageTally,
    Occurrences,
    Pictured,
    SentTime,
    Span,
    Tally,
    WordOf,
    World,
    age,
    bounds_of,
    linear,
)
from lingjing.mission.feasibility.over_time import times
from lingjing.mission.feasibility.proof import spelled
from lingjing.mission.feasibility.steps import Steps, at_least_of, first
from lingjing.mission.feasibility.truths import (
    AT_ONCE,
    NO,
    YES,
    Choice,
    Extents,
    Quantity,
    Reason,
    Truth,
    conjunction,
    constant,
    disjunction,
    opposite,
    since,
    unknown,
)
from lingjing.mission.intervals import Bounds, exactly
from lingjing.mission.values import Area, Interval, Place, Value

_CHOICES_MOST = 64
"""Members of which the choices are compared (chosen); more of them are left open."""


def compared(node: ex.Binary, left: Value, right: Value, on: World) -> Truth:
    """The truth of a comparison, with the reason for which it never holds."""
    truth = _comparison(node, left, right, on)
    if not truth.may and truth.reason is None:
        truth = msgspec.structs.replace(truth, reason=Reason(lambda: f"`{spell(node)}` never holds", "LJ0612"))
    if (truth.must or truth.if_false) and not on.defined(node):
        return msgspec.structs.replace(truth, must=(), if_false={})
    return truth


def _comparison(node: ex.Binary, left: Value, right: Value, on: World) -> Truth:
    symbol = node.operator
    match left, right:  # `r.sent > now` is `0 > now - r.sent`
        case Span(factor=1.0), SentTime():
            left, right = age(left, right, on.clock), exactly(0.0)
        case SentTime(), Span(factor=1.0):
            left, right = exactly(0.0), age(right, left, on.clock)
    pictures = [value for value in (left, right) if isinstance(value, Pictured)]
    if pictures:
        return _of_pictures(symbol, left, right, pictures, on)
    if symbol == "in":
        return _membership(node, left, right, on)
    if symbol in ("==", "!="):
        equal = _equal(node, left, right, on)
        return equal if symbol == "==" else opposite(equal, on.clock)
    if symbol in (">", ">="):
        left, right = right, left
    return _ordered(node, left, right, on, strict=symbol in ("<", ">"))


def _of_pictures(symbol: str, left: Value, right: Value, pictures: list[Pictured], on: World) -> Truth:
    plain = _by_bounds(bounds_of(left), bounds_of(right), symbol, on)
    if not plain.may:
        return plain
    return conjunction([_since_reported(value, on) for value in pictures], on.clock)


def _since_reported(picture: Pictured, on: World) -> Truth:
    """The truth of a condition on a picture: a message names it, which is sent when the picture exists."""
    moment = on.reported_picture(picture.body)
    truth = since(moment, on.clock)
    if picture.message is None or not truth.may:
        return truth
    taken_s = on.clock.time_s(max(0, moment.step - on.clock.per_tick))
    sent = SentTime.of(picture.message, on.clock)
    return msgspec.structs.replace(truth, if_true={**truth.if_true, sent.key: Bounds(taken_s, math.inf)})


def _by_bounds(left: Bounds, right: Bounds, symbol: str, on: World) -> Truth:
    from lingjing.mission.functions import OPERATIONS

    compare = OPERATIONS[symbol].bounds
    value = compare(left, right) if compare is not None else None
    return unknown(on.clock) if value is None else constant(value, on.clock)


def _equal(node: ex.Binary, left: Value, right: Value, on: World) -> Truth:
    numbers = [
        isinstance(value, Bounds | Span | Apart | Gauge | Tally | MessageTally | Occurrences | Extremum)
        for value in (left, right)
    ]
    if all(numbers):
        both = (_ordered(node, left, right, on, strict=False), _ordered(node, right, left, on, strict=False))
        return conjunction(both, on.clock)
    if any(numbers) or left is None or right is None:
        return unknown(on.clock)
    for status, word in ((left, right), (right, left)):
        if isinstance(status, StatusOf) and isinstance(word, str):
            return on.status(status.body, word)
        if isinstance(status, WordOf) and isinstance(word, str):
            if status.words is not None and word not in status.words:
                return constant(False, on.clock)
            return Truth(on.clock.always, (), {status.key: frozenset((word,))})
    if isinstance(left, str | bool) and isinstance(right, str | bool):
        return constant(left == right, on.clock)
    return unknown(on.clock)


def _membership(node: ex.Binary, item: Value, whole: Value, on: World) -> Truth:
    if isinstance(item, PositionOf):
        item = item.body
    if isinstance(whole, Interval):
        low, high = exactly(whole.low), exactly(whole.high)
        if item is None or isinstance(item, WordOf):
            return unknown(on.clock)
        ends = (_ordered(node, low, item, on, strict=False), _ordered(node, item, high, on, strict=False))
        return conjunction(ends, on.clock)
    if isinstance(item, Body) and isinstance(node.right, ex.Ref):
        return _in_region(item, node.right.name, whole, on)
    if isinstance(item, str) and isinstance(whole, tuple):
        return constant(item in whole, on.clock)
    if isinstance(item, StatusOf | WordOf) and isinstance(whole, tuple):
        return disjunction([_equal(node, item, word, on) for word in whole], on.clock)
    return unknown(on.clock)


def _in_region(body: Body, name: str, whole: Value, on: World) -> Truth:
    key: Quantity = ("in", body.id, name)
    outlines = outlines_of(whole) if isinstance(whole, Area) else ()
    if not outlines:
        return Truth(on.clock.always, (), {key: YES}, {key: NO})
    moment = on.inside(body, PossiblePlaces(outlines))
    if_true: dict[Quantity, object] = {key: YES}
    for axis in (0, 1):
        values = [corner[axis] for corner in outlines[0]]
        if_true[AXIS_NAMES[axis], body.id] = Bounds(min(values), max(values))
    return Truth(on.clock.since(moment.step), (), if_true, {key: NO}, moment.reason)  # type: ignore[arg-type]


def _ordered(node: ex.Binary, left: Value, right: Value, on: World, *, strict: bool) -> Truth:
    """`left < right` if `strict`, else `left <= right`."""
    symbol = "<" if strict else "<="
    match left, right:
        case Extremum(parts=parts, smallest=smallest), _:
            each = [_ordered(node, part, right, on, strict=strict) for part in parts]
            return disjunction(each, on.clock) if smallest else conjunction(each, on.clock)
        case _, Extremum(parts=parts, smallest=smallest):
            each = [_ordered(node, left, part, on, strict=strict) for part in parts]
            return conjunction(each, on.clock) if smallest else disjunction(each, on.clock)
        case (Span(), _) | (_, Span()):
            return _of_time(node, left, right, on, strict=strict)
        case Apart(), _:
            return _within(left, bounds_of(right), on, strict=strict)
        case _, Apart():
            return _beyond(right, bounds_of(left), on, strict=strict)
        case (Gauge(), Gauge()):
            return _by_bounds(left.bounds, right.bounds, symbol, on)
        case Gauge(), _:
            return _measured(node, left, -math.inf, _end(bounds_of(right).high, strict, -1), bounds_of(right), on)
        case _, Gauge():
            return _measured(node, right, _end(bounds_of(left).low, strict, 1), math.inf, bounds_of(left), on)
    counts = _compared_counts(left, right, on, strict=strict)
    return counts or _by_bounds(bounds_of(left), bounds_of(right), symbol, on)


def _compared_counts(left: Value, right: Value, on: World, *, strict: bool) -> Truth | None:
    """Return the truth of a comparison with a number of conditions, messages or events; None for other values."""
    match left, right:
        case _, Tally():
            counted = _counted(right, bounds_of(left).low, on, strict=strict)
            return counted if bounds_of(left).exact else msgspec.structs.replace(counted, must=(), if_false={})
        case Tally(), _:
            counted = opposite(_counted(left, bounds_of(right).high, on, strict=not strict), on.clock)
            return counted if bounds_of(right).exact else msgspec.structs.replace(counted, must=(), if_false={})
        case _, Occurrences():
            return times(right, bounds_of(left), strict=strict, on=on)
        case Occurrences(), _:
            return opposite(times(left, bounds_of(right), strict=not strict, on=on), on.clock)
        case _, MessageTally():
            needs_one = bounds_of(left).low > 0 or (strict and bounds_of(left).low == 0)
            return msgspec.structs.replace(right.some, if_false={}) if needs_one else unknown(on.clock)
    return None


def _end(number: float, strict: bool, towards: int) -> float:
    """The end of a closed range: the next number if the comparison is strict."""
    return math.nextafter(number, towards * math.inf) if strict else number


def _counted(tally: Tally, least: float, on: World, *, strict: bool) -> Truth:
    """Return the truth of "at least `least` of the conditions hold", or of "more than `least`" if `strict`."""
    if not math.isfinite(least):
        return unknown(on.clock)
    number = math.floor(least) + 1 if strict else math.ceil(least)
    if number > len(tally.parts):
        words = f"{number} are required, and there are {len(tally.parts)}"
        return constant(False, on.clock, Reason(lambda: words, "LJ0612"))
    if number == len(tally.parts):
        return chosen(conjunction(tally.parts, on.clock), tally.parts, number)
    if number == 1:
        return chosen(disjunction(tally.parts, on.clock), tally.parts, number)
    may = at_least_of(number, tuple(part.may for part in tally.parts), on.clock)
    must = at_least_of(number, tuple(part.must for part in tally.parts), on.clock)
    late = sorted(tally.parts, key=lambda part: first(part.may))
    return chosen(Truth(may, must, reason=late[max(number, 1) - 1].reason), tally.parts, number)


def chosen(whole: Truth, parts: Sequence[Truth], least: int) -> Truth:
    """A truth that needs at least some of its parts, with the choices that are left when it is true or false."""
    if not 1 <= least <= len(parts) or not whole.may or len(parts) > _CHOICES_MOST:
        return whole
    holding = Choice(least, tuple(part.if_true for part in parts if part.may))
    failing = Choice(len(parts) - least + 1, tuple(part.if_false for part in parts))
    every, none = least == len(parts), least == 1  # their bounds are merged already
    choices = whole.choices if every else (*whole.choices, holding)
    denials = whole.denials if none else (*whole.denials, failing)
    return msgspec.structs.replace(whole, choices=choices, denials=denials)


def _of_time(node: ex.Binary, left: Value, right: Value, on: World, *, strict: bool) -> Truth:
    """A comparison with a linear function of the time."""
    ends = linear(left), linear(right)
    exact_ends = ends[0] is not None and ends[1] is not None
    plain = exact_ends and isinstance(left, Span) != isinstance(right, Span)
    difference: Span
    if exact_ends and ends[0] is not None and ends[1] is not None:
        difference = Span(ends[0].factor - ends[1].factor, ends[0].offset - ends[1].offset)
        low = high = 0.0
    elif isinstance(left, Span):
        limit = bounds_of(right)
        difference, low, high = left, limit.low, limit.high
    else:
        limit = bounds_of(left)
        difference, low, high = Span(-right.factor, -right.offset), -limit.high, -limit.low
    if difference.factor == 0.0 or not math.isfinite(difference.offset):
        return _by_bounds(exactly(difference.offset), Bounds(low, high), "<" if strict else "<=", on)
    simple = plain and (left in (Span(1.0, 0.0),) or right in (Span(1.0, 0.0),))
    slack = 0.0 if simple else 1e-9 * (1.0 + abs(difference.offset))

    def below(limit: float, margin: float) -> Steps:
        if math.isinf(limit):
            return on.clock.always if limit > 0 else ()
        rising = difference.factor < 0
        if simple and isinstance(left, Span):
            end = bounds_of(right).low
            return on.clock.where((lambda t: t < end) if strict else (lambda t: t <= end), rising=False)
        if simple:
            start = bounds_of(left).low
            return on.clock.where((lambda t: t > start) if strict else (lambda t: t >= start), rising=True)
        return on.clock.where(lambda t: difference.factor * t + difference.offset <= limit + margin, rising=rising)

    may, must = below(high, slack), below(low, -slack if not simple else 0.0)
    if strict and not simple:
        must = on.clock.where(
            lambda t: difference.factor * t + difference.offset < low - slack, rising=difference.factor < 0
        )
    words = Reason(lambda: f"`{spell(node)}` holds {_when(may, on)}", "LJ0613")
    return Truth(may, must, reason=words, ends=words if may and may[-1][1] < on.clock.last else None)


def _when(steps: Steps, on: World) -> str:
    """The times of a set of steps in words."""
    if not steps:
        return f"at no time of the episode, which ends at {spelled(on.clock.time_s(on.clock.last))} s"
    low, high = steps[0][0], steps[-1][1]
    if low > 0:
        return f"not before {spelled(on.clock.time_s(low))} s"
    return f"not after {spelled(on.clock.time_s(high))} s" if high < on.clock.last else "at all times"


def _within(distance: Apart, limit: Bounds, on: World, *, strict: bool) -> Truth:
    """A distance that must become small."""
    radius = limit.high
    if radius < 0 or (strict and radius <= 0):
        return constant(False, on.clock)
    if math.isinf(radius):
        return unknown(on.clock)
    moment = on.near(distance.first, distance.second, radius)
    key = _distance_key(distance)
    if not key:
        return since(moment, on.clock)
    inside: Extents = {key: Bounds(0.0, _end(radius, strict, -1))}
    outside: Extents = {key: Bounds(_end(limit.low, not strict, 1), math.inf)}
    return Truth(on.clock.since(moment.step), (), inside, outside, moment.reason)


def _beyond(distance: Apart, limit: Bounds, on: World, *, strict: bool) -> Truth:
    """A distance that must be large."""
    key, least = _distance_key(distance), limit.low
    most = math.inf if distance.in_space else on.apart(distance.first, distance.second)
    if least > most:
        words = f"a distance of {spelled(least)} m is beyond the largest possible one, {spelled(round(most, 3))} m"
        return constant(False, on.clock, Reason(lambda: words, "LJ0612"))
    outside: Extents = {key: Bounds(_end(least, strict, 1), math.inf)} if key else {}
    inside: Extents = {key: Bounds(0.0, _end(limit.high, not strict, -1))} if key else {}
    return Truth(on.clock.always, (), outside, inside)


def _distance_key(distance: Apart) -> Quantity:
    ids = [_place_id(distance.first), _place_id(distance.second)]
    name = "distance" if distance.in_space else "distance_xy"
    return () if None in ids else (name, *sorted(str(each) for each in ids))


def _place_id(value: Value) -> str | None:
    match value:
        case Body() as body:
            return body.id
        case PositionOf(body=body):
            return body.id
        case Place(east=east, north=north):
            return f"({east}, {north})"
    return None


def _measured(node: ex.Binary, gauge: Gauge, low: float, high: float, limit: Bounds, on: World) -> Truth:
    """A number that must lie between two bounds, of which one is infinite."""
    outside: Extents
    if math.isinf(low):
        outside = {
            gauge.key: Bounds(math.nextafter(limit.low, math.inf) if high == limit.high else limit.low, math.inf)
        }
        must = gauge.bounds.high <= (limit.low if high == limit.high else math.nextafter(limit.low, -math.inf))
    else:
        outside = {
            gauge.key: Bounds(-math.inf, math.nextafter(limit.high, -math.inf) if low == limit.low else limit.high)
        }
        must = gauge.bounds.low >= (limit.high if low == limit.low else math.nextafter(limit.high, math.inf))
    if gauge.bounds.low > high or gauge.bounds.high < low:
        reason = Reason(lambda: _out_of_bounds(node, gauge.bounds), "LJ0612")
        return constant(False, on.clock, reason)
    moment = AT_ONCE if must else on.entering(gauge, low, high)
    return Truth(
        on.clock.since(moment.step),
        on.clock.always if must else (),
        {gauge.key: Bounds(low, high)},
        outside,
        moment.reason,
    )


def _out_of_bounds(node: ex.Binary, bounds: Bounds) -> str:
    least, most = (spelled(round(end, 3)) if math.isfinite(end) else "" for end in bounds)
    between = f"between {least} and {most}" if least and most else f"at least {least}" if least else f"at most {most}"
    return f"`{spell(node)}` never holds, because the value is always {between}"


__all__ = ["chosen", "compared"]
