"""Conditions over an episode: the semantics that turns an expression into a `Truth`.

Facts that agents bring about (motion, pictures, messages, interactions, rules) have an earliest moment, which
`Milestones` supplies. Comparisons of the time are exact. Everything else is decided by bounds that hold during the
whole episode, or is unknown.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Protocol

import msgspec

from lingjing.errors import MissionError
from lingjing.mission import expression as ex
from lingjing.mission import operations
from lingjing.mission.certain import exact, known
from lingjing.mission.conditions.episode import NOW, AnyMessage, EpisodeKnowledge, PositionOf, StatusOf
from lingjing.mission.conditions.outline import Body
from lingjing.mission.conditions.spread import PossiblePlaces, outlines_of
from lingjing.mission.expression_text import spell
from lingjing.mission.feasibility.proof import spelled
from lingjing.mission.feasibility.steps import NEVER, StepClock, Steps, at_least_of, common, first, joined
from lingjing.mission.feasibility.truths import (
    AT_ONCE,
    NO,
    YES,
    Choice,
    Extents,
    Moment,
    Quantity,
    Reason,
    Truth,
    conjunction,
    constant,
    disjunction,
    lasting,
    opposite,
    since,
    unknown,
)
from lingjing.mission.fold import Composite, Literal, Meaning
from lingjing.mission.functions import operation
from lingjing.mission.intervals import ANYTHING, Bounds, exactly
from lingjing.mission.operations import AXES
from lingjing.mission.values import Area, Interval, Place, Value, is_number

_CHOICES_MOST = 64
"""Members of which the choices are compared (chosen); more of them are left open."""

AXIS_NAMES = ("east", "north", "elevation")


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


class Readings:
    """The semantics of conditions over an episode; its world is a `World`."""

    def literal(self, node: Literal) -> Meaning:
        """A flag is a condition that always or never holds."""
        if isinstance(node, ex.Flag):
            reason = Reason(lambda: "the condition is `false`", "LJ0612")
            return lambda names, on: constant(node.value, on.clock, reason)
        value = node.name if isinstance(node, ex.Symbol) else known(node.value)
        return lambda names, on: value

    def name(self, node: ex.Ref) -> Meaning:
        """The time, a body, a region or a setting."""
        if node.kind == "local":
            return lambda names, on: names.get(node.name)
        if node.kind == "clock" and node.name == NOW:
            return lambda names, on: Span(1.0, 0.0)
        return lambda names, on: on.knowledge.name(node)

    def field(self, node: ex.Attr, base: Meaning) -> Meaning:
        """A number of a body, or a part of another value."""
        return lambda names, on: _field(base(names, on), node.name, on)

    def apply(self, node: Composite, operands: tuple[Meaning, ...]) -> Meaning:
        """An operation of the language."""
        value_of = _applied(node, operands)

        def within_limit(names: Mapping[str, Value], on: World) -> Value:
            return None if on.exhausted() else value_of(names, on)

        return within_limit

    def over(self, node: ex.Quantified | ex.Aggregate, body: Meaning) -> Meaning:
        """A quantifier or aggregate over a group or a message kind."""

        def value_of(names: Mapping[str, Value], on: World) -> Value:
            if on.exhausted():
                return None
            members = on.knowledge.members(node.domain)
            if members is None:
                return _over_messages(node, body, names, on)
            values = [body({**names, node.variable: member}, on) for member in members]
            if isinstance(node, ex.Aggregate):
                return _aggregated(node.function, values, on)
            parts = [truth_of(value, on) for value in values]
            if node.quantifier == "forall":
                whole, fewest = conjunction(parts, on.clock), len(parts)
            else:
                whole, fewest = disjunction(parts, on.clock) if parts else _no_member(node.domain, on), 1
            return _chosen(whole, parts, fewest)

        return value_of


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


def _applied(node: Composite, operands: tuple[Meaning, ...]) -> Meaning:
    match node:
        case ex.Binary(operator="and"):
            return lambda names, on: conjunction([truth_of(each(names, on), on) for each in operands], on.clock)
        case ex.Binary(operator="or"):
            return lambda names, on: disjunction([truth_of(each(names, on), on) for each in operands], on.clock)
        case ex.Unary(operator="not"):
            return lambda names, on: opposite(truth_of(operands[0](names, on), on), on.clock)
        case ex.Binary(operator="in" | "==" | "!=" | "<" | "<=" | ">" | ">="):
            left, right = operands
            return lambda names, on: _compared(node, left(names, on), right(names, on), on)
        case ex.Index(base=ex.Ref(name=group)):
            return lambda names, on: _picked(group, operands[1](names, on), on)
        case ex.Call(rule=True):
            return lambda names, on: on.rule(node, [operand(names, on) for operand in operands])
        case ex.Call(function="before"):
            sooner, later = operands
            return lambda names, on: _before(
                node, truth_of(sooner(names, on), on), truth_of(later(names, on), on), names, on
            )
    return lambda names, on: _computed(node, [operand(names, on) for operand in operands], on)


def _picked(group: str, index: Value, on: World) -> Body | None:
    members, place = on.knowledge.outline.groups.get(group, ()), bounds_of(index)
    inside = place.exact and 1 <= place.low <= len(members) and place.low == int(place.low)
    return members[int(place.low) - 1] if inside else None


def _field(base: Value, name: str, on: World) -> Value:
    match base:
        case PositionOf(body=body) if name in AXES:
            axis = AXES[name]
            return Gauge((AXIS_NAMES[axis], body.id), on.knowledge.coordinate(body, axis))
        case Body() if name in ("position", "status"):
            return on.knowledge.field(base, name)
        case Body():
            value = on.knowledge.amount(base, name)
            key = ("heading", base.id) if name == "heading_deg" else ("value", base.id, name)
            return Gauge(key, value) if isinstance(value, Bounds) else value
        case Pictured():
            return base
        case Place() | Area() | Interval():
            try:
                return known(operations.field(base, name))
            except MissionError:
                return None
    value = None if base is None else on.knowledge.field(base, name)
    if not isinstance(base, Message):
        return value
    of_message: Quantity = ("field", base.mark, base.kind, name)
    if name in ("role", "sent") and not _is_declared(base, name, on):
        if name == "role":
            return WordOf(of_message, _sending_roles(base, on))
        return Gauge(of_message, Bounds(0.0, on.clock.time_s(max(0, on.clock.last - on.clock.per_tick))))
    return Gauge(of_message, value) if isinstance(value, Bounds) else WordOf(of_message) if value is None else value


def _is_declared(message: Message, name: str, on: World) -> bool:
    """True if the record of a message has a field of this name, which then hides the one of the envelope."""
    specs = on.knowledge.outline.instance.messages
    return any(spec.kind == message.kind and name in {field.name for field in spec.fields} for spec in specs)


def _sending_roles(message: Message, on: World) -> frozenset[str]:
    instance = on.knowledge.outline.instance
    specs = [spec for spec in instance.messages if spec.kind == message.kind]
    return frozenset(agent.role for agent in instance.agents if any(spec.is_sent_by(agent.role) for spec in specs))


# -- over time ------------------------------------------------------------------------------------------------------


def _held(truth: Truth, duration: Bounds, on: World) -> Truth:
    """`held(c, d)`: the condition has held at all macro-steps of the last `d` seconds."""
    clock, shortest = on.clock, max(0.0, duration.low)
    may = tuple((begin, high) for low, high in truth.may if (begin := clock.after(low, shortest)) <= high)
    must: Steps = ()
    if math.isfinite(duration.high):
        later = ((clock.after(low, max(0.0, duration.high)) + 1, high) for low, high in truth.must)
        must = tuple((begin, high) for begin, high in later if begin <= high)
    reason = truth.reason
    if truth.may and not may:
        words = f"a condition that must last {spelled(shortest)} s can hold for {_longest(truth.may, clock)} s at most"
        reason = Reason(lambda: words, "LJ0613")
    elif truth.may and reason is None and first(may) > 0:
        reason = Reason(lambda: f"a condition must last {spelled(shortest)} s", "LJ0613")
    return Truth(may, must, truth.if_true, reason=reason, ends=truth.ends)


def _longest(steps: Steps, clock: StepClock) -> str:
    return spelled(round(max(clock.time_s(high) - clock.time_s(low) for low, high in steps), 3))


def _rising(truth: Truth) -> Steps:
    """The macro-steps at which a condition can become true: not those at which it certainly was true just before."""
    barred = tuple((low + 1, high) for low, high in truth.must if low < high)
    rises: list[tuple[int, int]] = []
    for low, high in truth.may:
        start = low
        for begin, end in barred:
            if begin <= high and end >= start:
                if start < begin:
                    rises.append((start, begin - 1))
                start = end + 1
        if start <= high:
            rises.append((start, high))
    return tuple(rises)


def _soon_after(sooner: Truth, later: Truth, limit_s: float, on: World) -> Truth:
    """`within(a, b, d)`: `b` became true at most `d` seconds after `a` did."""
    clock = on.clock
    extents = {**lasting(sooner.if_true), **lasting(later.if_true)}
    if not sooner.may or not later.may:
        reason = sooner.reason if not sooner.may else later.reason
        return Truth((), (), reason=reason)
    near = _until_later(_rising(sooner), limit_s, clock)
    step = first(common(near, _rising(later)))
    if step == NEVER:
        words = f"the second condition cannot become true within {spelled(limit_s)} s after the first one"
        begins = later.reason if first(later.may) > first(sooner.may) else sooner.reason
        if begins is not None:
            cause = begins
            return Truth((), (), reason=msgspec.structs.replace(cause, words=lambda: f"{words}: {cause.words()}"))
        return Truth((), (), reason=Reason(lambda: words, "LJ0613"))
    reason = later.reason if first(later.may) >= first(sooner.may) else sooner.reason
    return Truth(clock.since(step), (), extents, reason=reason)


def _until_later(steps: Steps, seconds: float, clock: StepClock) -> Steps:
    """The macro-steps at most some seconds after a step of the set."""
    if math.isinf(seconds):
        return clock.since(first(steps)) if seconds > 0 and steps else ()
    if seconds < 0:
        return ()
    ends = (min(clock.last, clock.after(high, seconds + clock.sync_s)) for _, high in steps)
    whole: Steps = ()
    for (low, _), end in zip(steps, ends, strict=True):
        whole = joined(whole, ((low, end),))
    return whole


def _before(node: ex.Call, sooner: Truth, later: Truth, names: Mapping[str, Value], on: World) -> Truth:
    """`before(a, b)`: `a` became true for the first time before `b` did, or `b` never did."""
    clock = on.clock
    begin, barred = first(sooner.may), first(later.must)
    if not sooner.may:
        return Truth((), (), reason=sooner.reason)
    if begin >= barred:
        words = "the second condition of `before` is certainly true by then"
        return Truth((), (), reason=Reason(lambda: words, "LJ0613"))
    alone = on.without(node.arguments[1], node.arguments[0], names)
    if not alone.may:
        words = "the first condition of `before` needs the second one"
        return Truth((), (), reason=Reason(lambda: words, "LJ0612"))
    return Truth(clock.since(first(alone.may)), (), lasting(sooner.if_true), reason=alone.reason or sooner.reason)


def _times(occurrences: Occurrences, least: Bounds, *, strict: bool, on: World) -> Truth:
    """At least `least` times, or more than that. `least` runs from the easiest to the hardest number."""
    easy, hard = least.low, least.high
    if not math.isfinite(easy):
        return unknown(on.clock) if easy < 0 else constant(False, on.clock)
    number = math.floor(easy) + 1 if strict else math.ceil(easy)
    if number <= 0:
        return constant(True, on.clock) if easy == hard else unknown(on.clock)
    moments, name = occurrences.moments, occurrences.key[1]
    if number <= len(moments):
        moment = moments[number - 1]
    elif occurrences.pause is None or not moments:
        words = f"`{name}` happens {len(moments)} times at most"
        moment = Moment(NEVER, Reason(lambda: words, "LJ0612"))
    else:
        last = moments[-1]
        step = last.step + (number - len(moments)) * occurrences.pause
        clock = on.clock
        when = f"`{name}` happens {number} times not before {spelled(clock.time_s(min(step, NEVER // 2)))} s"
        late = occurrences.pause > 0 and step < NEVER // 2
        moment = Moment(min(step, NEVER), Reason(lambda: when, "LJ0613") if late else last.reason)
    happened: Extents = {occurrences.key: Bounds(float(number), math.inf)}
    fewer: Extents = {occurrences.key: Bounds(0.0, number - 1.0)}
    if occurrences.fact:
        happened = {**happened, occurrences.fact: YES}
        fewer = {**fewer, occurrences.fact: NO} if number == 1 else fewer
    must = on.clock.since(occurrences.certain) if number == 1 else ()
    if easy != hard:
        return Truth(on.clock.since(moment.step), (), happened, reason=moment.reason)
    return Truth(on.clock.since(moment.step), must, happened, fewer, moment.reason)


# -- functions ------------------------------------------------------------------------------------------------------


def _computed(node: Composite, values: list[Value], on: World) -> Value:
    if isinstance(node, ex.Call) and (reading := _CALLS.get(node.function)) is not None:
        return reading(node, values, on)
    span = _span(node, values)
    return span if span is not None else _number(node, values, on)


def _in_plane_or_space(node: ex.Call, values: list[Value], on: World) -> Value:
    first_place, second_place = values
    if isinstance(first_place, Body) and isinstance(second_place, Body) and first_place.id == second_place.id:
        return exactly(0.0)
    return Apart(first_place, second_place, node.function == "distance")


def _of_body(node: ex.Call, values: list[Value], on: World) -> Value:
    """A value or fact of one body; None if it is about something else."""
    body = values[0]
    if not isinstance(body, Body):
        return None
    match node.function:
        case "truth":
            return Pictured(body)
        case "speed":
            return Gauge(("speed", body.id), Bounds(0.0, on.top_speed(body)))
        case "photographed":
            return on.photographed(body)
        case "assigned" if isinstance(values[1], Body):
            return on.assigned(body, values[1])
        case "line_of_sight" if isinstance(values[1], Body):
            if body.id == values[1].id and on.is_always_there(body):
                return constant(True, on.clock)
            free = ("line_of_sight", *sorted((body.id, values[1].id)))
            return Truth(on.clock.always, (), {free: YES}, {free: NO})
    return None


def _of_event(node: ex.Call, values: list[Value], on: World) -> Value:
    """`emitted(e)` or `count(e)`, of everything or about one body."""
    name, *rest = values
    about = rest[0] if rest else None
    if not isinstance(name, str) or (rest and not isinstance(about, Body)):
        return None
    body = about if isinstance(about, Body) else None
    return on.emitted(name, body) if node.function == "emitted" else on.occurrences(name, body)


def _of_subject(node: ex.Call, values: list[Value], on: World) -> Value:
    """A fact of which only contradictions are known."""
    name = values[0].id if isinstance(values[0], Body) else str(values[0])
    return Truth(on.clock.always, (), {(node.function, name): YES}, {(node.function, name): NO})


def _of_counter(node: ex.Call, values: list[Value], on: World) -> Value:
    counted = on.knowledge.answer(node, values)
    return Gauge((node.function, str(values[0])), counted) if isinstance(counted, Bounds) else None


def _of_two(node: ex.Call, values: list[Value], on: World) -> Value:
    return Extremum(tuple(values), node.function == "min") if len(values) > 1 else _number(node, values, on)


def _over_time(node: ex.Call, values: list[Value], on: World) -> Value:
    if node.function == "held":
        return _held(truth_of(values[0], on), _whole_bounds(values[1], on), on)
    limit_s = _whole_bounds(values[2], on).high
    return _soon_after(truth_of(values[0], on), truth_of(values[1], on), limit_s, on)


_CALLS: Mapping[str, Callable[[ex.Call, list[Value], World], Value]] = {
    **dict.fromkeys(("truth", "speed", "photographed", "assigned", "line_of_sight"), _of_body),
    **dict.fromkeys(("distance", "distance_xy"), _in_plane_or_space),
    **dict.fromkeys(("emitted", "count"), _of_event),
    **dict.fromkeys(("alive", "inspected", "clear"), _of_subject),
    **dict.fromkeys(("used", "replans"), _of_counter),
    **dict.fromkeys(("min", "max"), _of_two),
    **dict.fromkeys(("held", "within"), _over_time),
}
"""The readings of functions; `before` needs its conditions unevaluated, and all others are computed from bounds."""


def _number(node: Composite, values: list[Value], on: World) -> Value:
    entry = operation(node)
    if entry is None or entry.running:
        return None
    values = [None if isinstance(value, WordOf) else value for value in values]
    if entry.bounds is not None and not any(isinstance(value, str | Place | Body) for value in values):
        bounds = entry.bounds(*[_whole_bounds(value, on) for value in values])
        picture = next((value for value in values if isinstance(value, Pictured)), None)
        if not isinstance(bounds, Bounds):
            return None
        return bounds if picture is None else Pictured(picture.body, bounds)
    return exact(entry.value, on.knowledge.outline.scope, values)


def _whole_bounds(value: Value, on: World) -> Bounds:
    """Bounds of a number, the time included."""
    if not isinstance(value, Span):
        return bounds_of(value)
    ends = sorted((value.offset, value.factor * on.clock.time_s(on.clock.last) + value.offset))
    return Bounds(*ends)


def _span(node: Composite, values: list[Value]) -> Span | None:
    """A linear function of the time; None for every other value."""
    match node, values:
        case ex.Unary(operator="-"), [Span(factor=factor, offset=offset)]:
            return Span(-factor, -offset)
        case ex.Binary(operator="+" | "-" as sign), [left, right]:
            ends = _linear(left), _linear(right)
            if ends[0] is None or ends[1] is None or not (isinstance(left, Span) or isinstance(right, Span)):
                return None
            turn = 1.0 if sign == "+" else -1.0
            return Span(ends[0].factor + turn * ends[1].factor, ends[0].offset + turn * ends[1].offset)
        case ex.Binary(operator="*"), [Span(factor=factor, offset=offset), Bounds() as times] if times.exact:
            return Span(factor * times.low, offset * times.low)
        case ex.Binary(operator="*"), [Bounds() as times, Span(factor=factor, offset=offset)] if times.exact:
            return Span(factor * times.low, offset * times.low)
        case ex.Binary(operator="/"), [Span(factor=factor, offset=offset), Bounds() as by] if by.exact and by.low:
            return Span(factor / by.low, offset / by.low)
    return None


def _linear(value: Value) -> Span | None:
    if isinstance(value, Bounds) and value.exact:
        return Span(0.0, value.low)
    return value if isinstance(value, Span) else None


def _aggregated(function: str, values: list[Value], on: World) -> Value:
    if function == "count":
        return Tally(tuple(truth_of(value, on) for value in values))
    if function in ("min", "max"):
        return Extremum(tuple(values), function == "min") if values else None
    numbers = [bounds_of(value) for value in values]
    return Bounds(math.fsum(each.low for each in numbers), math.fsum(each.high for each in numbers))


def _over_messages(node: ex.Quantified | ex.Aggregate, body: Meaning, names: Mapping[str, Value], on: World) -> Value:
    mark = on.fresh_mark()
    value = body({**names, node.variable: Message(node.domain, mark)}, on)
    if isinstance(node, ex.Aggregate) and node.function != "count":
        return None
    if isinstance(node, ex.Quantified) and node.quantifier == "forall":
        return unknown(on.clock)
    exactly_one = isinstance(node.body, ex.Call) and node.body.rule
    truth, sent = truth_of(value, on), on.message(node.domain)
    some = _of_some_message(truth, mark, sent, on.clock, exactly_one=exactly_one)
    return MessageTally(some) if isinstance(node, ex.Aggregate) else some


def _of_some_message(truth: Truth, mark: str, sent: Moment, clock: StepClock, *, exactly_one: bool) -> Truth:
    """The truth of a condition for at least one message, from its truth for an arbitrary one.

    With `exactly_one`, the condition is a rule's event and nothing else: if it holds for no message, no event happened.
    """
    if_true: dict[Quantity, object] = {}
    if_false: dict[Quantity, object] = {}
    for key, extent in truth.if_true.items():
        if mark not in key:
            if_true[key] = extent
        elif extent == YES:
            general = tuple("*" if part == mark else part for part in key)
            if_true[general] = YES
            if exactly_one:
                if_false[general] = NO
    both = conjunction((msgspec.structs.replace(truth, must=(), if_true={}, if_false={}), since(sent, clock)), clock)
    return Truth(both.may, (), if_true, if_false, both.reason, both.ends)  # type: ignore[arg-type]


def _no_member(domain: str, on: World) -> Truth:
    return constant(False, on.clock, Reason(lambda: f"there is no `{domain}` in this mission", "LJ0612"))


# -- comparisons ----------------------------------------------------------------------------------------------------


def _compared(node: ex.Binary, left: Value, right: Value, on: World) -> Truth:
    truth = _comparison(node, left, right, on)
    if not truth.may and truth.reason is None:
        truth = msgspec.structs.replace(truth, reason=Reason(lambda: f"`{spell(node)}` never holds", "LJ0612"))
    if (truth.must or truth.if_false) and not on.defined(node):
        return msgspec.structs.replace(truth, must=(), if_false={})
    return truth


def _comparison(node: ex.Binary, left: Value, right: Value, on: World) -> Truth:
    symbol = node.operator
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
    return conjunction([since(on.reported_picture(value.body), on.clock) for value in pictures], on.clock)


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
    """The same for a number of conditions, messages or events; None for other values."""
    match left, right:
        case _, Tally():
            counted = _counted(right, bounds_of(left).low, on, strict=strict)
            return counted if bounds_of(left).exact else msgspec.structs.replace(counted, must=(), if_false={})
        case Tally(), _:
            counted = opposite(_counted(left, bounds_of(right).high, on, strict=not strict), on.clock)
            return counted if bounds_of(right).exact else msgspec.structs.replace(counted, must=(), if_false={})
        case _, Occurrences():
            return _times(right, bounds_of(left), strict=strict, on=on)
        case Occurrences(), _:
            return opposite(_times(left, bounds_of(right), strict=not strict, on=on), on.clock)
        case _, MessageTally():
            needs_one = bounds_of(left).low > 0 or (strict and bounds_of(left).low == 0)
            return msgspec.structs.replace(right.some, if_false={}) if needs_one else unknown(on.clock)
    return None


def _end(number: float, strict: bool, towards: int) -> float:
    """The end of a closed range: the next number if the comparison is strict."""
    return math.nextafter(number, towards * math.inf) if strict else number


def _counted(tally: Tally, least: float, on: World, *, strict: bool) -> Truth:
    """At least `least` of the conditions hold, or more than that."""
    if not math.isfinite(least):
        return unknown(on.clock)
    number = math.floor(least) + 1 if strict else math.ceil(least)
    if number > len(tally.parts):
        words = f"{number} are required, and there are {len(tally.parts)}"
        return constant(False, on.clock, Reason(lambda: words, "LJ0612"))
    if number == len(tally.parts):
        return _chosen(conjunction(tally.parts, on.clock), tally.parts, number)
    if number == 1:
        return _chosen(disjunction(tally.parts, on.clock), tally.parts, number)
    may = at_least_of(number, tuple(part.may for part in tally.parts), on.clock)
    must = at_least_of(number, tuple(part.must for part in tally.parts), on.clock)
    late = sorted(tally.parts, key=lambda part: first(part.may))
    return _chosen(Truth(may, must, reason=late[max(number, 1) - 1].reason), tally.parts, number)


def _chosen(whole: Truth, parts: Sequence[Truth], least: int) -> Truth:
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
    ends = _linear(left), _linear(right)
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


__all__ = ["NEVER", "Apart", "Gauge", "Message", "Readings", "Span", "World", "bounds_of", "truth_of"]
