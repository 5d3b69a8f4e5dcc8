"""Events that must have happened once a condition is true: a condition becomes a tree of `Need`s.

Every need is *necessary*: if the condition holds at some moment, the need was met by then. An expression that this
module does not model (a field that changes during the mission, `not`, an aggregate, a plug-in's function) has no needs
and can never be refuted. A missing case therefore weakens a proof and never makes it wrong.

`of_groups` unfolds a condition once for a group instead of once for each member. `mentions` lists the actions in a
condition (visits, reports, interactions), for agents and graders.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import msgspec

from lingjing.errors import MissionError
from lingjing.mission import expression as ex
from lingjing.mission import operations
from lingjing.mission.certain import exact, known, truth
from lingjing.mission.conditions.episode import EpisodeKnowledge
from lingjing.mission.conditions.needs import (
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
from lingjing.mission.conditions.outline import Body, Outline
from lingjing.mission.conditions.spread import PossiblePlaces, outlines_of, point
from lingjing.mission.fold import Composite, Literal, Meaning, Meanings
from lingjing.mission.functions import operation
from lingjing.mission.instance import InteractionSpec
from lingjing.mission.intervals import ANYTHING, Bounds, exactly
from lingjing.mission.model import Rule, Unlock
from lingjing.mission.values import Area, Interval, Place, Value, is_number

_MAX_NODES = 20_000
"""A condition is unfolded to at most this many nodes (chosen); a larger part has no needs."""


def needs(expr: ex.Expr, outline: Outline, at: str) -> Need:
    """The needs of a condition. `at` is the path of its declaration."""
    return _ConditionNeeds(outline).need(expr, {}, at)


def some_member(condition: ex.Expr, variable: str | None, domain: str | None, outline: Outline, at: str) -> Need:
    """The needs of a condition that is stated per member of a group: those of at least one member."""
    builder = _ConditionNeeds(outline)
    if variable is None or domain is None:
        return builder.need(condition, {}, at)
    members = outline.groups.get(domain, ())
    if not members:
        return NOTHING
    return AtLeast(1, tuple(builder.need(condition, {variable: member}, at) for member in members))


def of_groups(expr: ex.Expr, outline: Outline, domains: Mapping[str, str] | None = None) -> Need:
    """The needs of a condition in terms of groups. One body with the group's id stands for each member. Unlocks of
    interactions are left out. `domains` maps bound names to their groups."""
    builder = _ConditionNeeds(outline, whole_groups=True)
    names = {name: builder.member(group) for name, group in (domains or {}).items()}
    return builder.need(expr, names, "")


def mentions(expr: ex.Expr, outline: Outline, domains: Mapping[str, str] | None = None) -> tuple[NeedLeaf, ...]:
    """All leaves of a condition, needed or not, in its order. A leaf of the condition itself has the path ""."""
    return tuple(leaves(of_groups(expr, outline, domains)))


class _ConditionNeeds:
    """Builds the needs of one condition of an outline. Rules are expanded, and unlocks too, unless `whole_groups` is
    set."""

    def __init__(self, outline: Outline, *, whole_groups: bool = False) -> None:
        self.outline = outline
        self.whole_groups = whole_groups
        self.rules: dict[str, Rule] = {rule.name: rule for rule in outline.instance.rules}
        self.unlocks: dict[str, list[Unlock]] = {}
        for unlock in outline.instance.unlocks:
            if unlock.condition != ex.Flag(value=True):  # `true` has no needs
                self.unlocks.setdefault(unlock.interaction, []).append(unlock)
        self.declared = EpisodeKnowledge(outline)
        self.meanings = Meanings(_SEMANTICS)  # not shared: every trace has its own expressions, which are kept alive
        self.at = ""
        self._left = _MAX_NODES
        self._open: list[str] = []

    def need(self, expr: ex.Expr, names: Mapping[str, Value], at: str) -> Need:
        """The need of one condition."""
        before, self.at = self.at, at
        try:
            return _as_need(self.meanings.of(expr)(names, self))
        finally:
            self.at = before

    def exhausted(self) -> bool:
        """True if the condition is too large to be unfolded further. Counts one node."""
        self._left -= 1
        return self._left < 0

    def inside(self, path: str, condition: ex.Expr, names: Mapping[str, Value]) -> Need:
        """The needs of a declaration that the condition uses; none if the declaration uses itself."""
        if path in self._open:
            return NOTHING
        self._open.append(path)
        need = self.need(condition, names, path)
        self._open.pop()
        return need

    def members(self, domain: str) -> tuple[Body, ...]:
        """The bodies of a bound name's domain."""
        representative = self.member(domain) if self.whole_groups else None
        return self.outline.groups.get(domain, ()) if representative is None else (representative,)

    def member(self, group: str) -> Body | None:
        """One body that stands for each member of a group, with the group's name as id; None for a message kind."""
        bodies = self.outline.groups.get(group, ())
        if not bodies:
            return None
        return msgspec.structs.replace(bodies[0], entity=msgspec.structs.replace(bodies[0].entity, id=group))

    def is_kind(self, domain: str) -> bool:
        """True if the domain is a message kind."""
        return domain in self.outline.kinds


