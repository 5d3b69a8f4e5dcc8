"""Types in words, and the rules by which one type fits another."""

from __future__ import annotations

from lingjing import articles
from lingjing.mission.functions import Type
from lingjing.mission.units import NONE, Dimension, dimension_name

_WORDS = {
    "flag": "condition",
    "text": "text in quotes",
    "name": "name",
    "names": "list of names",
    "truth": "ground truth",
    "size": "size (`a by b`)",
    "directed": "speed with a direction",
    "level": "water level",
    "frame": "picture's id",
    "box": "picture box",
    "range": "range",
    "any": "value",
}


_COUNTED = {"ticks": "count of ticks", "tokens": "count of tokens", "money": "sum of money"}
"""Names of dimensions that are no nouns for one quantity."""


def dimension_of(quantity: Type) -> Dimension:
    """The dimension of a quantity; that of a bare number if it is unknown."""
    return quantity.dimension or NONE


def word(typed: Type) -> str:
    """Return the type as a noun: `length`, `bare number`, `range of lengths`, `position`."""
    if typed.kind == "quantity":
        if typed.dimension is None:
            return "quantity"
        name = "bare number" if typed.dimension == NONE else dimension_name(typed.dimension)
        return _COUNTED.get(name, name)
    if typed.kind == "range" and typed.dimension is not None:
        return "range of numbers" if typed.dimension == NONE else f"range of {dimension_name(typed.dimension)}s"
    if typed.kind == "list":
        return f"list of {typed.item}s" if typed.item else "list"
    if typed.kind == "name" and typed.of == "type":
        return "type's name"
    if typed.kind == "name" and typed.of == "mode":
        return "mode"
    if typed.kind == "name" and typed.of in ("agent", "role"):
        return typed.of
    if typed.kind == "status":
        return "status word"
    if typed.kind == "message" and typed.of:
        return f"`{typed.of}` message"
    if typed.kind == "entity" and typed.of:
        return f"`{typed.of}` entity"
    if typed.kind == "group" and typed.of:
        return f"group (`{typed.of}`)"
    return _WORDS.get(typed.kind, typed.kind)


def with_article(typed: Type) -> str:
    """Return the type as a noun with its article: `a length`, `an angle`."""
    return articles.with_article(word(typed))


def of_type(typed: Type, of: str) -> Type:
    """Return a type of the same kind, with the detail `of`."""
    return Type(typed.kind, typed.dimension, typed.item, of)


def fits(actual: Type, due: Type) -> bool:
    """True if a value of type `actual` is permitted where `due` is required."""
    if actual.kind == "any" or due.kind == "any":
        return True
    if due.kind == "position" and due.of == "entity":
        return (actual.kind == "position" and actual.of != "degrees") or actual.kind == "entity"
    if due.kind == "position" and due.of != actual.of:
        return False
    if actual.kind != due.kind:
        return False
    if due.kind in ("quantity", "range"):
        return due.dimension is None or actual.dimension == due.dimension
    if due.kind == "list":
        return due.item is None or actual.item is None or actual.item == due.item
    return not due.of or actual.of == due.of or not actual.of
