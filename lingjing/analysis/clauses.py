"""The unmet parts of a condition, with their values.

The search descends to parts that explain themselves: from a rule that never held into its own condition, from `exists`
to the report that comes closest, and from a comparison to its sides and to the closest value of the whole episode.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from lingjing.analysis.registries import RebuiltBoundary
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
"""Members of a `forall` that are described; the rest are counted. Chosen."""

_DEEPEST = 4
"""Levels of rules and quantifiers that the search descends. Chosen, so that the text stays within a screen."""


@dataclass(frozen=True, slots=True)
class UnmetPart:
    """A part of a condition that does not hold."""

    depth: int
    """Nesting depth within the condition, from 0."""
    text: str
    """The part in the syntax of the mission language, with variables replaced by their values."""
    had: str
    """The values of the part, in words."""


def unmet_parts(
    condition: Expr, history: Sequence[RebuiltBoundary], scope: Locals | None = None, depth: int = 0
) -> Iterator[UnmetPart]:
    """Yield the parts of a condition that do not hold at the last boundary of `history`, in order."""
    at = history[-1].at
    scope = scope or {}
    for part in conjuncts(condition):
        if not holds(part, scope, at):
            yield from _unmet_part(part, history, scope, depth)


def condition_text(expr: Expr, scope: Locals) -> str:
    """Return the condition in the syntax of the mission language, with variables replaced by their values."""
    if not scope:
        return spell(expr)
    names = "|".join(map(re.escape, scope))  # all in one pass: an inserted value may contain the name of a variable
    return re.sub(rf"(?<![\w.])(?:{names})\b(?!\()", lambda match: scope[match[0]].id, spell(expr))


def _unmet_part(part: Expr, history: Sequence[RebuiltBoundary], scope: Locals, depth: int) -> Iterator[UnmetPart]:
    at, text = history[-1].at, condition_text(part, scope)
    match part:
        case Quantified(quantifier="forall", variable=variable, domain=domain, body=body):
            failing = [member for member in at.domain(domain) if not holds(body, {**scope, variable: member}, at)]
            yield UnmetPart(depth, text, f"false for {len(failing)} of {len(at.domain(domain))}")
            for member in failing[:MOST]:
                yield from unmet_parts(body, history, {**scope, variable: member}, depth + 1)
        case Quantified(variable=variable, domain=domain, body=body):
            yield from _unmet_exists(part, history, scope, depth)
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
                yield from unmet_parts(rule.condition, history, inner, depth + 1)
        case Binary(operator="or", left=left, right=right):
            yield UnmetPart(depth, text, "neither holds")
            for side in (left, right):
                yield from unmet_parts(side, history, scope, depth + 1)
        case _:
            yield UnmetPart(depth, text, _values(part, history, scope))


def _unmet_exists(
    part: Quantified, history: Sequence[RebuiltBoundary], scope: Locals, depth: int
) -> Iterator[UnmetPart]:
    """Yield an unmet `exists`, then the unmet parts of its closest candidate."""
    at, text = history[-1].at, condition_text(part, scope)
    members: tuple[Entity | Report, ...] = at.domain(part.domain)
    if not members:
        yield UnmetPart(depth, text, f"there was no {part.domain}")
        return
    yield UnmetPart(depth, text, f"none of {len(members)}")
    if depth >= _DEEPEST:
        return
    best = max(members, key=lambda member: (_degree(part.body, {**scope, part.variable: member}, at), member.id))
    if _degree(part.body, {**scope, part.variable: best}, at) > 0:
        inner = {**scope, part.variable: best}
        yield from unmet_parts(part.body, history, inner, depth + 1)


def _degree(condition: Expr, scope: Locals, at: RuntimeContext, deep: int = 0) -> float:
    """Return the weighted share of the conjuncts that hold, 0..1. A rule that does not hold counts by its own share.

    A conjunct over two variables (`matched(v, r)`) weighs more than one over a single variable
    (`r.position in search`). Otherwise any report at a good place would be closer to a target than the matched one.
    """
    shares, weights = list[float](), list[float]()
    for part in conjuncts(condition):
        names = {node.name for node in parts(part) if isinstance(node, Ref)}
        weights.append(float(4 ** len(names & set(scope))))
        if holds(part, scope, at):
            shares.append(1.0)
        elif isinstance(part, Call) and part.rule and part.function in at.rules and deep < _DEEPEST:
            rule = at.rules[part.function]
            bound = [evaluate(argument, scope, at) for argument in part.arguments]
            inner = {
                parameter.name: value
                for parameter, value in zip(rule.parameters, bound, strict=False)
                if isinstance(value, Entity | Report)
            }
            shares.append(0.9 * _degree(rule.condition, inner, at, deep + 1))
        else:
            shares.append(0.0)
    return sum(weight * share for weight, share in zip(weights, shares, strict=True)) / sum(weights)


def _values(part: Expr, history: Sequence[RebuiltBoundary], scope: Locals) -> str:
    """Return the values of the sides of a comparison, or "false" for another condition."""
    at = history[-1].at
    if not isinstance(part, Binary):
        return "false"
    texts = []
    for side in (part.left, part.right):
        if isinstance(side, Number | Text | Flag | Symbol) or (isinstance(side, Ref) and side.kind == "region"):
            continue
        value = evaluate(side, scope, at)
        texts.append(f"{condition_text(side, scope)} = {_text(value)}")
    nearest = _nearest(part, history, scope)
    return ", ".join(texts or ["false"]) + (f" ({nearest})" if nearest else "")


def _nearest(part: Binary, history: Sequence[RebuiltBoundary], scope: Locals) -> str:
    """Return the value of the left side, over the whole episode, that came nearest to the bound on the right side."""
    if part.operator not in ("<", "<=", ">", ">=") or not isinstance(part.right, Number):
        return ""
    values = [(boundary.record.tick, evaluate(part.left, scope, boundary.at)) for boundary in history]
    numbers = [(float(value), tick) for tick, value in values if isinstance(value, int | float)]
    if len({value for value, _ in numbers}) < 2:
        return ""
    value, tick = min(numbers) if part.operator.startswith("<") else max(numbers, key=lambda pair: (pair[0], -pair[1]))
    return f"{'least' if part.operator.startswith('<') else 'most'} {value:.4g} at tick {tick}"


def _text(value: object) -> str:
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
            return f"({', '.join(map(_text, value))})"
        case str():
            return value
    if isinstance(value, Place):
        return f"({value.east:.4g}, {value.north:.4g})"
    return type(value).__name__
