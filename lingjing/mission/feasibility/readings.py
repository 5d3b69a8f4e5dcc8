"""Conditions over an episode: the semantics that turns an expression into a `Truth`.

Facts that agents bring about (motion, pictures, messages, interactions, rules) have an earliest moment, which
`Milestones` supplies. Comparisons of the time are exact. Everything else is decided by bounds that hold during the
whole episode, or is unknown.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import msgspec

from lingjing.errors import MissionError
from lingjing.mission import expression as ex
from lingjing.mission import operations
from lingjing.mission.certain import exact, known
from lingjing.mission.conditions.episode import NOW, PositionOf
from lingjing.mission.conditions.outline import Body
from lingjing.mission.feasibility.comparisons import chosen, compared
from lingjing.mission.feasibility.condition_values import (
    AXIS_NAMES,
    Apart,
    Extremum,
    Gauge,
    Message,
    MessageTally,
    Pictured,
    SentTime,
    Span,
    Tally,
    WordOf,
    World,
    age,
    bounds_of,
    linear,
    truth_of,
)
from lingjing.mission.feasibility.over_time import before, held, soon_after
from lingjing.mission.feasibility.steps import StepClock
from lingjing.mission.feasibility.truths import (
    NO,
    YES,
    Moment,
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
from lingjing.mission.fold import Composite, Literal, Meaning
from lingjing.mission.functions import operation
from lingjing.mission.intervals import Bounds, exactly
from lingjing.mission.operations import AXES
from lingjing.mission.values import Area, Interval, Place, Value


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
            return chosen(whole, parts, fewest)

        return value_of


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
            return lambda names, on: compared(node, left(names, on), right(names, on), on)
        case ex.Index(base=ex.Ref(name=group)):
            return lambda names, on: _picked(group, operands[1](names, on), on)
        case ex.Call(rule=True):
            return lambda names, on: on.rule(node, [operand(names, on) for operand in operands])
        case ex.Call(function="before"):
            sooner, later = operands
            return lambda names, on: before(
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
        return SentTime.of(base, on.clock)
    return Gauge(of_message, value) if isinstance(value, Bounds) else WordOf(of_message) if value is None else value


def _is_declared(message: Message, name: str, on: World) -> bool:
    """True if the record of a message has a field of this name, which then hides the one of the envelope."""
    specs = on.knowledge.outline.instance.messages
    return any(spec.kind == message.kind and name in {field.name for field in spec.fields} for spec in specs)


def _sending_roles(message: Message, on: World) -> frozenset[str]:
    instance = on.knowledge.outline.instance
    specs = [spec for spec in instance.messages if spec.kind == message.kind]
    return frozenset(agent.role for agent in instance.agents if any(spec.is_sent_by(agent.role) for spec in specs))


# -- functions ------------------------------------------------------------------------------------------------------


def _computed(node: Composite, values: list[Value], on: World) -> Value:
    if isinstance(node, ex.Call) and (reading := _CALLS.get(node.function)) is not None:
        return reading(node, values, on)
    span = _span(node, values)
    if span is not None:
        return span
    match node, values:
        case ex.Binary(operator="-"), [Span(factor=1.0) as now, SentTime() as sent]:
            return age(now, sent, on.clock)
    return _number(node, values, on)


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
            return Pictured(body, message=_naming(values[1]))
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


def _naming(frame: Value) -> Message | None:
    """The message of which a field names a picture."""
    if not isinstance(frame, WordOf) or frame.key[0] != "field":
        return None
    _, mark, kind, _ = frame.key
    return Message(str(kind), str(mark))


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
        return held(truth_of(values[0], on), _whole_bounds(values[1], on), on)
    limit_s = _whole_bounds(values[2], on).high
    return soon_after(truth_of(values[0], on), truth_of(values[1], on), limit_s, on)


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
        return bounds if picture is None else Pictured(picture.body, bounds, picture.message)
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
            ends = linear(left), linear(right)
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


__all__ = ["Readings"]
