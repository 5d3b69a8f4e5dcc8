"""Constants: the numbers that expressions always equal, computed by `lingjing.mission.evaluate`."""

from __future__ import annotations

from collections.abc import Mapping

from lingjing.errors import MissionError
from lingjing.mission import expression as ex
from lingjing.mission.evaluate import Scope, evaluate
from lingjing.mission.values import is_number


class Constants:
    """Computes the number that an expression always equals. `parameters`: params at their defaults."""

    def __init__(self, parameters: Mapping[str, float]) -> None:
        self._scope = Scope(parameters=parameters)

    def of(self, ir: ex.Expr) -> float | None:
        """The number that an expression always equals; None if it varies or is no number."""
        if isinstance(ir, ex.Number):
            return ir.value
        if any(isinstance(leaf, ex.Ref) and leaf.kind != "param" for leaf in ex.leaves(ir)):
            return None
        try:
            return self._value(ir)
        except MissionError:
            return None

    def joined(self, ir: ex.Expr, left: float | None) -> tuple[float | None, bool]:
        """The number of a binary operation with the left side `left`, and True if it is too large.

        With this function a chain of operations is computed once from left to right.
        """
        right = self.of(ir.right) if isinstance(ir, ex.Binary) and left is not None else None
        if not isinstance(ir, ex.Binary) or left is None or right is None:
            return None, False
        try:
            return self._value(ex.Binary(ir.operator, ex.Number(left), ex.Number(right))), False
        except MissionError:
            return None, True

    def _value(self, ir: ex.Expr) -> float | None:
        """The value of a constant expression. Raises `MissionError` if it is too large or divides by zero."""
        value = evaluate(ir, self._scope)
        return float(value) if is_number(value) else None
