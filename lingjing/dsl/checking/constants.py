"""Constants of expressions: the one evaluator (`lingjing.mission.fold`), reading numbers that are known in the text."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from lingjing.errors import MissionError
from lingjing.mission import expression as ex
from lingjing.mission.fold import Composite, Literal, Meaning, meaning
from lingjing.mission.functions import operation
from lingjing.mission.values import is_number


class Constants:
    """A reading of expressions: the number that each always is, None if it is none or not known.

    `parameters` are params at their defaults.
    """

    def __init__(self, parameters: Mapping[str, float]) -> None:
        self._parameters = parameters

    def of(self, ir: ex.Expr) -> float | None:
        """The number an expression always is."""
        if isinstance(ir, ex.Number):
            return ir.value
        if isinstance(ir, ex.Draw | ex.Point | ex.Sequence | ex.Range):
            return None
        found: float | None = meaning(ir, self)({}, None)
        return found

    def joined(self, ir: ex.Expr, left: float | None) -> tuple[float | None, bool]:
        """What a binary operation always is whose left side is `left`, and whether that is too large a number.

        A chain of operations is so read once from left to right.
        """
        right = self.of(ir.right) if isinstance(ir, ex.Binary) and left is not None else None
        try:
            return (None if right is None else _applied(ir, (left, right))), False
        except MissionError:
            return None, True

    def literal(self, node: Literal) -> Meaning:
        """A number."""
        value = node.value if isinstance(node, ex.Number) else None
        return lambda names, world: value

    def name(self, node: ex.Ref) -> Meaning:
        """A param."""
        return lambda names, world: self._parameters.get(node.name) if node.kind == "param" else None

    def field(self, node: ex.Attr, base: Meaning) -> Meaning:
        """What stands in a field is no constant."""
        return _none

    def apply(self, node: Composite, operands: tuple[Meaning, ...]) -> Meaning:
        """An operator or a function over constants."""

        def applied(names: Mapping[str, Any], world: object) -> float | None:
            values = tuple(operand(names, world) for operand in operands)
            try:
                return None if None in values else _applied(node, values)
            except MissionError:
                return None

        return applied

    def over(self, node: ex.Quantified | ex.Aggregate, body: Meaning) -> Meaning:
        """What ranges over a group is no constant."""
        return _none


def _none(names: Mapping[str, Any], world: object) -> None:
    return None


def _applied(node: ex.Expr, values: tuple[float | None, ...]) -> float | None:
    """`MissionError` if there is no such number, because it is too large or divides by zero."""
    done = operation(node)
    if done is None or done.running or (isinstance(node, ex.Call) and node.named):
        return None
    value = done.value(None, *values)
    return float(value) if is_number(value) else None
