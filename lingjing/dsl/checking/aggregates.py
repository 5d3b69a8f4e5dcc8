"""Checkers of aggregates: `count(rescued(v) for v in victim)`, `sum(o.demand for o in order)`, `min(…)`, `max(…)`.

They are known only while the mission runs. Without `for`, `min` and `max` are functions of two or more numbers.
"""

from __future__ import annotations

from typing import Any

from lingjing.dsl.checking.calls import CallChecker
from lingjing.dsl.checking.values import UNKNOWN, Environment, TypedExpression
from lingjing.dsl.source.reporter import Change
from lingjing.dsl.syntax import tree as s
from lingjing.mission import expression as ex
from lingjing.mission.functions import AGGREGATES, FUNCTIONS, NUMBER
from lingjing.suggest import did_you_mean


def is_aggregate(node: s.CallExpr) -> bool:
    """True if a call is an aggregate: by its name, or by a `for` inside."""
    name = node.function.text
    return (name in AGGREGATES and name not in FUNCTIONS) or any(argument.over for argument in node.arguments)


_QUANTIFIERS = {"all": "forall", "every": "forall", "any": "exists", "some": "exists"}
"""Function elsewhere → the quantifier."""


def _quantifier(node: s.CallExpr, text: str) -> tuple[str, tuple[Change, ...]]:
    """`forall v in group: …` for `all(… for v in group)`: the hint and the edit; empty for another function."""
    word = _QUANTIFIERS.get(node.function.text)
    over = node.arguments[0].over if len(node.arguments) == 1 else None
    if word is None or over is None:
        return "", ()
    body = node.arguments[0].value
    written = f"{word} {over.variable.text} in {over.domain.text}: {text[body.start : body.end]}"
    return f"write `{word} v in …: …`", ((node.start, node.end, written),)


def aggregate(calls: CallChecker, node: s.CallExpr, environment: Environment) -> TypedExpression:
    """The checked aggregate. Its value is a number, or a quantity of its body's dimension."""
    function, checker = node.function, calls.of
    if function.text not in AGGREGATES:
        hint, edits = _quantifier(node, checker.report.source.text)
        hint = hint or did_you_mean(function.text, AGGREGATES)
        checker.report.at("LJ0306", function, f"`{function.text}` does not range over a group", hint, edits=edits)
        return UNKNOWN
    if not environment.rule:
        message = f"`{function.text}(…)` over a group is known only while the mission runs"
        checker.report.at("LJ0304", function, message, "use it in a rule")
        return UNKNOWN
    over = node.arguments[0].over if len(node.arguments) == 1 else None
    if over is None:
        hint = f"`{function.text}(… for x in group)`"
        checker.report.at("LJ0306", node, f"`{function.text}` takes one argument with `for … in …`", hint)
        return UNKNOWN
    kind = calls.domain_type(over.domain)
    if kind is None:
        return UNKNOWN
    inside = environment.binding(over.variable.text, kind)
    body = checker.expect(node.arguments[0].value, inside, AGGREGATES[function.text], f"`{function.text}`")
    if body is UNKNOWN:
        return UNKNOWN
    name: Any = function.text
    result = NUMBER if function.text == "count" else body.type
    return TypedExpression(ex.Aggregate(name, over.variable.text, over.domain.text, body.ir), result, body.taint)
