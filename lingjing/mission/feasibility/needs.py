"""What must have happened once a condition is true: a condition becomes a tree of `Need`s.

Every need is *necessary*: if the condition holds at some moment of the mission, the need was met by then. What is not
understood (a field that changes while the mission runs, `not`, an aggregate, a plug-in's function) becomes `NOTHING`,
which can never be refuted; so a missing case makes a proof weaker, never wrong.
"""

from __future__ import annotations

import math

import msgspec

from lingjing.errors import MissionError
from lingjing.mission import expression as ex
from lingjing.mission.evaluate import Area, Place, evaluate
from lingjing.mission.feasibility.outline import Body, Outline
from lingjing.mission.feasibility.spread import ANYTHING, Bounds, Where, outlines_of, point
from lingjing.mission.model import Rule, Unlock

NODES_MOST = 20_000
"""Conditions are unfolded to at most this many nodes; beyond, a part counts as `NOTHING`."""


class Visit(msgspec.Struct, frozen=True):
    """One of `movers` must come within `radius_m` of the goal, in the plane."""

    movers: tuple[Body, ...]
    goal: Body | Where
    radius_m: float
    at: str


class Report(msgspec.Struct, frozen=True):
    """A message of a kind must be sent; a `matching` one is about exactly one entity."""

    kind: str
    at: str
    about: str = ""
    matching: bool = False


class Picture(msgspec.Struct, frozen=True):
    """A picture must be taken in which the entity covers pixels."""

    target: Body
    at: str


class Handover(msgspec.Struct, frozen=True):
    """A destination for the asset that means the target must be given, by command or by message."""

    asset: Body
    target: Body
    at: str


class Supply(msgspec.Struct, frozen=True):
    """A stock that the target lacks must be brought: `amount` of its property `name` is what is missing at least."""

    target: Body
    name: str
    amount: float
    at: str


class Never(msgspec.Struct, frozen=True):
    """What cannot happen."""

    message: str
    at: str


class Some(msgspec.Struct, frozen=True):
    """At least `least` of the parts: all of them, one of them, or some number in between."""

    least: int
    parts: tuple[Need, ...]


Leaf = Visit | Report | Picture | Handover | Supply | Never
Need = Leaf | Some

NOTHING = Some(0, ())
"""No requirement, or none that is understood."""

Env = dict[str, Body | None]
"""Bound names; None for a report, of which nothing is known."""


def needs(expr: ex.Expr, outline: Outline, at: str) -> Need:
    """What the condition of the declaration at path `at` requires."""
    return Unfolding(outline).need(expr, {}, at)


def some_member(condition: ex.Expr, variable: str | None, domain: str | None, outline: Outline, at: str) -> Need:
    """What a condition requires that is stated per member of a group: of one member at least, for a start."""
    unfolding = Unfolding(outline)
    if variable is None or domain is None:
        return unfolding.need(condition, {}, at)
    members = outline.groups.get(domain, ())
    if not members:
        return NOTHING
    return Some(1, tuple(unfolding.need(condition, {variable: member}, at) for member in members))


def mandatory(need: Need) -> list[Leaf]:
    """The leaves that every way of meeting the need goes through."""
    if not isinstance(need, Some):
        return [need]
    if need.least < len(need.parts):
        return []
    return [leaf for part in need.parts for leaf in mandatory(part)]


