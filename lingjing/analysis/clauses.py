"""What a condition lacks: its parts that do not hold, with the values that they had.

A part is followed to where it can be understood: a rule that never came true into its own condition, `exists` to the
report that came closest, a comparison to its two sides and, over the whole episode, to the value that came nearest.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from lingjing.analysis.registries import Rebuilt
from lingjing.kernel.context import Locals, RuntimeContext
from lingjing.kernel.registry import Report
from lingjing.kernel.rules import evaluate, holds
from lingjing.mission.expression import (
    Binary,
    Call,
    Expr,
    Flag,
    Number,
    Quantified,
    Ref,
    Symbol,
    Text,
    conjuncts,
    parts,
)
from lingjing.mission.expression_text import spell
from lingjing.mission.instance import Entity
from lingjing.mission.values import Place

MOST = 3
"""Members of a `forall` that are told of; the rest are counted."""

_DEEPEST = 4


@dataclass(frozen=True, slots=True)
class UnmetPart:
    """A part of a condition that does not hold: how deep within it, how it reads, and what it had."""

    depth: int
    text: str
    had: str


def unmet(
    condition: Expr, history: Sequence[Rebuilt], scope: Locals | None = None, depth: int = 0
) -> Iterator[UnmetPart]:
    """The parts of a condition that do not hold at the last boundary of `history`, in order."""
    at = history[-1].at
    scope = scope or {}
    for part in conjuncts(condition):
        if not holds(part, scope, at):
            yield from _unmet_part(part, history, scope, depth)


def reading(expr: Expr, scope: Locals) -> str:
    """The condition as its author would write it, with what is bound put in for the variables."""
    if not scope:
        return spell(expr)
    names = "|".join(map(re.escape, scope))  # at once, lest a name is looked for in what was put in for another
    return re.sub(rf"(?<![\w.])(?:{names})\b(?!\()", lambda found: scope[found[0]].id, spell(expr))


def _unmet_part(part: Expr, history: Sequence[Rebuilt], scope: Locals, depth: int) -> Iterator[UnmetPart]:
    at, text = history[-1].at, reading(part, scope)
    match part:
        case Quantified(quantifier="forall", variable=variable, domain=domain, body=body):
            failing = [one for one in at.domain(domain) if not holds(body, {**scope, variable: one}, at)]
            yield UnmetPart(depth, text, f"false for {len(failing)} of {len(at.domain(domain))}")
            for member in failing[:MOST]:
                yield from unmet(body, history, {**scope, variable: member}, depth + 1)
        case Quantified(variable=variable, domain=domain, body=body):
            yield from _nobody(part, history, scope, depth)
        case Call(function=name, rule=True, arguments=arguments) if name in at.rules:
            yield UnmetPart(depth, text, "never came true")
            rule = at.rules[name]
            bound = [evaluate(argument, scope, at) for argument in arguments]
            inner = {
                parameter.name: value
                for parameter, value in zip(rule.parameters, bound, strict=False)
                if isinstance(value, Entity | Report)
            }
            if depth < _DEEPEST and len(inner) == len(rule.parameters):
                yield from unmet(rule.condition, history, inner, depth + 1)
        case Binary(operator="or", left=left, right=right):
            yield UnmetPart(depth, text, "neither holds")
            for side in (left, right):
                yield from unmet(side, history, scope, depth + 1)
        case _:
            yield UnmetPart(depth, text, _values(part, history, scope))


def _nobody(part: Quantified, history: Sequence[Rebuilt], scope: Locals, depth: int) -> Iterator[UnmetPart]:
    """An `exists` that nothing fulfils, and what the closest of its candidates lacks."""
    at, text = history[-1].at, reading(part, scope)
    members: tuple[Entity | Report, ...] = at.domain(part.domain)
    if not members:
        yield UnmetPart(depth, text, f"there was no {part.domain}")
        return
    yield UnmetPart(depth, text, f"none of {len(members)}")
    if depth >= _DEEPEST:
        return
    best = max(members, key=lambda one: (_degree(part.body, {**scope, part.variable: one}, at), one.id))
    if _degree(part.body, {**scope, part.variable: best}, at) > 0:
        inner = {**scope, part.variable: best}
        yield from unmet(part.body, history, inner, depth + 1)


def _degree(condition: Expr, scope: Locals, at: RuntimeContext, deep: int = 0) -> float:
    """How much of a condition holds, 0..1: the share of its conjuncts, rules by the share of their own.

    What joins two bound things (`matched(v, r)`) weighs more than what is said of one (`r.position in search`): else
    any report that is well placed would be closer to a target than the one that is of it.
    """
    found, weights = list[float](), list[float]()
    for part in conjuncts(condition):
        names = {node.name for node in parts(part) if isinstance(node, Ref)}
        weights.append(float(4 ** len(names & set(scope))))
        if holds(part, scope, at):
            found.append(1.0)
        elif isinstance(part, Call) and part.rule and part.function in at.rules and deep < _DEEPEST:
            rule = at.rules[part.function]
            bound = [evaluate(argument, scope, at) for argument in part.arguments]
            inner = {
                one.name: value
                for one, value in zip(rule.parameters, bound, strict=False)
                if isinstance(value, Entity | Report)
            }
            found.append(0.9 * _degree(rule.condition, inner, at, deep + 1))
        else:
            found.append(0.0)
    return sum(weight * share for weight, share in zip(weights, found, strict=True)) / sum(weights)


def _values(part: Expr, history: Sequence[Rebuilt], scope: Locals) -> str:
    """What the sides of a comparison were, or that a condition was false."""
    at = history[-1].at
    if not isinstance(part, Binary):
        return "false"
    told = []
    for side in (part.left, part.right):
        if isinstance(side, Number | Text | Flag | Symbol) or (isinstance(side, Ref) and side.kind == "region"):
            continue
        value = evaluate(side, scope, at)
        told.append(f"{reading(side, scope)} = {_shown(value)}")
    nearest = _nearest(part, history, scope)
    return ", ".join(told or ["false"]) + (f" ({nearest})" if nearest else "")


def _nearest(part: Binary, history: Sequence[Rebuilt], scope: Locals) -> str:
    """Over the whole episode, the value of the left side that was nearest to what a bound asks for."""
    if part.operator not in ("<", "<=", ">", ">=") or not isinstance(part.right, Number):
        return ""
    values = [(one.record.tick, evaluate(part.left, scope, one.at)) for one in history]
    numbers = [(float(value), tick) for tick, value in values if isinstance(value, int | float)]
    if len({value for value, _ in numbers}) < 2:
        return ""
    value, tick = min(numbers) if part.operator.startswith("<") else max(numbers, key=lambda one: (one[0], -one[1]))
    return f"{'least' if part.operator.startswith('<') else 'most'} {value:.4g} at tick {tick}"


def _shown(value: object) -> str:
    match value:
        case None:
            return "unknown"
        case bool():
            return "true" if value else "false"
        case int() | float():
            return f"{value:.4g}" if math.isfinite(value) else str(value)
        case Entity() | Report():
            return value.id
        case tuple():
            return f"({', '.join(map(_shown, value))})"
        case str():
            return value
    if isinstance(value, Place):
        return f"({value.east:.4g}, {value.north:.4g})"
    return type(value).__name__
