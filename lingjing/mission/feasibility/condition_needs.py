"""What must have happened once a condition is true: a condition becomes a tree of `Need`s.

Every need is *necessary*: if the condition holds at some moment of the mission, the need was met by then. What is not
understood (a field that changes while the mission runs, `not`, an aggregate, a plug-in's function) asks for nothing and
can never be refuted; so a missing case makes a proof weaker, never wrong.

`of_groups` unfolds a condition once for a group instead of once for each member; `mentions` lists who does what to whom
in it, for whoever plays or judges.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import msgspec

from lingjing.errors import MissionError
from lingjing.mission import expression as ex
from lingjing.mission import operations
from lingjing.mission.certain import Knowledge, exact, known, truth
from lingjing.mission.feasibility.needs import (
    NOTHING,
    AtLeast,
    Handover,
    Impossible,
    Need,
    NeedLeaf,
    Performed,
    PictureNeed,
    ReportNeed,
    Supply,
    VisitNeed,
    leaves,
)
from lingjing.mission.feasibility.outline import Body, Outline
from lingjing.mission.feasibility.spread import PossiblePlaces, outlines_of, point
from lingjing.mission.fold import Composite, Literal, Meaning, Meanings
from lingjing.mission.functions import operation
from lingjing.mission.instance import InteractionSpec
from lingjing.mission.intervals import ANYTHING, Bounds, exactly
from lingjing.mission.model import Rule, Unlock
from lingjing.mission.values import Area, Interval, Place, Value, is_number

NODES_MOST = 20_000
"""Conditions are unfolded to at most this many nodes; beyond, a part asks for nothing."""


def needs(expr: ex.Expr, outline: Outline, at: str) -> Need:
    """What the condition of the declaration at path `at` requires."""
    return ConditionNeeds(outline).need(expr, {}, at)


def some_member(condition: ex.Expr, variable: str | None, domain: str | None, outline: Outline, at: str) -> Need:
    """What a condition requires that is stated per member of a group: of one member at least, for a start."""
    reading = ConditionNeeds(outline)
    if variable is None or domain is None:
        return reading.need(condition, {}, at)
    members = outline.groups.get(domain, ())
    if not members:
        return NOTHING
    return AtLeast(1, tuple(reading.need(condition, {variable: member}, at) for member in members))


def of_groups(expr: ex.Expr, outline: Outline, domains: Mapping[str, str] | None = None) -> Need:
    """What a condition requires of groups: a body whose id is that of its group stands for each member, and what must
    come before an interaction is left out. `domains` are the groups of bound names."""
    reading = ConditionNeeds(outline, whole_groups=True)
    names = {name: reading.member(group) for name, group in (domains or {}).items()}
    return reading.need(expr, names, "")


def mentions(expr: ex.Expr, outline: Outline, domains: Mapping[str, str] | None = None) -> tuple[NeedLeaf, ...]:
    """Who does what to whom in a condition, needed or not, in its order; what it says itself is `at` no path."""
    return tuple(leaves(of_groups(expr, outline, domains)))


class _Declared(Knowledge):
    """What is known all the time: what is declared, and that time has begun."""

    def __init__(self, outline: Outline) -> None:
        self._outline = outline

    def name(self, ref: ex.Ref) -> Value:
        """A param, the mode, a duration of the clock."""
        if ref.name == "now":
            return Bounds(0.0, math.inf)
        try:
            return None if ref.kind in ("group", "entity") else known(self._outline.scope.refer(ref))
        except MissionError:
            return None


class ConditionNeeds:
    """What one condition of an outline needs; rules and, unless `whole_groups`, unlocks are looked through."""

    def __init__(self, outline: Outline, *, whole_groups: bool = False) -> None:
        self.outline = outline
        self.whole_groups = whole_groups
        self.rules: dict[str, Rule] = {rule.name: rule for rule in outline.instance.rules}
        self.unlocks: dict[str, list[Unlock]] = {}
        for unlock in outline.instance.unlocks:
            if unlock.condition != ex.Flag(value=True):  # which asks for nothing
                self.unlocks.setdefault(unlock.interaction, []).append(unlock)
        self.declared = _Declared(outline)
        self.meanings = Meanings(_READING)  # which go with it: every trace that is read has expressions of its own
        self.at = ""
        self._left = NODES_MOST
        self._open: list[str] = []

    def need(self, expr: ex.Expr, names: Mapping[str, Value], at: str) -> Need:
        """The need of one condition."""
        before, self.at = self.at, at
        try:
            return as_need(self.meanings.of(expr)(names, self))
        finally:
            self.at = before

    def exhausted(self) -> bool:
        """Whether the condition is too large to be unfolded further; counts one node."""
        self._left -= 1
        return self._left < 0

    def inside(self, path: str, condition: ex.Expr, names: Mapping[str, Value]) -> Need:
        """The need of a declaration that the condition leads to; nothing if it leads back to itself."""
        if path in self._open:
            return NOTHING
        self._open.append(path)
        found = self.need(condition, names, path)
        self._open.pop()
        return found

    def members(self, domain: str) -> tuple[Body, ...]:
        """The bodies that a bound name ranges over."""
        one = self.member(domain) if self.whole_groups else None
        return self.outline.groups.get(domain, ()) if one is None else (one,)

    def member(self, group: str) -> Body | None:
        """One body for each member of a group, under the group's name; None for a message kind."""
        there = self.outline.groups.get(group, ())
        if not there:
            return None
        return msgspec.structs.replace(there[0], entity=msgspec.structs.replace(there[0].entity, id=group))

    def is_kind(self, domain: str) -> bool:
        """Whether a name ranges over messages."""
        return domain in self.outline.kinds


