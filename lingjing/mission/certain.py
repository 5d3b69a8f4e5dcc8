"""Evaluation that holds in every run: truth as true, false or None, numbers as bounds.

`certain(expr, names, knowledge)` evaluates an expression over bounds. A `Knowledge` supplies what is known of names,
fields and places. An unknown value is None. The checker uses it to decide whether success holds at the start, which
members of a group a rule can be true of, and in which modes a declaration exists.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from lingjing.errors import MissionError
from lingjing.mission import expression as ex
from lingjing.mission import operations
from lingjing.mission.evaluate import Scope
from lingjing.mission.fold import Composite, Literal, Meaning, Meanings
from lingjing.mission.functions import operation
from lingjing.mission.intervals import ANYTHING, Bounds, Estimate, both, either, exactly, greatest, least, total
from lingjing.mission.values import Area, EvaluationContext, Interval, Members, Place, Value, is_number


class Knowledge:
    """The facts that are known before a run. This base class knows none, so that only constants are certain.

    Numbers are `Bounds`; None is an unknown value.
    """

    def name(self, ref: ex.Ref) -> Value:
        """Return the value of a reference that is not bound by the expression."""
        return None

    def field(self, value: Value, name: str) -> Value:
        """Return a field of an entity."""
        return None

    def members(self, domain: str) -> Sequence[Value] | None:
        """Return the members of a group or the messages of a kind; None if they are unknown."""
        return None

    def any_member(self, domain: str) -> Value:
        """Return an arbitrary member of a domain with unknown members; None if nothing is known of it."""
        return None

    def defined(self, expr: ex.Expr) -> bool:
        """Return whether every value in the expression exists, so that a condition that is not true is false."""
        return True

    def spot(self, value: Value) -> Estimate | None:
        """Return the position of an entity."""
        return None

    def answer(self, call: ex.Call, arguments: Sequence[Value]) -> Value:
        """Return the value of a call of a rule or of a function of the running mission."""
        return None


def certain(expr: ex.Expr, names: Mapping[str, Value], knowledge: Knowledge) -> Value:
    """The value of an expression as far as it is certain: `Bounds` for a number, None if unknown."""
    return _MEANINGS.of(expr)(names, knowledge)


def truth(condition: ex.Expr, names: Mapping[str, Value], knowledge: Knowledge) -> bool | None:
    """True or False if the condition has this value in every run, otherwise None."""
    return _flag(certain(condition, names, knowledge))


def known(value: Value) -> Value:
    """A plain value in the form of this evaluation: a number becomes its bounds."""
    return exactly(value) if is_number(value) else value


_NO_SCOPE = Scope()
"""The scope of operations that have exact operands and need no other facts."""


class _Certain:
    def literal(self, node: Literal) -> Meaning:
        constant = node.name if isinstance(node, ex.Symbol) else known(node.value)
        return lambda names, knowledge: constant

    def name(self, node: ex.Ref) -> Meaning:
        if node.kind == "local":
            return lambda names, knowledge: names.get(node.name)
        return lambda names, knowledge: knowledge.name(node)

    def field(self, node: ex.Attr, base: Meaning) -> Meaning:
        def field(names: Mapping[str, Value], knowledge: Knowledge) -> Value:
            value = base(names, knowledge)
            if not isinstance(value, Place | Area | Interval):
                return None if value is None else knowledge.field(value, node.name)
            try:
                return known(operations.field(value, node.name))
            except MissionError:
                return None

        return field

    def apply(self, node: Composite, operands: tuple[Meaning, ...]) -> Meaning:
        match node:
            case ex.Binary(operator="and" | "or" as operator):
                joined = both if operator == "and" else either
                left, right = operands
                return lambda names, known: joined(_flag(left(names, known)), _flag(right(names, known)))
            case ex.Unary(operator="not"):
                return _negation(node.operand, operands[0])
            case ex.Call(rule=True):
                return lambda names, known: known.answer(node, [operand(names, known) for operand in operands])
        operation_entry = operation(node)
        if operation_entry is None:
            return lambda names, known: None

        def value_of(names: Mapping[str, Value], knowledge: Knowledge) -> Value:
            values = [operand(names, knowledge) for operand in operands]
            if operation_entry.bounds is not None:
                estimates = [_estimate(value, knowledge) for value in values]
                if all(isinstance(value, Bounds | Estimate) for value in estimates):
                    return operation_entry.bounds(*estimates)
            if isinstance(node, ex.Call) and operation_entry.running:
                return known(knowledge.answer(node, values))
            return exact(operation_entry.value, _NO_SCOPE, values)

        return value_of

    def over(self, node: ex.Quantified | ex.Aggregate, body: Meaning) -> Meaning:
        def each(names: Mapping[str, Value], knowledge: Knowledge) -> Value:
            members = knowledge.members(node.domain)
            if members is None:
                return _unlisted(node, body, names, knowledge)
            values = [body({**names, node.variable: member}, knowledge) for member in members]
            return _joined(node, values) if isinstance(node, ex.Quantified) else _aggregated(node.function, values)

        return each


_MEANINGS = Meanings(_Certain())


def _flag(value: Value) -> bool | None:
    return value if isinstance(value, bool) else None


def _negation(node: ex.Expr, operand: Meaning) -> Meaning:
    def negated(names: Mapping[str, Value], knowledge: Knowledge) -> Value:
        value = _flag(operand(names, knowledge))
        if value is None or (value and not knowledge.defined(node)):
            return None
        return not value

    return negated


def _estimate(value: Value, knowledge: Knowledge) -> Value:
    """An operand in the form of the functions over bounds: a place becomes an estimate with a radius of 0 m."""
    if value is None:
        return ANYTHING
    if isinstance(value, Place):
        return Estimate(value.east, value.north, 0.0)
    return value if isinstance(value, Bounds) else knowledge.spot(value)


_PLAIN = (bool, int, float, str, Place, Area, Interval, Members, tuple)
"""Types of exact values."""


def exact(function: operations.Function, context: EvaluationContext, values: Sequence[Value]) -> Value:
    """The value of a function of exact operands; None if an operand is not exact, or stands for something of a running
    mission, or if the function has no value for these operands."""
    if not all(value.exact if isinstance(value, Bounds) else isinstance(value, _PLAIN) for value in values):
        return None
    plain = [value.low if isinstance(value, Bounds) else value for value in values]
    try:
        return known(function(context, *plain))
    except MissionError:
        return None


def _unlisted(
    node: ex.Quantified | ex.Aggregate, body: Meaning, names: Mapping[str, Value], knowledge: Knowledge
) -> Value:
    """The value over a domain with unknown members: a condition that no member can meet is met by none of them."""
    if isinstance(node, ex.Quantified):
        member = knowledge.any_member(node.domain) if node.quantifier == "exists" else None
        met = None if member is None else _flag(body({**names, node.variable: member}, knowledge))
        return False if met is False else None
    return Bounds(0.0, math.inf) if node.function == "count" else None


def _joined(node: ex.Quantified, values: Sequence[Value]) -> bool | None:
    whole: bool | None = node.quantifier == "forall"
    for value in values:
        whole = (both if node.quantifier == "forall" else either)(whole, _flag(value))
    return whole


def _aggregated(function: str, values: Sequence[Value]) -> Bounds:
    if function == "count":
        flags = [_flag(value) for value in values]
        return Bounds(float(flags.count(True)), float(len(flags) - flags.count(False)))
    numbers = [value if isinstance(value, Bounds) else ANYTHING for value in values]
    if function == "sum":
        return total(*numbers)
    if not numbers:
        return ANYTHING
    return least(*numbers) if function == "min" else greatest(*numbers)
