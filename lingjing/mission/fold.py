"""The one evaluator: an expression becomes a function of bound names and a world, as a reading understands it.

A `Reading` says what the parts of an expression mean: values (`evaluate`, the kernel's rules), bounds before a mission
runs (`bounds`), what must have happened (`feasibility.condition_needs`), words (`condition_words`). `meaning` walks the
tree once and gives a `Meaning`, which is called as often as needed. What the operators and functions mean stands in
`lingjing.mission.functions`; a reading adds what names and fields refer to.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Protocol, TypeVar

from lingjing.mission.expression import (
    Aggregate,
    Attr,
    Binary,
    Call,
    Draw,
    Expr,
    Flag,
    Index,
    Number,
    Point,
    Quantified,
    Range,
    Ref,
    Sequence,
    Symbol,
    Text,
    Unary,
    children,
)

Literal = Number | Text | Flag | Symbol
Composite = Index | Point | Sequence | Range | Unary | Binary | Call | Draw
Meaning = Callable[[Mapping[str, Any], Any], Any]
"""What a part of an expression means: a function of the bound names (name → value) and the reading's world."""

V = TypeVar("V", covariant=True)


class Reading(Protocol):
    """One way to understand expressions. Each method is called once for each node and gives its `Meaning`."""

    def literal(self, node: Literal) -> Meaning:
        """A number, a text, a flag or a word that stands for itself."""
        ...

    def name(self, node: Ref) -> Meaning:
        """A reference to a declaration, or to a bound name."""
        ...

    def field(self, node: Attr, base: Meaning) -> Meaning:
        """A field of a value."""
        ...

    def apply(self, node: Composite, operands: tuple[Meaning, ...]) -> Meaning:
        """An operator, a function, a rule, a list or a member of a group, applied to its operands in order."""
        ...

    def over(self, node: Quantified | Aggregate, body: Meaning) -> Meaning:
        """A body that is read once for each member of a group or each message of a kind."""
        ...


def meaning(node: Expr, reading: Reading) -> Meaning:
    """What the expression means in a reading."""
    if isinstance(node, Number | Text | Flag | Symbol):
        return reading.literal(node)
    if isinstance(node, Ref):
        return reading.name(node)
    if isinstance(node, Attr):
        return reading.field(node, meaning(node.base, reading))
    if isinstance(node, Quantified | Aggregate):
        return reading.over(node, meaning(node.body, reading))
    return reading.apply(node, tuple(meaning(child, reading) for child in children(node)))


class Meanings:
    """The meanings of the expressions of one mission in one reading, each worked out once."""

    MOST = 1024
    """Expressions that are kept: a few times those of a shipped mission (at most 329). Then all are forgotten, since
    every episode and every trace brings expressions of its own and keeps its instance alive through them."""

    def __init__(self, reading: Reading) -> None:
        self._reading = reading
        self._known: dict[int, tuple[Expr, Meaning]] = {}

    def of(self, node: Expr) -> Meaning:
        """The meaning of this very expression; equal ones elsewhere are worked out for themselves."""
        known = self._known.get(id(node))
        if known is None:
            if len(self._known) >= self.MOST:
                self._known.clear()
            known = self._known[id(node)] = node, meaning(node, self._reading)
        return known[1]
