"""Types in words, and whether one fits where another is due."""

from __future__ import annotations

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


def dimension_of(type: Type) -> Dimension:
    """The dimension of a quantity whose dimension is known."""
    return type.dimension or NONE


def word(type: Type) -> str:
    """A type as a noun: `length`, `bare number`, `range of lengths`, `position`."""
    if type.kind == "quantity":
        if type.dimension is None:
            return "quantity"
        return "bare number" if type.dimension == NONE else dimension_name(type.dimension)
    if type.kind == "range" and type.dimension is not None:
        return "range of numbers" if type.dimension == NONE else f"range of {dimension_name(type.dimension)}s"
    if type.kind == "list":
        return f"list of {type.item}s" if type.item else "list"
    if type.kind == "name" and type.of == "type":
        return "type's name"
    if type.kind == "name" and type.of == "mode":
        return "mode"
    if type.kind == "message" and type.of:
        return f"`{type.of}` message"
    if type.kind == "entity" and type.of:
        return f"`{type.of}` entity"
    if type.kind == "group" and type.of:
        return f"group (`{type.of}`)"
    return _WORDS.get(type.kind, type.kind)


def with_article(type: Type) -> str:
    """`a length`, `an angle`."""
    noun = word(type)
    return f"an {noun}" if noun.lstrip("`")[:1] in "aeiou" else f"a {noun}"


def of_type(type: Type, of: str) -> Type:
    """The same kind, narrowed."""
    return Type(type.kind, type.dimension, type.item, of)


def fits(given: Type, due: Type) -> bool:
    """Whether a value of `given` may stand where `due` is due."""
    if given.kind == "any" or due.kind == "any":
        return True
    if due.kind == "position" and due.of == "entity":
        return (given.kind == "position" and given.of != "degrees") or given.kind == "entity"
    if due.kind == "position" and due.of != given.of:
        return False
    if given.kind != due.kind:
        return False
    if due.kind in ("quantity", "range"):
        return due.dimension is None or given.dimension == due.dimension
    if due.kind == "list":
        return due.item is None or given.item is None or given.item == due.item
    return not due.of or given.of == due.of or not given.of
