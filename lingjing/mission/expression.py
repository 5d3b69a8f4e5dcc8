"""Expressions of the mission graph: a closed, total, typed tree.

Lowered by the language, evaluated by `lingjing.mission.evaluate` (parameters, positions, draws) and by the kernel's
adjudicator (rules). Quantities are held in SI base units with the author's unit beside them, angles in degrees.

Invariants: every tree is finite and immutable; `Draw` appears only at the root of a property; a `Quantified` and an
`Aggregate` bind exactly one name.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal

import msgspec


class Node(msgspec.Struct, frozen=True, tag=True, tag_field="node"):
    """Base of every expression node; the tag in JSON is the class name."""


class Number(Node, frozen=True):
    """A quantity: `value` in SI base units (metre, second, kilogram, degree, …), `unit` as the author wrote it."""

    value: float
    unit: str = ""


class Text(Node, frozen=True):
    """A quoted string."""

    value: str


class Flag(Node, frozen=True):
    """`true` or `false`."""

    value: bool


class Symbol(Node, frozen=True):
    """A name that stands for itself: a class, a mode, a channel, a verb."""

    name: str


class Ref(Node, frozen=True):
    """A reference to a declaration or to a bound variable; `kind` says which table the checker found it in."""

    name: str
    kind: Literal["param", "region", "grid", "group", "entity", "role", "mode", "local", "clock"]


class Index(Node, frozen=True):
    """One member of a group, counted from 1: `uav[i]`."""

    base: Expr
    index: Expr


class Attr(Node, frozen=True):
    """A field of a record, an entity or a region: `r.position`."""

    base: Expr
    name: str


class Point(Node, frozen=True):
    """Two or three lengths in the mission's frame: east, north and (optionally) elevation in metres."""

    items: tuple[Expr, ...]


class Sequence(Node, frozen=True):
    """A bracketed list."""

    items: tuple[Expr, ...]


class Range(Node, frozen=True):
    """An inclusive interval `low..high`."""

    low: Expr
    high: Expr


class Call(Node, frozen=True):
    """A built-in function, or a rule of this mission when `rule` is true. Named arguments keep their names."""

    function: str
    arguments: tuple[Expr, ...] = ()
    named: tuple[tuple[str, Expr], ...] = ()
    rule: bool = False


class Unary(Node, frozen=True):
    """`-x` or `not x`."""

    operator: Literal["-", "not"]
    operand: Expr


class Binary(Node, frozen=True):
    """Arithmetic, comparison, membership or logic on two operands."""

    operator: Literal["+", "-", "*", "/", "==", "!=", "<", "<=", ">", ">=", "in", "and", "or"]
    left: Expr
    right: Expr


class Quantified(Node, frozen=True):
    """`exists r: body` or `forall v in domain: body`; `domain` names a group or a message kind."""

    quantifier: Literal["exists", "forall"]
    variable: str
    domain: str
    body: Expr


class Aggregate(Node, frozen=True):
    """`sum(o.demand for o in order)`: one number over a group or a message kind.

    `count` counts the bindings for which the body, a condition, is true; of nothing `sum` and `count` are 0, `min` and
    `max` are undefined.
    """

    function: Literal["count", "sum", "min", "max"]
    variable: str
    domain: str
    body: Expr


class Draw(Node, frozen=True):
    """A seeded draw: `~ uniform(a, b)`, `~ sites(region, apart >= 80 m)`; `named` holds `apart` and the like."""

    distribution: str
    arguments: tuple[Expr, ...] = ()
    named: tuple[tuple[str, Expr], ...] = ()


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
    match expr:
        case Index(base=base, index=index):
            return base, index
        case Attr(base=base):
            return (base,)
        case Point(items=items) | Sequence(items=items):
            return items
        case Range(low=low, high=high):
            return low, high
        case Call(arguments=arguments, named=named) | Draw(arguments=arguments, named=named):
            return (*arguments, *(value for _, value in named))
        case Unary(operand=operand):
            return (operand,)
        case Binary(left=left, right=right):
            return left, right
        case Quantified(body=body) | Aggregate(body=body):
            return (body,)
    return ()


def parts(expr: Expr) -> tuple[Expr, ...]:
    """The expression and everything in it, outermost first, in the order it is read."""
    found, waiting = [], [expr]
    while waiting:
        part = waiting.pop()
        found.append(part)
        waiting.extend(reversed(children(part)))
    return tuple(found)


def leaves(expr: Expr) -> tuple[Expr, ...]:
    """What of it has no sub-expressions."""
    return tuple(part for part in parts(expr) if not children(part))


def conjuncts(expr: Expr) -> tuple[Expr, ...]:
    """What must hold each: the sides of its outermost `and`s, in order."""
    if isinstance(expr, Binary) and expr.operator == "and":
        return (*conjuncts(expr.left), *conjuncts(expr.right))
    return (expr,)


def components(condition: Expr) -> Iterator[tuple[Quantified | None, Expr]]:
    """What score and subtasks count of a condition: its conjuncts, where one is a `forall` what it asks of each member,
    together with it."""
    for part in conjuncts(condition):
        if isinstance(part, Quantified) and part.quantifier == "forall":
            yield part, part.body
        else:
            yield None, part