# -- values of this evaluation: needs, bodies, bounds, plain values, and the measured quantities below ----------------


class _Position(msgspec.Struct, frozen=True):
    """The position of a body."""

    body: Body


class _Distance(msgspec.Struct, frozen=True):
    """The distance in metres between two values, each a body, a position or a place."""

    first: Value
    second: Value


class _Amount(msgspec.Struct, frozen=True):
    """A state of a body, which changes during the mission."""

    body: Body
    name: str


class _Count(msgspec.Struct, frozen=True):
    """The number of needs that are met."""

    parts: tuple[Need, ...]
    of: str
    """Name of the domain of the needs."""


class _Minimum(msgspec.Struct, frozen=True):
    """The smallest of several values."""

    parts: tuple[Value, ...]


class _PictureValue(msgspec.Struct, frozen=True):
    """A value from the true boxes of a picture. A condition of it is true only if the body has a box in the picture."""

    body: Body


def _as_need(value: Value) -> Need:
    """The value of a condition as a need."""
    return value if isinstance(value, Need) else NOTHING


def _body(value: Value) -> Body | None:
    if isinstance(value, _Position):
        return value.body
    return value if isinstance(value, Body) else None


def _bounds(value: Value) -> Bounds:
    """Bounds of a number that hold at all times."""
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
    """Return an empty requirement with the leaves of these parts, which `mentions` reads."""
    named = tuple(part for part in parts if part != NOTHING)
    return AtLeast(0, named) if named else NOTHING


# -- the semantics --------------------------------------------------------------------------------------------------


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
        return lambda names, on: _field(base(names, on), node.name, on)

    def apply(self, node: Composite, operands: tuple[Meaning, ...]) -> Meaning:
        need_of = _applied(node, operands)

        def need_within_limit(names: Mapping[str, Value], on: _ConditionNeeds) -> Value:
            return NOTHING if on.exhausted() else need_of(names, on)

        return need_within_limit

    def over(self, node: ex.Quantified | ex.Aggregate, body: Meaning) -> Meaning:
        def need_of_domain(names: Mapping[str, Value], on: _ConditionNeeds) -> Value:
            if on.exhausted():
                return NOTHING
            if isinstance(node, ex.Quantified):
                return _quantified(node, body, names, on)
            return _aggregated(node, body, names, on)

        return need_of_domain


_SEMANTICS = _Needs()


def _applied(node: Composite, operands: tuple[Meaning, ...]) -> Meaning:
    match node:
        case ex.Binary(operator="and"):
            return lambda names, on: _all(tuple(_as_need(operand(names, on)) for operand in operands))
        case ex.Binary(operator="or"):
            return lambda names, on: _any(tuple(_as_need(operand(names, on)) for operand in operands))
        case ex.Unary(operator="not"):
            return lambda names, on: _never(node, on) or _mentioned((_as_need(operands[0](names, on)),))
        case ex.Binary(operator="in" | "==" | "!=" | "<" | "<=" | ">" | ">=" as symbol):
            left, right = operands
            return lambda names, on: _compared_or_never(node, symbol, left(names, on), right(names, on), on)
        case ex.Index(base=ex.Ref(name=group)):
            return lambda names, on: _picked(group, operands[1](names, on), on)
        case ex.Call(rule=True):
            return lambda names, on: _ruled(node, [operand(names, on) for operand in operands], on)
        case ex.Call(function=name) if name in _CALLS:
            return lambda names, on: _CALLS[name](on, *[operand(names, on) for operand in operands])
    return lambda names, on: _computed(node, [operand(names, on) for operand in operands], on)


def _sole(bodies: tuple[Body, ...], name: str) -> Value:
    """Return the single member of a group; a name that is no group's is returned as it is."""
    return bodies[0] if len(bodies) == 1 else None if bodies else name


def _picked(group: str, index: Value, on: _ConditionNeeds) -> Body | None:
    members, place = on.outline.groups.get(group, ()), _bounds(index)
    inside = place.exact and 1 <= place.low <= len(members) and place.low == int(place.low)
    return members[int(place.low) - 1] if inside else None


