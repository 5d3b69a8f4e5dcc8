"""Expressions over run-time state: what a rule, a stage or the success condition means at one instant.

Total and exact: nothing here raises on missing state. What does not exist (no truth box in that frame, an entity that
has not reported) is `None`; a comparison or a predicate over `None` is false. Distances are planar metres, closed
radii; boxes are normalised image boxes. Evaluation collects the numbers it used, which become an event's evidence.
"""

from __future__ import annotations

import itertools
import math
import operator
from collections.abc import Callable, Iterator, Mapping

from lingjing.errors import LingjingError
from lingjing.kernel.instant import Instant, Locals, RegionValue, Value
from lingjing.kernel.predicates import FUNCTIONS, planar
from lingjing.kernel.registry import Binding, Report
from lingjing.kernel.stocks import current
from lingjing.mission.expression import (
    Aggregate,
    Attr,
    Binary,
    Call,
    Expr,
    Flag,
    Index,
    Number,
    Point,
    Quantified,
    Range,
    Ref,
    Sequence,
    Symbol,
    Text,
    Unary,
    children,
)
from lingjing.mission.geometry2d import contains
from lingjing.mission.instance import Entity
from lingjing.mission.model import Rule
from lingjing.trace.records import Box

TICK = "tick"
"""The length of a decision tick: the one word of the clock that stands still; `now` is the time."""


def identity(value: Entity | Report) -> str:
    """What stands for a bound value in an event's binding."""
    return value.id


def evaluate(expr: Expr, scope: Locals, at: Instant) -> Value:
    """The value of `expr` at an instant with `scope` bound. Raises `LingjingError` only for a node that the
    checker should never have let through."""
    handler = _HANDLERS.get(type(expr))
    if handler is None:
        raise LingjingError(f"an expression of kind {type(expr).__name__} cannot stand in a rule")
    return handler(expr, scope, at)


def holds(condition: Expr, scope: Locals, at: Instant) -> bool:
    """The expression as a condition: only `True` is true."""
    return evaluate(condition, scope, at) is True


def bindings(
    domains: tuple[tuple[str, str], ...], at: Instant, *, fresh: bool = False
) -> Iterator[dict[str, Entity | Report]]:
    """Every assignment of the (variable, domain) pairs, first variable slowest."""
    names = [name for name, _ in domains]
    members: list[tuple[Entity | Report, ...]] = [
        at.fresh(domain) if fresh else at.domain(domain) for _, domain in domains
    ]
    for values in itertools.product(*members):
        yield dict(zip(names, values, strict=True))


def _literal(expr: Number | Text | Flag, scope: Locals, at: Instant) -> Value:
    return expr.value


def _symbol(expr: Symbol, scope: Locals, at: Instant) -> Value:
    return expr.name


def _ref(expr: Ref, scope: Locals, at: Instant) -> Value:
    if expr.name in scope:
        return scope[expr.name]
    if expr.kind == "param":
        return at.instance.settings[expr.name]
    if expr.kind == "mode":
        return at.instance.mode
    if expr.kind == "clock":
        return at.instance.clock.tick_s if expr.name == TICK else at.time_s
    if expr.kind == "region":
        return _region(expr.name, at)
    members = at.groups.get(expr.name, ())
    return members[0] if members else expr.name


def _region(name: str, at: Instant) -> Value:
    for region in at.instance.regions:
        if region.name == name:
            return RegionValue(name, region.polygon)
    return None


def _index(expr: Index, scope: Locals, at: Instant) -> Value:
    position = evaluate(expr.index, scope, at)
    if not isinstance(expr.base, Ref) or not isinstance(position, int | float):
        return None
    members = at.groups.get(expr.base.name, ())
    return members[int(position) - 1] if 1 <= position <= len(members) else None


def _attr(expr: Attr, scope: Locals, at: Instant) -> Value:
    base = evaluate(expr.base, scope, at)
    if isinstance(base, Report):
        return base.body.get(expr.name)
    if isinstance(base, Box):
        return base.box if expr.name == "box" else None
    if isinstance(base, Entity):
        return _entity_field(base, expr.name, at)
    if isinstance(base, tuple):
        return _coordinate(base, expr.name)
    return None