class Unfolding:
    """One condition of an outline being unfolded; rules and unlocks are looked through."""

    def __init__(self, outline: Outline) -> None:
        self.outline = outline
        self.rules: dict[str, Rule] = {rule.name: rule for rule in outline.instance.rules}
        self.unlocks: dict[str, list[Unlock]] = {}
        for unlock in outline.instance.unlocks:
            if unlock.condition != ex.Flag(value=True):  # which asks for nothing
                self.unlocks.setdefault(unlock.interaction, []).append(unlock)
        self.kinds = outline.kinds
        self.left = NODES_MOST
        self.open: set[str] = set()

    def need(self, expr: ex.Expr, env: Env, at: str) -> Need:
        """The need of one condition."""
        self.left -= 1
        if self.left < 0:
            return NOTHING
        match expr:
            case ex.Flag(value=False):
                return Never("the condition is `false`", at)
            case ex.Binary(operator="and"):
                return _all((self.need(expr.left, env, at), self.need(expr.right, env, at)))
            case ex.Binary(operator="or"):
                return _any((self.need(expr.left, env, at), self.need(expr.right, env, at)))
            case ex.Binary():
                return self._comparison(expr, env, at)
            case ex.Quantified():
                return self._quantified(expr, env, at)
            case ex.Call(rule=True):
                return self._rule(expr, env)
            case ex.Call(function="emitted"):
                return self._emitted(expr, env, at)
            case ex.Call(function="assigned", arguments=(asset, target)):
                one, other = self.body(asset, env), self.body(target, env)
                return Handover(one, other, at) if one and other else NOTHING
        return NOTHING

    def body(self, expr: ex.Expr, env: Env) -> Body | None:
        """The entity that an expression names, if it is known which."""
        match expr:
            case ex.Ref(kind="local", name=name):
                return env.get(name)
            case ex.Ref(kind="group" | "entity", name=name):
                members = self.outline.groups.get(name, ())
                return members[0] if len(members) == 1 else None
            case ex.Index(base=ex.Ref(name=name), index=ex.Number(value=value)):
                members = self.outline.groups.get(name, ())
                return members[int(value) - 1] if 1 <= value <= len(members) and value == int(value) else None
            case ex.Attr(base=base, name="position"):
                return self.body(base, env)
        return None

    # -- private

    def _rule(self, call: ex.Call, env: Env) -> Need:
        rule = self.rules.get(call.function)
        if rule is None or f"rule/{rule.name}" in self.open or len(rule.parameters) != len(call.arguments):
            return NOTHING
        inner: Env = {p.name: self.body(a, env) for p, a in zip(rule.parameters, call.arguments, strict=True)}
        return self._inside(f"rule/{rule.name}", rule.condition, inner)

    def _inside(self, path: str, condition: ex.Expr, env: Env) -> Need:
        self.open.add(path)
        found = self.need(condition, env, path)
        self.open.discard(path)
        return found

    def _quantified(self, expr: ex.Quantified, env: Env, at: str) -> Need:
        if expr.domain in self.kinds:
            if expr.quantifier == "forall":
                return NOTHING
            about, matching = self._about(expr, env)
            body = self.need(expr.body, {**env, expr.variable: None}, at)
            return _all((Report(expr.domain, at, about, matching), body))
        members = self.outline.groups.get(expr.domain, ())
        parts = (self.need(expr.body, {**env, expr.variable: member}, at) for member in members)
        if expr.quantifier == "forall":
            return _all(tuple(parts))
        return _any(tuple(parts)) if members else Never(f"there is no `{expr.domain}` in this mission", at)

    def _about(self, expr: ex.Quantified, env: Env) -> tuple[str, bool]:
        """The one entity that a report of a matching rule is about."""
        match expr.body:
            case ex.Call(rule=True, function=name, arguments=arguments):
                rule = self._matching(name)
                found = [body.id for body in (self.body(a, env) for a in arguments) if body is not None]
                if rule and len(found) == 1:
                    return found[0], True
        return "", False

    def _matching(self, name: str) -> bool:
        """Whether the rule is matched one to one, or needs one that is, on the same two parameters."""
        rule = self.rules.get(name)
        if rule is None or len(rule.parameters) != 2:
            return False
        if rule.matching:
            return True
        names = {p.name for p in rule.parameters}
        return any(
            isinstance(part, ex.Call)
            and part.rule
            and part.function != name
            and {a.name for a in part.arguments if isinstance(a, ex.Ref)} == names
            and (inner := self.rules.get(part.function)) is not None
            and inner.matching
            for part in _conjuncts(rule.condition)
        )

    def _emitted(self, call: ex.Call, env: Env, at: str) -> Need:
        """An interaction was performed: someone able to came near enough, and it was unlocked."""
        name = call.arguments[0] if call.arguments else None
        target = self.body(call.arguments[1], env) if len(call.arguments) > 1 else None
        if not isinstance(name, ex.Symbol) or target is None or target.entity.engine != "city":
            return NOTHING
        visits = [
            self._visit(one.by, target, one.within_m, one.name, at)
            for one in target.entity.interactions
            if one.name == name.name
        ]
        return _all((*visits, self._unlocked(name.name, target)))

    def _visit(self, engine: str, target: Body, within: float, name: str, at: str) -> Need:
        movers = self.outline.by_engine(engine)
        if not movers:
            return Never(f"`{name}` of `{target.id}` takes an asset of the engine `{engine}`, and there is none", at)
        return Visit(movers, target, within, at)

    def _unlocked(self, name: str, target: Body) -> Need:
        rules = [
            unlock
            for unlock in self.unlocks.get(name, ())
            if len(unlock.parameters) == 1 and unlock.parameters[0].domain == target.entity.group
        ]
        if len(rules) != 1 or len(self.unlocks[name]) != 1 or f"unlock/{name}" in self.open:
            return NOTHING
        return self._inside(f"unlock/{name}", rules[0].condition, {rules[0].parameters[0].name: target})

    def _comparison(self, expr: ex.Binary, env: Env, at: str) -> Need:
        seen = [body for body in (self._in_truth(side, env) for side in (expr.left, expr.right)) if body is not None]
        if seen:
            return _all(tuple(Picture(body, at) for body in seen))
        if expr.operator == "in":
            return self._inside_region(expr, env, at)
        left, operator, right = expr.left, expr.operator, expr.right
        if operator in (">", ">="):
            left, operator, right = right, "<" if operator == ">" else "<=", left
        if operator in ("<", "<="):
            return self._at_most(left, right, env, at)
        if operator == "==":
            return self._all_of(left, right, env, at)
        return NOTHING

    def _at_most(self, left: ex.Expr, right: ex.Expr, env: Env, at: str) -> Need:
        """`left <= right`: a distance that must become small, a lack that must be filled, a number of things."""
        match left, right:
            case ex.Call(function="distance_xy" | "distance", arguments=(a, b)), _:
                return self._near(a, b, self._upper(right, env), env, at)
            case ex.Aggregate(function="min", variable=name, domain=domain, body=body), _ if domain not in self.kinds:
                members = self.outline.groups.get(domain, ())
                return _any(tuple(self._at_most(body, right, {**env, name: m}, at) for m in members))
            case ex.Attr(base=base, name=name), _:
                return self._filled(base, name, self._upper(right, env), env, at)
            case _, ex.Aggregate(function="count"):
                return self._count(right, self._lower(left, env), env, at)
        return NOTHING

    def _all_of(self, left: ex.Expr, right: ex.Expr, env: Env, at: str) -> Need:
        for one, other in ((left, right), (right, left)):
            if isinstance(one, ex.Aggregate) and one.function == "count":
                return self._count(one, self._lower(other, env), env, at)
            if isinstance(one, ex.Attr):
                return self._filled(one.base, one.name, self._upper(other, env), env, at)
        return NOTHING

    def _count(self, count: ex.Aggregate, least: float, env: Env, at: str) -> Need:
        if count.domain in self.kinds or not math.isfinite(least):
            return NOTHING
        members = self.outline.groups.get(count.domain, ())
        number = max(0, math.ceil(least - 1e-9))
        if number > len(members):
            return Never(f"{number} of `{count.domain}` are asked for, there are {len(members)}", at)
        return Some(number, tuple(self.need(count.body, {**env, count.variable: m}, at) for m in members))

    def _filled(self, base: ex.Expr, name: str, most: float, env: Env, at: str) -> Need:
        body = self.body(base, env)
        if body is None or body.entity.state_of(name) is None:
            return NOTHING
        lacking = body.bounds(name)[0] - most
        return Supply(body, name, lacking, at) if 0 < lacking < math.inf else NOTHING

    def _near(self, one: ex.Expr, other: ex.Expr, radius: float, env: Env, at: str) -> Need:
        first, second = self.body(one, env), self.body(other, env)
        if radius == math.inf:
            return NOTHING
        if first is not None and second is not None:
            mover, goal = (second, first) if first.entity.role == "target" else (first, second)
            return Visit((mover,), goal, radius, at)
        mover_or_none, place = (first, other) if first is not None else (second, one)
        value = self._static(place)
        if mover_or_none is None or not isinstance(value, Place):
            return NOTHING
        return Visit((mover_or_none,), point(value.east, value.north), radius, at)

    def _inside_region(self, expr: ex.Binary, env: Env, at: str) -> Need:
        body, area = self.body(expr.left, env), self._static(expr.right)
        outlines = outlines_of(area) if isinstance(area, Area) else ()
        return Visit((body,), Where(outlines), 0.0, at) if body is not None and outlines else NOTHING

    def _in_truth(self, expr: ex.Expr, env: Env) -> Body | None:
        """The entity of the `truth(…)` that the expression reads: with no box of it in the frame, nothing is true."""
        match expr:
            case ex.Call(function="truth", arguments=(entity, *_)):
                return self.body(entity, env)
            case ex.Call(arguments=arguments, rule=False):
                return next((b for b in (self._in_truth(a, env) for a in arguments) if b is not None), None)
            case ex.Attr(base=base):
                return self._in_truth(base, env)
        return None

    def _static(self, expr: ex.Expr) -> object:
        try:
            return evaluate(expr, self.outline.scope)
        except MissionError:
            return None

    def _upper(self, expr: ex.Expr, env: Env) -> float:
        return self._bounds(expr, env)[1]

    def _lower(self, expr: ex.Expr, env: Env) -> float:
        return self._bounds(expr, env)[0]

    def _bounds(self, expr: ex.Expr, env: Env) -> Bounds:
        """Between which bounds a number lies all the time."""
        match expr:
            case ex.Attr(base=base, name=name):
                body = self.body(base, env)
                return ANYTHING if body is None or body.entity.state_of(name) is not None else body.bounds(name)
            case ex.Binary(operator="+"):
                (a, b), (c, d) = self._bounds(expr.left, env), self._bounds(expr.right, env)
                return a + c, b + d
            case ex.Binary(operator="-"):
                (a, b), (c, d) = self._bounds(expr.left, env), self._bounds(expr.right, env)
                return a - d, b - c
        value = self._static(expr)
        return (value, value) if isinstance(value, float) and not isinstance(value, bool) else ANYTHING


def _all(parts: tuple[Need, ...]) -> Need:
    known = tuple(part for part in parts if part != NOTHING)
    return known[0] if len(known) == 1 else Some(len(known), known)


def _any(parts: tuple[Need, ...]) -> Need:
    return NOTHING if any(part == NOTHING for part in parts) else Some(1, parts)


def _conjuncts(expr: ex.Expr) -> list[ex.Expr]:
    if isinstance(expr, ex.Binary) and expr.operator == "and":
        return [*_conjuncts(expr.left), *_conjuncts(expr.right)]
    return [expr]