def _field(base: Value, name: str, on: _ConditionNeeds) -> Value:
    match base:
        case Body() if name == "position":
            return _Position(base)
        case Body() if (base.id, name) in on.outline.set_fields:
            return None
        case Body(entity=entity):
            return _Amount(base, name) if entity.state_of(name) is not None else base.bounds(name)
        case _PictureValue():
            return base
        case Place() | Area() | Interval():
            try:
                return known(operations.field(base, name))
            except MissionError:
                return None
    return None


def _computed(node: Composite, values: list[Value], on: _ConditionNeeds) -> Value:
    picture_value = next((value for value in values if isinstance(value, _PictureValue)), None)
    if picture_value is not None:
        return picture_value
    operation_entry = operation(node)
    if operation_entry is None or operation_entry.running:
        return None
    if operation_entry.bounds is not None and all(
        isinstance(known(value), Bounds) or value is None for value in values
    ):
        return operation_entry.bounds(*[_bounds(value) for value in values])
    return exact(operation_entry.value, on.outline.scope, values)


def _quantified(node: ex.Quantified, body: Meaning, names: Mapping[str, Value], on: _ConditionNeeds) -> Need:
    if on.is_kind(node.domain):
        if node.quantifier == "forall":
            return _mentioned((_as_need(body({**names, node.variable: None}, on)),))
        about, matching = _about(node, names, on)
        inner = _as_need(body({**names, node.variable: None}, on))
        return _all((ReportNeed(node.domain, on.at, about, matching), inner))
    parts = tuple(_as_need(body({**names, node.variable: member}, on)) for member in on.members(node.domain))
    if node.quantifier == "forall":
        return _all(parts)
    return _any(parts) if parts else Impossible(f"there is no `{node.domain}` in this mission", on.at)


def _aggregated(node: ex.Aggregate, body: Meaning, names: Mapping[str, Value], on: _ConditionNeeds) -> Value:
    if on.is_kind(node.domain):
        return None
    parts = tuple(body({**names, node.variable: member}, on) for member in on.members(node.domain))
    if node.function == "count":
        return _Count(tuple(_as_need(part) for part in parts), node.domain)
    return _Minimum(parts) if node.function == "min" and parts else None


def _about(node: ex.Quantified, names: Mapping[str, Value], on: _ConditionNeeds) -> tuple[str, bool]:
    """The entity that a report of a matching rule is about, and True; ("", False) if it is not exactly one entity."""
    call = node.body
    if not isinstance(call, ex.Call) or not call.rule or not _matching(call.function, on):
        return "", False
    values = (on.meanings.of(argument)({**names, node.variable: None}, on) for argument in call.arguments)
    ids = [body.id for value in values if (body := _body(value)) is not None]
    return (ids[0], True) if len(ids) == 1 else ("", False)


def _matching(name: str, on: _ConditionNeeds) -> bool:
    """True if the rule is matched one to one, or requires a rule that is, on the same two parameters."""
    rule = on.rules.get(name)
    if rule is None or len(rule.parameters) != 2:
        return False
    if rule.matching:
        return True
    both = {parameter.name for parameter in rule.parameters}
    calls = [part for part in ex.conjuncts(rule.condition) if isinstance(part, ex.Call) and part.rule]
    inner = [call for call in calls if {a.name for a in call.arguments if isinstance(a, ex.Ref)} == both]
    return any(on.rules[call.function].matching for call in inner if call.function in on.rules)


def _ruled(call: ex.Call, values: list[Value], on: _ConditionNeeds) -> Need:
    rule = on.rules.get(call.function)
    if rule is None or len(rule.parameters) != len(values):
        return NOTHING
    names = {parameter.name: _body(value) for parameter, value in zip(rule.parameters, values, strict=True)}
    return on.inside(f"rule/{rule.name}", rule.condition, names)


def _truth(on: _ConditionNeeds, entity: Value, frame: Value = None) -> Value:
    body = _body(entity)
    return None if body is None else _PictureValue(body)


def _assigned(on: _ConditionNeeds, asset: Value, target: Value) -> Value:
    asset_body, target_body = _body(asset), _body(target)
    return Handover(asset_body, target_body, on.at) if asset_body and target_body else NOTHING


def _emitted(on: _ConditionNeeds, name: Value, target: Value = None) -> Need:
    """The needs of a performed interaction: an actor came near enough, and the interaction was unlocked."""
    body = _body(target)
    performed = Performed(str(name), body, on.at)
    if body is None or body.entity.engine != "city":
        return performed
    visits = [_visit(spec, body, on) for spec in body.entity.interactions if spec.name == name]
    return _all((performed, *visits, *(() if on.whole_groups else (_unlocked(str(name), body, on),))))


def _visit(spec: InteractionSpec, target: Body, on: _ConditionNeeds) -> Need:
    movers = on.outline.actors(spec)
    if not movers:
        action = f"`{spec.name}` of `{target.id}` takes an asset of the engine or role `{spec.by}`"
        return Impossible(f"{action}, and there is none", on.at)
    return VisitNeed(movers, target, spec.within_m, on.at)