# -- values of the reading: needs, bodies, bounds, plain values, and numbers of which it is known what they measure ----


class _Position(msgspec.Struct, frozen=True):
    """Where a body is."""

    body: Body


class _Distance(msgspec.Struct, frozen=True):
    """Metres between two of bodies, positions and places."""

    one: Value
    other: Value


class _Amount(msgspec.Struct, frozen=True):
    """A state of a body, which changes while the mission runs."""

    body: Body
    name: str


class _Count(msgspec.Struct, frozen=True):
    """How many of some needs are met; `of` is what they range over."""

    parts: tuple[Need, ...]
    of: str


class _Least(msgspec.Struct, frozen=True):
    """The smallest of several values."""

    parts: tuple[Value, ...]


class _Seen(msgspec.Struct, frozen=True):
    """Something read from the true boxes of a picture: with no box of the body in it, nothing is true."""

    body: Body


def as_need(value: Value) -> Need:
    """A condition's value as a need."""
    return value if isinstance(value, Need) else NOTHING


def _body(value: Value) -> Body | None:
    if isinstance(value, _Position):
        return value.body
    return value if isinstance(value, Body) else None


def _bounds(value: Value) -> Bounds:
    """Between which bounds a number lies all the time."""
    if isinstance(value, _Distance):
        return Bounds(0.0, math.inf)
    if isinstance(value, Bounds):
        return value
    return exactly(value) if is_number(value) else ANYTHING


def _all(parts: tuple[Need, ...]) -> Need:
    known = tuple(part for part in parts if part != NOTHING)
    return known[0] if len(known) == 1 else AtLeast(len(known), known)


def _any(parts: tuple[Need, ...]) -> Need:
    open_ended = any(isinstance(part, AtLeast) and part.least == 0 for part in parts)
    return _mentioned(parts) if open_ended else AtLeast(1, parts)


def _mentioned(parts: tuple[Need, ...]) -> Need:
    """No requirement, with what is named in it."""
    named = tuple(part for part in parts if part != NOTHING)
    return AtLeast(0, named) if named else NOTHING


# -- the reading ----------------------------------------------------------------------------------------------------


