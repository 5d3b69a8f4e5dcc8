"""Evaluation of a mission's static expressions, which depend on nothing after the start.

`evaluate(expr, scope)` gives a plain value: a flag, a number (SI, angles in degrees), a word, a `Place`, an `Interval`,
an `Area`, the `Members` of a group, or a tuple of values. An expression over facts of a run (events, reports, sensors)
is evaluated by the kernel; here it raises `MissionError`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import msgspec

from lingjing.errors import MissionError
from lingjing.mission import expression as ex
from lingjing.mission.fold import Composite, Literal, Meaning, Meanings
from lingjing.mission.functions import FUNCTIONS, operation
from lingjing.mission.operations import field, further_place
from lingjing.mission.values import (
    Area,
    Interval,
    Members,
    Place,
    Value,
    as_area,
    as_flag,
    as_number,
    as_whole,
    describe,
)

__all__ = [
    "Area",
    "Interval",
    "Members",
    "Place",
    "Scope",
    "Value",
    "area",
    "describe",
    "evaluate",
    "flag_of",
    "further_place",
    "members",
    "number",
    "whole",
]


class Scope(msgspec.Struct, frozen=True):
    """The facts that a static expression may refer to."""

    parameters: Mapping[str, float] = {}
    """Values of the mission's parameters."""
    mode: str = ""
    """Name of the active mode."""
    areas: Mapping[str, Area] = {}
    """Regions by name, as far as their polygons are known."""
    members: Mapping[str, tuple[str, ...]] = {}
    """A group or a single entity → the ids of its entities."""
    names: Mapping[str, float] = {}
    """Values of bound index variables."""
    tick_s: float = 1.0
    """Length of a decision tick, seconds."""
    places: Mapping[str, Place] = {}
    """Entity id → its position, as far as it is known."""

    def binding(self, name: str, value: float) -> Scope:
        """Return this scope with one more index variable."""
        return msgspec.structs.replace(self, names={**self.names, name: value})

    def refer(self, ref: ex.Ref) -> Value:
        """The value of a reference. Raises `MissionError` if there is no declaration of this name."""
        match ref.kind:
            case "param" if ref.name in self.parameters:
                return self.parameters[ref.name]
            case "switch":  # instances leave out switches that are off
                return self.parameters.get(ref.name, 0.0) != 0.0
            case "local" if ref.name in self.names:
                return self.names[ref.name]
            case "region" if ref.name in self.areas:
                return self.areas[ref.name]
            case "group" | "entity" if ref.name in self.members:
                return Members(self.members[ref.name])
            case "mode":
                return self.mode if ref.name == "mode" else ref.name
            case "clock":
                return self.tick_s
            case "role" | "grid":
                return ref.name
        if ref.kind == "region":
            hint = "regions along a road or around an entity are known only after placement: draw from another region"
            raise MissionError(f"the area of region '{ref.name}' is not known yet", hint=hint)
        raise MissionError(f"there is no {ref.kind} '{ref.name}' here", hint=f"declare '{ref.name}' or check its guard")

    def place(self, value: Value) -> Place | None:
        """A point itself, or the position of an entity if it is known."""
        if isinstance(value, Members) and len(value.ids) == 1:
            return self.places.get(value.ids[0])
        return value if isinstance(value, Place) else None

    def note(self, name: str, number: float) -> None:
        """Discard a measured number: static evaluation records no evidence."""

    def fact(self, name: str, arguments: Sequence[Value]) -> Value:
        """Raise `MissionError`: facts of a run do not exist before the first tick."""
        raise MissionError(f"'{name}(…)' needs a running mission and cannot stand in a declaration")


