"""What is certain of an expression whatever happens: truth as true, false or None, numbers as bounds.

`certain(expr, names, knowledge)` folds the expression over bounds. `Knowledge` says what is known of names, fields and
places; what nothing is known of is None. Whether success holds at the start, which members of a group a rule can be
true of and in which modes a declaration exists are answered by it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from lingjing.errors import MissionError
from lingjing.mission import expression as ex
from lingjing.mission import operations
from lingjing.mission.evaluate import Scope
from lingjing.mission.fold import Composite, Literal, Meaning, Meanings
from lingjing.mission.functions import operation
from lingjing.mission.intervals import ANYTHING, Bounds, Estimate, both, either, exactly, greatest, least, total
from lingjing.mission.values import Area, EvaluationContext, Interval, Place, Value, is_number


class Knowledge:
    """What is known: nothing, so that constants alone are certain; the base of what knows something.

    Numbers are `Bounds`; None is what is not known.
    """

    def name(self, ref: ex.Ref) -> Value:
        """What a reference means that is bound to nothing here."""
        return None

    def field(self, value: Value, name: str) -> Value:
        """A field of an entity."""
        return None

    def members(self, domain: str) -> Sequence[Value] | None:
        """The members of a group, or the messages of a kind; None if they are not known."""
        return None

    def spot(self, value: Value) -> Estimate | None:
        """Where an entity is."""
        return None

    def answer(self, call: ex.Call, arguments: Sequence[Value]) -> Value:
        """What a rule answers, or a function of a running mission."""
        return None


def certain(expr: ex.Expr, names: Mapping[str, Value], knowledge: Knowledge) -> Value:
    """The value of an expression as far as it is certain: `Bounds` for a number, None where nothing is."""
    return _MEANINGS.of(expr)(names, knowledge)


def truth(condition: ex.Expr, names: Mapping[str, Value], knowledge: Knowledge) -> bool | None:
    """Whether a condition certainly holds, certainly does not, or neither."""
    return _flag(certain(condition, names, knowledge))


def known(value: Value) -> Value:
    """A plain value as this reading has it: a number as its bounds."""
    return exactly(value) if is_number(value) else value


_NO_SCOPE = Scope()
"""The world of operations whose operands are all exact."""


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
                return _negation(operands[0])
            case ex.Call(rule=True):
                return lambda names, known: known.answer(node, [operand(names, known) for operand in operands])
        done = operation(node)
        if done is None:
            return lambda names, known: None

        def applied(names: Mapping[str, Value], knowledge: Knowledge) -> Value:
            values = [operand(names, knowledge) for operand in operands]
            if done.bounds is not None:
                seen = [_estimate(value, knowledge) for value in values]
                if all(isinstance(value, Bounds | Estimate) for value in seen):
                    return done.bounds(*seen)
            if isinstance(node, ex.Call) and done.running:
                return known(knowledge.answer(node, values))
            return exact(done.value, _NO_SCOPE, values)

        return applied

    def over(self, node: ex.Quantified | ex.Aggregate, body: Meaning) -> Meaning:
        def each(names: Mapping[str, Value], knowledge: Knowledge) -> Value:
            members = knowledge.members(node.domain)
            if members is None:
                return None
            values = [body({**names, node.variable: member}, knowledge) for member in members]
            return _joined(node, values) if isinstance(node, ex.Quantified) else _aggregated(node.function, values)

        return each


_MEANINGS = Meanings(_Certain())


def _flag(value: Value) -> bool | None:
    return value if isinstance(value, bool) else None


def _negation(operand: Meaning) -> Meaning:
    def negated(names: Mapping[str, Value], knowledge: Knowledge) -> Value:
        value = _flag(operand(names, knowledge))
        return None if value is None else not value

    return negated


def _estimate(value: Value, knowledge: Knowledge) -> Value:
    """An operand as the functions over bounds take it: a place is where it is and how far off that may be."""
    if value is None:
        return ANYTHING
    if isinstance(value, Place):
        return Estimate(value.east, value.north, 0.0)
    return value if isinstance(value, Bounds) else knowledge.spot(value)


def exact(function: operations.Function, context: EvaluationContext, values: Sequence[Value]) -> Value:
    """What a function gives of values that are all exact; None where one is not, or where it has no value."""
    if any(value is None or (isinstance(value, Bounds) and not value.exact) for value in values):
        return None
    plain = [value.low if isinstance(value, Bounds) else value for value in values]
    try:
        return known(function(context, *plain))
    except MissionError:
        return None


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
