"""The one traversal of expressions: an expression becomes a function of bound names and a world, under given semantics.

A `Semantics` defines the meaning of each kind of node: exact values (`evaluate`, the kernel's rules), bounds before a
run (`certain`), needs (`conditions.condition_needs`), words (`condition_words`). `meaning` traverses the tree once and
gives a `Meaning`, which is called as often as needed. `lingjing.mission.functions` defines the operators and functions;
a semantics adds the meaning of names and fields.
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
"""The meaning of an expression: a function of the bound names (name → value) and the world of the semantics."""

V = TypeVar("V", covariant=True)


class Semantics(Protocol):
    """One interpretation of expressions. Each method is called once for each node and gives its `Meaning`."""

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
        """A body that is evaluated once for each member of a group or each message of a kind."""
        ...


_LITERALS = (Number, Text, Flag, Symbol)


def meaning(node: Expr, semantics: Semantics) -> Meaning:
    """The meaning of an expression under a semantics."""
    if isinstance(node, _LITERALS):
        return semantics.literal(node)
    if isinstance(node, Ref):
        return semantics.name(node)
    if isinstance(node, Attr):
        return semantics.field(node, meaning(node.base, semantics))
    if isinstance(node, (Quantified, Aggregate)):
        return semantics.over(node, meaning(node.body, semantics))
    return semantics.apply(node, tuple(meaning(child, semantics) for child in children(node)))


class Meanings:
    """The meanings of one mission's expressions under one semantics, each computed once."""

    MOST = 1024
    """The largest number of cached expressions (chosen): a few times those of a shipped mission (at most 329). A full
    cache is cleared, because every episode and every trace has its own expressions, and these keep its instance in
    memory."""

    def __init__(self, semantics: Semantics) -> None:
        self._semantics = semantics
        self._known: dict[int, tuple[Expr, Meaning]] = {}

    def of(self, node: Expr) -> Meaning:
        """The meaning of this expression object. An equal expression elsewhere is computed separately."""
        known = self._known.get(id(node))
        if known is None:
            if len(self._known) >= self.MOST:
                self._known.clear()
            known = self._known[id(node)] = node, meaning(node, self._semantics)
        return known[1]
