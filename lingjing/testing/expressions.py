"""The nodes of expressions, for conditions and values of missions and instances that a test builds by hand."""

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
    components,
    conjuncts,
    leaves,
    parts,
)

__all__ = [
    "Aggregate", "Attr", "Binary", "Call", "Draw", "Expr", "Flag", "Index", "Number", "Point", "Quantified",
    "Range", "Ref", "Sequence", "Symbol", "Text", "Unary", "children", "components", "conjuncts", "leaves", "parts",
]  # fmt: skip