_AXES = {"east": 0, "x": 0, "north": 1, "y": 1, "elevation": 2, "z": 2}


def _coordinate(place: tuple[object, ...], name: str) -> Value:
    axis = _AXES.get(name)
    value = place[axis] if axis is not None and axis < len(place) else None
    return float(value) if isinstance(value, int | float) else None


def _aggregate(expr: Aggregate, scope: Locals, at: Instant) -> Value:
    """Of nothing, `count` and `sum` are 0, `min` and `max` are None; a member without a value counts for nothing."""
    values = [evaluate(expr.body, {**scope, expr.variable: member}, at) for member in at.domain(expr.domain)]
    if expr.function == "count":
        return float(sum(value is True for value in values))
    numbers = [float(value) for value in values if isinstance(value, int | float) and not isinstance(value, bool)]
    if expr.function == "sum":
        return math.fsum(numbers)
    chosen = {"min": min, "max": max}[expr.function]
    return chosen(numbers) if numbers else None


def _entity_field(entity: Entity, name: str, at: Instant) -> Value:
    state = at.states.get(entity.id)
    if state is None:
        return None
    if name in ("position", "velocity", "heading_deg", "status"):
        return getattr(state, name)  # type: ignore[no-any-return]
    return current(entity, state, name)


def _items(expr: Point | Sequence, scope: Locals, at: Instant) -> Value:
    return tuple(evaluate(item, scope, at) for item in expr.items)


def _range(expr: Range, scope: Locals, at: Instant) -> Value:
    return (evaluate(expr.low, scope, at), evaluate(expr.high, scope, at))


def _unary(expr: Unary, scope: Locals, at: Instant) -> Value:
    value = evaluate(expr.operand, scope, at)
    if expr.operator == "not":
        return value is not True
    return -value if isinstance(value, int | float) else None


_ARITHMETIC: Mapping[str, Callable[[float, float], float | bool]] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": operator.truediv,
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
}


def _binary(expr: Binary, scope: Locals, at: Instant) -> Value:
    if expr.operator == "and":
        return holds(expr.left, scope, at) and holds(expr.right, scope, at)
    if expr.operator == "or":
        return holds(expr.left, scope, at) or holds(expr.right, scope, at)
    left, right = evaluate(expr.left, scope, at), evaluate(expr.right, scope, at)
    if expr.operator == "in":
        return _member(left, right, at)
    if expr.operator in ("==", "!="):
        same = left is not None and right is not None and left == right
        return same if expr.operator == "==" else (left is not None and right is not None and not same)
    if not isinstance(left, int | float) or not isinstance(right, int | float):
        return None
    if expr.operator == "/" and right == 0:
        return None
    return _ARITHMETIC[expr.operator](left, right)


def _member(left: Value, right: Value, at: Instant) -> bool:
    if isinstance(right, RegionValue):
        point = planar(left, at)
        return point is not None and contains(right.polygon, *point)
    if isinstance(right, tuple):
        return left in right
    return False


def _quantified(expr: Quantified, scope: Locals, at: Instant) -> Value:
    known = _witnessed(expr, scope, at)
    if known is not None:
        return known
    outcomes = (holds(expr.body, {**scope, expr.variable: member}, at) for member in at.domain(expr.domain))
    return any(outcomes) if expr.quantifier == "exists" else all(outcomes)


def _witnessed(expr: Quantified, scope: Locals, at: Instant) -> bool | None:
    """`exists r in D: rule(v, r)` looked up instead of searched for; None if the expression has another form."""
    body = expr.body
    if expr.quantifier != "exists" or not isinstance(body, Call) or not body.rule:
        return None
    names = [argument.name if isinstance(argument, Ref) else None for argument in body.arguments]
    rule = at.rules.get(body.function)
    if rule is None or None in names or names.count(expr.variable) != 1 or len(names) != len(rule.parameters):
        return None
    place = names.index(expr.variable)
    others = [evaluate(argument, scope, at) for argument in body.arguments if argument != body.arguments[place]]
    if rule.parameters[place].domain != expr.domain or not all(isinstance(value, Entity | Report) for value in others):
        return None
    rest: Binding = tuple(identity(value) for value in others if isinstance(value, Entity | Report))
    return (body.function, place, rest) in at.registry.witnesses