class _Static:
    """Semantics of expressions before the run. Errors are `MissionError`s."""

    def literal(self, node: Literal) -> Meaning:
        value = float(node.value) if isinstance(node, ex.Number) else getattr(node, "value", None)
        constant = node.name if isinstance(node, ex.Symbol) else value
        return lambda names, scope: constant

    def name(self, node: ex.Ref) -> Meaning:
        return lambda names, scope: scope.refer(node)

    def field(self, node: ex.Attr, base: Meaning) -> Meaning:
        return lambda names, scope: field(base(names, scope), node.name)

    def apply(self, node: Composite, operands: tuple[Meaning, ...]) -> Meaning:
        if isinstance(node, ex.Binary) and node.operator in ("and", "or"):
            return _logic(node.operator == "and", *operands)
        if isinstance(node, ex.Draw):
            return _refused(f"'~ {node.distribution}(…)' must be the whole value of a property")
        known = operation(node)
        if known is None:
            name = node.function if isinstance(node, ex.Call) else ""
            return _refused(f"'{name}(…)' needs a running mission and cannot stand in a declaration")
        value = known.value
        if not isinstance(node, ex.Call):
            return lambda names, scope: value(scope, *[operand(names, scope) for operand in operands])
        fault = _argument_count_fault(node)
        if fault:
            return _refused(fault)
        arguments, named = operands[: len(node.arguments)], [name for name, _ in node.named]
        options = dict(zip(named, operands[len(node.arguments) :], strict=True))
        if node.function == "at":
            arguments = (arguments[0], _items(node.arguments[1], arguments[1]))
        return lambda names, scope: value(
            scope,
            *[operand(names, scope) for operand in arguments],
            **{name: operand(names, scope) for name, operand in options.items()},
        )

    def over(self, node: ex.Quantified | ex.Aggregate, body: Meaning) -> Meaning:
        if isinstance(node, ex.Aggregate):
            return _refused(f"'{node.function}(…)' over a group needs a running mission")
        return _refused(f"'{node.quantifier}' needs a running mission and cannot stand in a declaration")


def _logic(both: bool, left: Meaning, right: Meaning) -> Meaning:
    if both:
        return lambda names, scope: as_flag(left(names, scope)) and as_flag(right(names, scope))
    return lambda names, scope: as_flag(left(names, scope)) or as_flag(right(names, scope))


def _refused(message: str) -> Meaning:
    def raise_error(names: object, scope: object) -> Value:
        raise MissionError(message)

    return raise_error


def _items(node: ex.Expr, operand: Meaning) -> Meaning:
    """A list without references is evaluated once, because a large group reads its items one after the other."""
    if any(isinstance(part, ex.Ref) for part in ex.parts(node)):
        return operand
    known: list[Value] = []

    def items(names: Mapping[str, Value], scope: Scope) -> Value:
        if not known:
            known.append(operand(names, scope))
        return known[0]

    return items


def _argument_count_fault(node: ex.Call) -> str:
    """The error in the number of a call's arguments, or ""."""
    signature = FUNCTIONS.get(node.function)
    if signature is None:
        return ""
    count = len(node.arguments)
    least = signature.least or sum(not parameter.optional for parameter in signature.parameters)
    if signature.variadic:
        # a polygon also takes one list of its corners
        short = count < least and not (node.function == "polygon" and count == 1)
        return f"{node.function}(…) takes at least {least} arguments, not {count}" if short else ""
    if least <= count <= len(signature.parameters):
        return ""
    return f"{node.function}(…) takes {len(signature.parameters)} arguments, not {count}"


_MEANINGS = Meanings(_Static())


def evaluate(expr: ex.Expr, scope: Scope) -> Value:
    """The value of a static expression. Raises `MissionError` with the reason if it has none."""
    return _MEANINGS.of(expr)(scope.names, scope)


def number(expr: ex.Expr, scope: Scope) -> float:
    """The expression's value as a finite number."""
    return as_number(evaluate(expr, scope))


def whole(expr: ex.Expr, scope: Scope) -> int:
    """The expression's value as a whole number."""
    return as_whole(evaluate(expr, scope))


def flag_of(expr: ex.Expr, scope: Scope) -> bool:
    """The expression's value as true or false."""
    return as_flag(evaluate(expr, scope))


def area(expr: ex.Expr, scope: Scope) -> Area:
    """The expression's value as a region."""
    return as_area(evaluate(expr, scope))


def members(expr: ex.Expr, scope: Scope) -> tuple[str, ...]:
    """The ids of the entities that the expression names."""
    value = evaluate(expr, scope)
    if not isinstance(value, Members):
        raise MissionError(f"expected an asset or a target, got {describe(value)}")
    return value.ids
