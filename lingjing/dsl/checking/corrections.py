"""Corrections of values of the wrong kind: how the same is written in the language.

Each function looks at the syntax of a faulty value and gives the right text, or None if it recognises nothing.
"""

from __future__ import annotations

from lingjing.dsl.source.text import SourceText
from lingjing.dsl.syntax import tree as s
from lingjing.mission.functions import Type
from lingjing.mission.units import NONE, dimension_unit, unit_of
from lingjing.patterns import pattern

_QUANTITY = pattern(r"-?\d+(?:\.\d+)?(?:[eE][+-]?\d+)?(?:[ \t]*(?P<unit>[^\W\d_%°][^\s\d]*|[%°]))?")
_TEXTUAL = ("name", "status", "flag", "interaction", "entity", "group", "region")
"""Kinds of values that a text in quotes may have been meant as."""


def correction(node: s.SyntaxNode, due: Type, source: SourceText) -> tuple[str, bool] | None:
    """The right text of a value where `due` is required, and True if it is certain."""
    if isinstance(node, s.TextLiteral):
        return _unquoted(node, due)
    if due.kind == "position" and isinstance(node, s.List) and len(node.items) in (2, 3):
        inside = source.text[node.start + 1 : node.end - 1].strip()
        return f"({inside})", False
    if due.kind == "range":
        written = range_of(node, source)
        return None if written is None else (written, False)
    return None


def _unquoted(node: s.TextLiteral, due: Type) -> tuple[str, bool] | None:
    text = node.value.strip()
    if due.kind in ("quantity", "range"):
        quantity = _QUANTITY.fullmatch(text)
        if quantity is None:
            return None
        unit = unit_of(quantity["unit"]) if quantity["unit"] else None
        known = not quantity["unit"] or unit is not None
        fitting = due.dimension is None or (unit.dimension if unit is not None else NONE) == due.dimension
        return (text, True) if known and fitting and due.kind == "quantity" else None
    if due.kind in _TEXTUAL and text.isidentifier():
        return text, True
    return None


def range_of(node: s.SyntaxNode, source: SourceText) -> str | None:
    """`1..4` for `1-4`, `[1, 4]` and `1 to 4`."""
    ends: tuple[s.Expression, ...] = ()
    if isinstance(node, s.BinaryExpr) and node.operator in ("-", "to", "by"):
        ends = (node.left, node.right)
    elif isinstance(node, s.List | s.Tuple) and len(node.items) == 2:
        ends = node.items
    elif isinstance(node, s.CallExpr) and node.function.text == "range" and len(node.arguments) == 2:
        ends = tuple(argument.value for argument in node.arguments)
    if len(ends) != 2 or not all(isinstance(end, s.NumberLiteral) for end in ends):
        return None
    return "..".join(source.text[end.start : end.end] for end in ends)


def size_of(node: s.Expression, source: SourceText) -> str | None:
    """`3 by 4` for `3 * 4`, `(3, 4)` and `[3, 4]`."""
    parts: tuple[s.Expression, ...] = ()
    if isinstance(node, s.BinaryExpr) and node.operator in ("*", "..", "to"):
        parts = (node.left, node.right)
    elif isinstance(node, s.List | s.Tuple) and len(node.items) == 2:
        parts = node.items
    return " by ".join(source.text[part.start : part.end] for part in parts) if len(parts) == 2 else None


def with_units(node: s.Tuple, due: Type) -> tuple[tuple[int, int, str], ...]:
    """The edits that give a point's bare numbers their unit; none if not all coordinates are bare numbers."""
    bare = [item for item in node.items if _is_bare(item)]
    unit = dimension_unit(due.dimension or NONE)
    return tuple((item.end, item.end, f" {unit}") for item in bare) if len(bare) == len(node.items) else ()


def _is_bare(node: s.Expression) -> bool:
    number = node.operand if isinstance(node, s.UnaryExpr) and node.operator == "-" else node
    return isinstance(number, s.NumberLiteral) and not number.unit