def _call(expr: Call, scope: Locals, at: Instant) -> Value:
    if expr.rule:
        return _achieved(expr, scope, at)
    function = FUNCTIONS.get(expr.function)
    if function is None:
        raise LingjingError(f"the function `{expr.function}` cannot stand in a rule")
    return function([evaluate(argument, scope, at) for argument in expr.arguments], at)


def _achieved(expr: Call, scope: Locals, at: Instant) -> bool:
    values = [evaluate(argument, scope, at) for argument in expr.arguments]
    binding: Binding = tuple(identity(value) for value in values if isinstance(value, Entity | Report))
    return (expr.function, binding) in at.registry.achieved


_HANDLERS: Mapping[type, Callable[..., Value]] = {
    Aggregate: _aggregate,
    Number: _literal,
    Text: _literal,
    Flag: _literal,
    Symbol: _symbol,
    Ref: _ref,
    Index: _index,
    Attr: _attr,
    Point: _items,
    Sequence: _items,
    Range: _range,
    Unary: _unary,
    Binary: _binary,
    Quantified: _quantified,
    Call: _call,
}


def moving(expr: Expr, rules: Mapping[str, Rule], entities: frozenset[str], kinds: frozenset[str]) -> bool:
    """Whether the condition depends on where things are: only then is it evaluated at every macro-step.

    `entities` are the local names bound to entities. Naming an entity in `truth(v, …)`, `assigned(…)` or another
    rule does not make a condition depend on its motion; using its fields or itself as a place does.
    """
    if isinstance(expr, Call):
        if expr.rule:
            rule = rules.get(expr.function)
            return rule is not None and rule_moves(rule, rules, kinds)
        if expr.function in ("distance_xy", "emitted", "inspected", "clear"):
            return True
        return any(moving(item, rules, entities, kinds) for item in expr.arguments if not isinstance(item, Ref))
    if isinstance(expr, Ref):
        flows = expr.kind == "clock" and expr.name != TICK
        return flows or expr.kind in ("group", "entity") or expr.name in entities
    if isinstance(expr, Quantified | Aggregate) and expr.domain not in kinds:
        entities = entities | {expr.variable}
    return any(moving(child, rules, entities, kinds) for child in children(expr))


def rule_moves(rule: Rule, rules: Mapping[str, Rule], kinds: frozenset[str]) -> bool:
    """`moving` for a rule's own condition with its parameters bound."""
    entities = frozenset(parameter.name for parameter in rule.parameters if parameter.domain not in kinds)
    return moving(rule.condition, rules, entities, kinds)


def settles_at_once(rule: Rule, rules: Mapping[str, Rule], kinds: frozenset[str]) -> bool:
    """Whether a binding's truth is fixed at the boundary where its report arrives, and need not be asked for again.

    So it is if exactly one parameter is a report and the condition reads nothing but that report, its picture's ground
    truth, constants and rules of the same kind about the same report.
    """
    reports = [parameter.name for parameter in rule.parameters if parameter.domain in kinds]
    return len(reports) == 1 and not rule_moves(rule, rules, kinds) and _fixed(rule.condition, reports[0], rules, kinds)


def _fixed(expr: Expr, report: str, rules: Mapping[str, Rule], kinds: frozenset[str]) -> bool:
    if isinstance(expr, Quantified):
        return False
    if isinstance(expr, Call) and expr.rule:
        about = any(isinstance(argument, Ref) and argument.name == report for argument in expr.arguments)
        rule = rules.get(expr.function)
        return about and rule is not None and settles_at_once(rule, rules, kinds)
    if isinstance(expr, Call) and expr.function in ("assigned", "emitted", "inspected", "clear", "replans", "used"):
        return False
    return all(_fixed(child, report, rules, kinds) for child in children(expr))
