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


_COUNTED = {"ticks": "count of ticks", "tokens": "count of tokens", "money": "sum of money"}
"""Names of dimensions that are no nouns for one quantity."""


def dimension_of(given: Type) -> Dimension:
    """The dimension of a quantity whose dimension is known."""
    return given.dimension or NONE


def word(given: Type) -> str:
    """A type as a noun: `length`, `bare number`, `range of lengths`, `position`."""
    if given.kind == "quantity":
        if given.dimension is None:
            return "quantity"
        name = "bare number" if given.dimension == NONE else dimension_name(given.dimension)
        return _COUNTED.get(name, name)
    if given.kind == "range" and given.dimension is not None:
        return "range of numbers" if given.dimension == NONE else f"range of {dimension_name(given.dimension)}s"
    if given.kind == "list":
        return f"list of {given.item}s" if given.item else "list"
    if given.kind == "name" and given.of == "type":
        return "type's name"
    if given.kind == "name" and given.of == "mode":
        return "mode"
    if given.kind == "message" and given.of:
        return f"`{given.of}` message"
    if given.kind == "entity" and given.of:
        return f"`{given.of}` entity"
    if given.kind == "group" and given.of:
        return f"group (`{given.of}`)"
    return _WORDS.get(given.kind, given.kind)


def with_article(given: Type) -> str:
    """`a length`, `an angle`."""
    noun = word(given)
    return f"an {noun}" if noun.lstrip("`")[:1] in "aeiou" else f"a {noun}"


def of_type(given: Type, of: str) -> Type:
    """The same kind, narrowed."""
    return Type(given.kind, given.dimension, given.item, of)


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
