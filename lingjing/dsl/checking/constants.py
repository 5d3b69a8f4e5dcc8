"""Constants of expressions: the numbers that are known in the text, as `lingjing.mission.evaluate` reads them."""

from __future__ import annotations

from collections.abc import Mapping

from lingjing.errors import MissionError
from lingjing.mission import expression as ex
from lingjing.mission.evaluate import Scope, evaluate
from lingjing.mission.values import is_number


class Constants:
    """The number that each expression always is, None if it is none or not known.

    `parameters` are params at their defaults.
    """

    def __init__(self, parameters: Mapping[str, float]) -> None:
        self._scope = Scope(parameters=parameters)

    def of(self, ir: ex.Expr) -> float | None:
        """The number an expression always is."""
        if isinstance(ir, ex.Number):
            return ir.value
        if any(isinstance(leaf, ex.Ref) and leaf.kind != "param" for leaf in ex.leaves(ir)):
            return None
        try:
            return self._value(ir)
        except MissionError:
            return None

    def joined(self, ir: ex.Expr, left: float | None) -> tuple[float | None, bool]:
        """What a binary operation always is whose left side is `left`, and whether that is too large a number.

        A chain of operations is so read once from left to right.
        """
        right = self.of(ir.right) if isinstance(ir, ex.Binary) and left is not None else None
        if not isinstance(ir, ex.Binary) or left is None or right is None:
            return None, False
        try:
            return self._value(ex.Binary(ir.operator, ex.Number(left), ex.Number(right))), False
        except MissionError:
            return None, True

    def _value(self, ir: ex.Expr) -> float | None:
        """`MissionError` if there is no such number, because it is too large or divides by zero."""
        value = evaluate(ir, self._scope)
        return float(value) if is_number(value) else None
