"""Conditions of the mission graph in plain words, for readers who do not read code."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from lingjing.dsl.phrases import Phrases
from lingjing.mission import expression as ex

_COMPARED = {
    "==": "is", "!=": "is not", "<": "is less than", "<=": "is at most", ">": "is more than", ">=": "is at least",
}  # fmt: skip
_CALLS: dict[str, str] = {
    "iou": "the overlap of {0} with {1}",
    "distance": "the distance from {0} to {1}",
    "distance_xy": "the horizontal distance from {0} to {1}",
    "assigned": "{0} is assigned to {1}",
    "inspected": "the whole route of {0} has been inspected",
    "clear": "nothing blocks the route of {0}",
    "replans": "the number of replans of {0}",
    "used": "what {0} has counted",
}
"""Built-in functions in words; any other is called by its name."""

_AGGREGATES = {"count": "the number of {1} for which {0}", "sum": "the sum of {0} over {1}"}


class Words:
    """Puts the conditions of one mission into words."""

    def __init__(self, phrases: Phrases) -> None:
        self.phrases = phrases
        self._writers: dict[type, Callable[[Any], str]] = {
            ex.Binary: self._binary,
            ex.Unary: self._unary,
            ex.Quantified: self._quantified,
            ex.Aggregate: self._aggregate,
            ex.Call: self._call,
            ex.Attr: self._attribute,
        }

    def sentence(self, condition: ex.Expr) -> str:
        """The condition as a sentence without a full stop, in the order in which it is written."""
        return self.of(condition)

    def of(self, node: ex.Expr) -> str:
        """Any part of a condition."""
        writer = self._writers.get(type(node))
        return writer(node) if writer is not None else f"`{self.phrases.text(node)}`"

    def _binary(self, node: ex.Binary) -> str:
        if node.operator in ("and", "or"):
            sides = [self._side(node, side) for side in (node.left, node.right)]
            return f"{sides[0]} {node.operator} {sides[1]}"
        if node.operator in _COMPARED:
            return f"{self.of(node.left)} {_COMPARED[node.operator]} {self.of(node.right)}"
        if node.operator == "in":
            verb = "is one of" if isinstance(node.right, ex.Sequence) else "lies in"
            return f"{self.of(node.left)} {verb} {self.of(node.right)}"
        return f"`{self.phrases.text(node)}`"

    def _side(self, node: ex.Binary, side: ex.Expr) -> str:
        mixed = isinstance(side, ex.Binary) and side.operator in ("and", "or") and side.operator != node.operator
        return f"({self.of(side)})" if mixed else self.of(side)

    def _unary(self, node: ex.Unary) -> str:
        if node.operator == "not":
            return f"it is not so that {self.of(node.operand)}"
        return f"`{self.phrases.text(node)}`"

    def _quantified(self, node: ex.Quantified) -> str:
        amount = "every" if node.quantifier == "forall" else "some"
        return f"for {amount} {node.domain} `{node.variable}`, {self.of(node.body)}"

    def _aggregate(self, node: ex.Aggregate) -> str:
        shape = _AGGREGATES.get(node.function, f"the {node.function}imum of {{0}} over {{1}}")
        return shape.format(self.of(node.body), f"every {node.domain} `{node.variable}`")

    def _call(self, node: ex.Call) -> str:
        parts = [self.of(argument) for argument in node.arguments]
        if node.rule:
            return f"*{node.function}* holds for {' and '.join(parts)}" if parts else f"*{node.function}* holds"
        if node.function == "emitted":
            on = f" on {parts[1]}" if len(parts) > 1 else ""
            return f"an engine has performed {parts[0]}{on}"
        shape = _CALLS.get(node.function)
        if shape is not None and len(parts) == shape.count("{"):
            return shape.format(*parts)
        return f"`{self.phrases.text(node)}`"

    def _attribute(self, node: ex.Attr) -> str:
        base = node.base
        if isinstance(base, ex.Call) and base.function == "truth":
            entity, frame = (self.phrases.text(argument) for argument in base.arguments)
            return f"the true {node.name} of `{entity}` in `{frame}`"
        return f"`{self.phrases.text(node)}`"
