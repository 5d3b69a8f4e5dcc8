"""Expressions of the mission graph: a closed, total, typed tree.

The compiler of the language builds it; `lingjing.mission.evaluate` evaluates parameters, positions and draws, and the
kernel evaluates rules. Quantities are in SI base units together with the author's unit, angles in degrees.

Invariants: every tree is finite and immutable; `Draw` appears only at the root of a property; a `Quantified` and an
`Aggregate` bind exactly one name.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, Literal

import msgspec


class _Node(msgspec.Struct, frozen=True, tag=True, tag_field="node"):
    """Base of every expression node; its tag in JSON is the class name."""


class Number(_Node, frozen=True):
    """A quantity."""

    value: float
    """The number in SI base units (metre, second, kilogram, …); angles in degrees."""
    unit: str = ""
    """The unit as the author wrote it; "" for a number without unit."""


class Text(_Node, frozen=True):
    """A quoted string."""

    value: str


class Flag(_Node, frozen=True):
    """`true` or `false`."""

    value: bool


class Symbol(_Node, frozen=True):
    """A name that stands for itself: a class, a mode, a channel, a verb."""

    name: str


class Ref(_Node, frozen=True):
    """A reference to a declaration or to a bound variable."""

    name: str
    kind: Literal["param", "switch", "region", "grid", "group", "entity", "role", "mode", "local", "clock"]
    """The table in which the checker resolved the name; `switch` for a param that is `true` or `false`."""


class Index(_Node, frozen=True):
    """One member of a group, counted from 1: `uav[i]`."""

    base: Expr
    index: Expr


class Attr(_Node, frozen=True):
    """A field of a record, an entity or a region: `r.position`."""

    base: Expr
    name: str


class Point(_Node, frozen=True):
    """Two or three lengths in the mission's frame: east, north and (optionally) elevation in metres."""

    items: tuple[Expr, ...]


class Sequence(_Node, frozen=True):
    """A bracketed list."""

    items: tuple[Expr, ...]


class Range(_Node, frozen=True):
    """An inclusive interval `low..high`."""

    low: Expr
    high: Expr


class Call(_Node, frozen=True):
    """A call of a built-in function, or of a rule of this mission."""

    function: str
    arguments: tuple[Expr, ...] = ()
    named: tuple[tuple[str, Expr], ...] = ()
    """Named arguments in the order of the text."""
    rule: bool = False
    """True for a rule of this mission."""


class Unary(_Node, frozen=True):
    """`-x` or `not x`."""

    operator: Literal["-", "not"]
    operand: Expr


class Binary(_Node, frozen=True):
    """Arithmetic, comparison, membership or logic on two operands."""

    operator: Literal["+", "-", "*", "/", "==", "!=", "<", "<=", ">", ">=", "in", "and", "or"]
    left: Expr
    right: Expr


class Quantified(_Node, frozen=True):
    """`exists r: body` or `forall v in domain: body`."""

    quantifier: Literal["exists", "forall"]
    variable: str
    domain: str
    """Name of a group or of a message kind."""
    body: Expr


class Aggregate(_Node, frozen=True):
    """`sum(o.demand for o in order)`: one number over a group or a message kind.

    `count` counts the bindings for which the body, a condition, is true. Over an empty domain `sum` and `count` are 0,
    and `min` and `max` are undefined.
    """

    function: Literal["count", "sum", "min", "max"]
    variable: str
    domain: str
    body: Expr


class Draw(_Node, frozen=True):
    """A seeded draw: `~ uniform(a, b)`, `~ sites(region, apart >= 80 m)`."""

    distribution: str
    arguments: tuple[Expr, ...] = ()
    named: tuple[tuple[str, Expr], ...] = ()
    """Named arguments, such as `apart`."""


Expr = (
    Number
    | Text
    | Flag
    | Symbol
    | Ref
    | Index
    | Attr
    | Point
    | Sequence
    | Range
    | Call
    | Unary
    | Binary
    | Quantified
    | Aggregate
    | Draw
)


def children(expr: Expr) -> tuple[Expr, ...]:
    """The direct sub-expressions."""
    inner = _CHILDREN.get(type(expr))
    return () if inner is None else inner(expr)


_CHILDREN: dict[type, Callable[[Any], tuple[Expr, ...]]] = {
    Index: lambda expr: (expr.base, expr.index),
    Attr: lambda expr: (expr.base,),
    Point: lambda expr: expr.items,
    Sequence: lambda expr: expr.items,
    Range: lambda expr: (expr.low, expr.high),
    Call: lambda expr: (*expr.arguments, *(value for _, value in expr.named)),
    Draw: lambda expr: (*expr.arguments, *(value for _, value in expr.named)),
    Unary: lambda expr: (expr.operand,),
    Binary: lambda expr: (expr.left, expr.right),
    Quantified: lambda expr: (expr.body,),
    Aggregate: lambda expr: (expr.body,),
}
"""Kind of an expression → its direct sub-expressions, in reading order. The others have none."""


def parts(expr: Expr) -> tuple[Expr, ...]:
    """The expression and all its sub-expressions, outermost first, in reading order."""
    visited, stack = [], [expr]
    while stack:
        part = stack.pop()
        visited.append(part)
        stack.extend(reversed(children(part)))
    return tuple(visited)


def leaves(expr: Expr) -> tuple[Expr, ...]:
    """The sub-expressions that have none themselves."""
    return tuple(part for part in parts(expr) if not children(part))


def conjuncts(expr: Expr) -> tuple[Expr, ...]:
    """The sides of the outermost `and`s of a condition, in order."""
    if isinstance(expr, Binary) and expr.operator == "and":
        return (*conjuncts(expr.left), *conjuncts(expr.right))
    return (expr,)


def components(condition: Expr) -> Iterator[tuple[Quantified | None, Expr]]:
    """The parts of a condition that score and subtasks count: its conjuncts. A conjunct `forall` gives the quantifier
    and its body, any other one None and itself."""
    for part in conjuncts(condition):
        if isinstance(part, Quantified) and part.quantifier == "forall":
            yield part, part.body
        else:
            yield None, part