def _unlocked(name: str, target: Body, on: _ConditionNeeds) -> Need:
    unlocks = on.unlocks.get(name, ())
    matching = [
        unlock
        for unlock in unlocks
        if len(unlock.parameters) == 1 and unlock.parameters[0].domain == target.entity.group
    ]
    if len(matching) != 1 or len(unlocks) != 1:
        return NOTHING
    return on.inside(f"unlock/{name}", matching[0].condition, {matching[0].parameters[0].name: target})


def _distance(on: _ConditionNeeds, first: Value, second: Value) -> Value:
    return _Distance(first, second)


_CALLS: Mapping[str, Callable[..., Value]] = {
    "truth": _truth,
    "assigned": _assigned,
    "emitted": _emitted,
    "distance": _distance,
    "distance_xy": _distance,
    "held": lambda on, condition, time: _as_need(condition),
    "within": lambda on, first, second, time: _all((_as_need(first), _as_need(second))),
    "before": lambda on, first, second: _as_need(first),
}
"""Functions that agents make true by acting, in contrast to computed ones."""

_REVERSED = (">", ">=")
"""Comparisons that are evaluated with exchanged operands."""


def _compared(symbol: str, left: Value, right: Value, on: _ConditionNeeds) -> Need:
    pictures = tuple(PictureNeed(value.body, on.at) for value in (left, right) if isinstance(value, _PictureValue))
    if pictures:
        return _all(pictures)
    if symbol == "in":
        return _inside(left, right, on)
    if symbol == "!=":
        return NOTHING
    if symbol in _REVERSED:
        left, right = right, left
    if symbol == "==":
        return _all((_at_most(left, right, on), _at_most(right, left, on)))
    return _at_most(left, right, on)


def _compared_or_never(node: Composite, symbol: str, left: Value, right: Value, on: _ConditionNeeds) -> Need:
    need = _compared(symbol, left, right, on)
    return need if isinstance(need, Impossible) else _never(node, on) or need


def _never(node: Composite, on: _ConditionNeeds) -> Need | None:
    """An impossible need if the condition is false for all declared values, else None."""
    if on.whole_groups or truth(node, {}, on.declared) is not False:
        return None
    from lingjing.mission.expression_text import spell  # only a faulty mission needs it

    return Impossible(f"`{spell(node)}` never holds", on.at)


def _inside(item: Value, whole: Value, on: _ConditionNeeds) -> Need:
    body = _body(item)
    outlines = outlines_of(whole) if isinstance(whole, Area) else ()
    return VisitNeed((body,), PossiblePlaces(outlines), 0.0, on.at) if body is not None and outlines else NOTHING


def _at_most(left: Value, right: Value, on: _ConditionNeeds) -> Need:
    """The need of `left <= right`: a distance that must become small, an amount that must be supplied, a count of
    needs."""
    match left, right:
        case _Distance(first=first, second=second), _:
            return _near(first, second, _bounds(right).high, on)
        case _Minimum(parts=parts), _:
            return _any(tuple(_at_most(part, right, on) for part in parts))
        case _Amount(), _:
            return _filled(left, _bounds(right).high, on)
        case _, _Count():
            return _counted(right, _bounds(left).low, on)
        case _Count(parts=parts), _:
            return _mentioned(parts)
    return NOTHING


def _near(first: Value, second: Value, radius: float, on: _ConditionNeeds) -> Need:
    first_body, second_body = _body(first), _body(second)
    if radius == math.inf:
        return NOTHING
    if first_body is not None and second_body is not None:
        swapped = first_body.entity.role == "target"
        mover, goal = (second_body, first_body) if swapped else (first_body, second_body)
        return VisitNeed((mover,), goal, radius, on.at)
    body, place = (first_body, second) if first_body is not None else (second_body, first)
    if body is None or not isinstance(place, Place):
        return NOTHING
    return VisitNeed((body,), point(place.east, place.north), radius, on.at)


def _filled(amount: _Amount, most: float, on: _ConditionNeeds) -> Need:
    lacking = amount.body.bounds(amount.name)[0] - most
    if on.whole_groups or 0 < lacking < math.inf:
        return Supply(amount.body, amount.name, lacking, on.at, most)
    return NOTHING


def _counted(count: _Count, least: float, on: _ConditionNeeds) -> Need:
    if not math.isfinite(least) or on.whole_groups:
        return _mentioned(count.parts)
    number = max(0, math.ceil(least - 1e-9))
    if number > len(count.parts):
        return Impossible(f"{number} of `{count.of}` are required, and there are {len(count.parts)}", on.at)
    return AtLeast(number, count.parts)