class _Needs:
    def literal(self, node: Literal) -> Meaning:
        if isinstance(node, ex.Flag):
            return lambda names, on: NOTHING if node.value else Impossible("the condition is `false`", on.at)
        constant = node.name if isinstance(node, ex.Symbol) else node.value
        return lambda names, on: known(constant)

    def name(self, node: ex.Ref) -> Meaning:
        if node.kind == "local":
            return lambda names, on: names.get(node.name)
        if node.kind in ("group", "entity"):
            return lambda names, on: _sole(on.outline.groups.get(node.name, ()), node.name)
        return lambda names, on: on.declared.name(node)

    def field(self, node: ex.Attr, base: Meaning) -> Meaning:
        return lambda names, on: _field(base(names, on), node.name)

    def apply(self, node: Composite, operands: tuple[Meaning, ...]) -> Meaning:
        made = _applied(node, operands)

        def counted(names: Mapping[str, Value], on: ConditionNeeds) -> Value:
            return NOTHING if on.exhausted() else made(names, on)

        return counted

    def over(self, node: ex.Quantified | ex.Aggregate, body: Meaning) -> Meaning:
        def each(names: Mapping[str, Value], on: ConditionNeeds) -> Value:
            if on.exhausted():
                return NOTHING
            if isinstance(node, ex.Quantified):
                return _quantified(node, body, names, on)
            return _aggregated(node, body, names, on)

        return each


_READING = _Needs()


def _applied(node: Composite, operands: tuple[Meaning, ...]) -> Meaning:
    match node:
        case ex.Binary(operator="and"):
            return lambda names, on: _all(tuple(as_need(one(names, on)) for one in operands))
        case ex.Binary(operator="or"):
            return lambda names, on: _any(tuple(as_need(one(names, on)) for one in operands))
        case ex.Unary(operator="not"):
            return lambda names, on: _never(node, on) or _mentioned((as_need(operands[0](names, on)),))
        case ex.Binary(operator="in" | "==" | "!=" | "<" | "<=" | ">" | ">=" as symbol):
            left, right = operands
            return lambda names, on: _never(node, on) or _compared(symbol, left(names, on), right(names, on), on)
        case ex.Index(base=ex.Ref(name=group)):
            return lambda names, on: _picked(group, operands[1](names, on), on)
        case ex.Call(rule=True):
            return lambda names, on: _ruled(node, [one(names, on) for one in operands], on)
        case ex.Call(function=name) if name in _CALLS:
            return lambda names, on: _CALLS[name](on, *[one(names, on) for one in operands])
    return lambda names, on: _computed(node, [one(names, on) for one in operands], on)


def _sole(members: tuple[Body, ...], name: str) -> Value:
    """A group's name means its one member; a name of no group stands for itself."""
    return members[0] if len(members) == 1 else None if members else name


def _picked(group: str, index: Value, on: ConditionNeeds) -> Body | None:
    members, place = on.outline.groups.get(group, ()), _bounds(index)
    inside = place.exact and 1 <= place.low <= len(members) and place.low == int(place.low)
    return members[int(place.low) - 1] if inside else None


def _field(base: Value, name: str) -> Value:
    match base:
        case Body() if name == "position":
            return _Position(base)
        case Body(entity=entity):
            return _Amount(base, name) if entity.state_of(name) is not None else base.bounds(name)
        case _Seen():
            return base
        case Place() | Area() | Interval():
            try:
                return known(operations.field(base, name))
            except MissionError:
                return None
    return None


def _computed(node: Composite, values: list[Value], on: ConditionNeeds) -> Value:
    seen = next((value for value in values if isinstance(value, _Seen)), None)
    if seen is not None:
        return seen
    done = operation(node)
    if done is None or done.running:
        return None
    if done.bounds is not None and all(isinstance(known(value), Bounds) or value is None for value in values):
        return done.bounds(*[_bounds(value) for value in values])
    return exact(done.value, on.outline.scope, values)


