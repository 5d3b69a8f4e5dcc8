"""Which of several targets a rule means: `q.people >= max(p.people for p in shop)` is true of the longest queue alone.

Only what can be said beforehand is looked at: comparisons of declared numbers, of one target with the others. Whatever
depends on the run (places, task events, reports, what interactions take and give) is left open, and so is a comparison
that is true of none, which something must make true first.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping, Sequence

from lingjing.mission.expression import Aggregate, Attr, Binary, Call, Expr, Number, Ref
from lingjing.mission.instance import Entity, Instance

_COMPARED: Mapping[str, Callable[[float, float], bool]] = {
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
    "==": operator.eq,
    "!=": operator.ne,
}
_RECKONED: Mapping[str, Callable[[float, float], float]] = {"+": operator.add, "-": operator.sub, "*": operator.mul}
_OVER: Mapping[str, Callable[[Sequence[float]], float]] = {"min": min, "max": max, "sum": sum}


def meant(condition: Expr, variable: str, members: Sequence[Entity], instance: Instance) -> tuple[Entity, ...]:
    """Those of `members` that the condition can be true of with `variable` bound to them; all, if it chooses none."""
    parts = [part for part in _conjuncts(condition) if isinstance(part, Binary) and part.operator in _COMPARED]
    left = tuple(
        entity for entity in members if all(_holds(part, {variable: entity}, instance) is not False for part in parts)
    )
    return left or tuple(members)


def declared(entity: Entity, field: str) -> float | None:
    """A declared number of an entity; None for a state that interactions change."""
    spec = entity.state_of(field)
    if spec is not None and any(spec.name in (one.takes, one.gives, one.source) for one in entity.interactions):
        return None
    return entity.number(field)


def _conjuncts(expr: Expr) -> tuple[Expr, ...]:
    if isinstance(expr, Binary) and expr.operator == "and":
        return (*_conjuncts(expr.left), *_conjuncts(expr.right))
    return (expr,)


def _holds(part: Binary, bound: Mapping[str, Entity], instance: Instance) -> bool | None:
    left, right = _number(part.left, bound, instance), _number(part.right, bound, instance)
    return None if left is None or right is None else _COMPARED[part.operator](left, right)


def _number(expr: Expr, bound: Mapping[str, Entity], instance: Instance) -> float | None:
    """The expression's value as far as declarations tell, in SI units."""
    if isinstance(expr, Number):
        return float(expr.value)
    if isinstance(expr, Ref) and expr.kind == "param":
        return instance.settings.get(expr.name)
    if isinstance(expr, Attr) and isinstance(expr.base, Ref) and expr.base.name in bound:
        return declared(bound[expr.base.name], expr.name)
    if isinstance(expr, Binary) and expr.operator in _RECKONED:
        left, right = _number(expr.left, bound, instance), _number(expr.right, bound, instance)
        return None if left is None or right is None else _RECKONED[expr.operator](left, right)
    if isinstance(expr, Aggregate) and expr.function in _OVER:
        group = [entity for entity in instance.entities if entity.group == expr.domain]
        return _over(expr.function, [_number(expr.body, {**bound, expr.variable: one}, instance) for one in group])
    if isinstance(expr, Call) and expr.function in ("min", "max") and not expr.rule:
        return _over(expr.function, [_number(argument, bound, instance) for argument in expr.arguments])
    return None


def _over(function: str, values: Sequence[float | None]) -> float | None:
    known = [value for value in values if value is not None]
    return _OVER[function](known) if known and len(known) == len(values) else None


__all__ = ["declared", "meant"]