def _quantified(node: ex.Quantified, body: Meaning, names: Mapping[str, Value], on: ConditionNeeds) -> Need:
    if on.is_kind(node.domain):
        if node.quantifier == "forall":
            return _mentioned((as_need(body({**names, node.variable: None}, on)),))
        about, matching = _about(node, names, on)
        inner = as_need(body({**names, node.variable: None}, on))
        return _all((ReportNeed(node.domain, on.at, about, matching), inner))
    parts = tuple(as_need(body({**names, node.variable: member}, on)) for member in on.members(node.domain))
    if node.quantifier == "forall":
        return _all(parts)
    return _any(parts) if parts else Impossible(f"there is no `{node.domain}` in this mission", on.at)


def _aggregated(node: ex.Aggregate, body: Meaning, names: Mapping[str, Value], on: ConditionNeeds) -> Value:
    if on.is_kind(node.domain):
        return None
    parts = tuple(body({**names, node.variable: member}, on) for member in on.members(node.domain))
    if node.function == "count":
        return _Count(tuple(as_need(part) for part in parts), node.domain)
    return _Least(parts) if node.function == "min" and parts else None


def _about(node: ex.Quantified, names: Mapping[str, Value], on: ConditionNeeds) -> tuple[str, bool]:
    """The one entity that a report of a matching rule is about."""
    call = node.body
    if not isinstance(call, ex.Call) or not call.rule or not _matching(call.function, on):
        return "", False
    values = (on.meanings.of(argument)({**names, node.variable: None}, on) for argument in call.arguments)
    found = [body.id for value in values if (body := _body(value)) is not None]
    return (found[0], True) if len(found) == 1 else ("", False)


def _matching(name: str, on: ConditionNeeds) -> bool:
    """Whether the rule is matched one to one, or needs one that is, on the same two parameters."""
    rule = on.rules.get(name)
    if rule is None or len(rule.parameters) != 2:
        return False
    if rule.matching:
        return True
    both = {parameter.name for parameter in rule.parameters}
    calls = [part for part in ex.conjuncts(rule.condition) if isinstance(part, ex.Call) and part.rule]
    inner = [one for one in calls if {a.name for a in one.arguments if isinstance(a, ex.Ref)} == both]
    return any(on.rules[one.function].matching for one in inner if one.function in on.rules)


def _ruled(call: ex.Call, values: list[Value], on: ConditionNeeds) -> Need:
    rule = on.rules.get(call.function)
    if rule is None or len(rule.parameters) != len(values):
        return NOTHING
    names = {parameter.name: _body(value) for parameter, value in zip(rule.parameters, values, strict=True)}
    return on.inside(f"rule/{rule.name}", rule.condition, names)


def _truth(on: ConditionNeeds, entity: Value, frame: Value = None) -> Value:
    body = _body(entity)
    return None if body is None else _Seen(body)


def _assigned(on: ConditionNeeds, asset: Value, target: Value) -> Value:
    one, other = _body(asset), _body(target)
    return Handover(one, other, on.at) if one and other else NOTHING


def _emitted(on: ConditionNeeds, name: Value, target: Value = None) -> Need:
    """An interaction was performed: someone able to came near enough, and it was unlocked."""
    body = _body(target)
    done = Performed(str(name), body, on.at)
    if body is None or body.entity.engine != "city":
        return done
    visits = [_visit(one, body, on) for one in body.entity.interactions if one.name == name]
    return _all((done, *visits, *(() if on.whole_groups else (_unlocked(str(name), body, on),))))


def _visit(one: InteractionSpec, target: Body, on: ConditionNeeds) -> Need:
    movers = on.outline.actors(one)
    if not movers:
        what = f"`{one.name}` of `{target.id}` takes an asset of the engine or role `{one.by}`"
        return Impossible(f"{what}, and there is none", on.at)
    return VisitNeed(movers, target, one.within_m, on.at)


def _unlocked(name: str, target: Body, on: ConditionNeeds) -> Need:
    unlocks = on.unlocks.get(name, ())
    rules = [one for one in unlocks if len(one.parameters) == 1 and one.parameters[0].domain == target.entity.group]
    if len(rules) != 1 or len(unlocks) != 1:
        return NOTHING
    return on.inside(f"unlock/{name}", rules[0].condition, {rules[0].parameters[0].name: target})


def _distance(on: ConditionNeeds, one: Value, other: Value) -> Value:
    return _Distance(one, other)


_CALLS: Mapping[str, Callable[..., Value]] = {
    "truth": _truth,
    "assigned": _assigned,
    "emitted": _emitted,
    "distance": _distance,
    "distance_xy": _distance,
}
"""What is not computed but has to be brought about."""

_TURNED = (">", ">=")


def _compared(symbol: str, left: Value, right: Value, on: ConditionNeeds) -> Need:
    seen = tuple(PictureNeed(value.body, on.at) for value in (left, right) if isinstance(value, _Seen))
    if seen:
        return _all(seen)
    if symbol == "in":
        return _inside(left, right, on)
    if symbol == "!=":
        return NOTHING
    if symbol in _TURNED:
        left, right = right, left
    if symbol == "==":
        return _all((_at_most(left, right, on), _at_most(right, left, on)))
    return _at_most(left, right, on)


def _never(node: Composite, on: ConditionNeeds) -> Need | None:
    """That a condition is false by what is declared alone, if it is."""
    if on.whole_groups or truth(node, {}, on.declared) is not False:
        return None
    from lingjing.mission.expression_text import spell  # only a faulty mission needs it

    return Impossible(f"`{spell(node)}` never holds", on.at)


def _inside(item: Value, whole: Value, on: ConditionNeeds) -> Need:
    body = _body(item)
    outlines = outlines_of(whole) if isinstance(whole, Area) else ()
    return VisitNeed((body,), PossiblePlaces(outlines), 0.0, on.at) if body is not None and outlines else NOTHING


def _at_most(left: Value, right: Value, on: ConditionNeeds) -> Need:
    """`left <= right`: a distance that must become small, a lack that must be filled, a number of things."""
    match left, right:
        case _Distance(one=one, other=other), _:
            return _near(one, other, _bounds(right).high, on)
        case _Least(parts=parts), _:
            return _any(tuple(_at_most(part, right, on) for part in parts))
        case _Amount(), _:
            return _filled(left, _bounds(right).high, on)
        case _, _Count():
            return _counted(right, _bounds(left).low, on)
        case _Count(parts=parts), _:
            return _mentioned(parts)
    return NOTHING


def _near(one: Value, other: Value, radius: float, on: ConditionNeeds) -> Need:
    first, second = _body(one), _body(other)
    if radius == math.inf:
        return NOTHING
    if first is not None and second is not None:
        mover, goal = (second, first) if first.entity.role == "target" else (first, second)
        return VisitNeed((mover,), goal, radius, on.at)
    body, place = (first, other) if first is not None else (second, one)
    if body is None or not isinstance(place, Place):
        return NOTHING
    return VisitNeed((body,), point(place.east, place.north), radius, on.at)


def _filled(amount: _Amount, most: float, on: ConditionNeeds) -> Need:
    lacking = amount.body.bounds(amount.name)[0] - most
    if on.whole_groups or 0 < lacking < math.inf:
        return Supply(amount.body, amount.name, lacking, on.at, most)
    return NOTHING


def _counted(count: _Count, least: float, on: ConditionNeeds) -> Need:
    if not math.isfinite(least) or on.whole_groups:
        return _mentioned(count.parts)
    number = max(0, math.ceil(least - 1e-9))
    if number > len(count.parts):
        return Impossible(f"{number} of `{count.of}` are asked for, there are {len(count.parts)}", on.at)
    return AtLeast(number, count.parts)
