"""What pydantic found wrong with a value, in plain words; shared by everything that people and programs write to.

Nothing here imports pydantic: an entry of `ValidationError.errors()` is a mapping, and only its keys are read.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

DUE = {
    "bool": "yes or no",
    "dict": "an object",
    "float": "a number",
    "frozen_set": "a list",
    "finite_number": "a finite number",
    "int": "a whole number",
    "list": "a list",
    "mapping": "an object",
    "model": "an object",
    "set": "a list",
    "string": "a text",
    "tuple": "a list",
}
"""What is due, by the first words of the error types of pydantic (`int_parsing`, `int_type`, `int_from_float`)."""

BOUNDS = {
    **dict.fromkeys(("ge", "minimum"), "at least"),
    **dict.fromkeys(("gt", "exclusiveMinimum"), "more than"),
    **dict.fromkeys(("le", "maximum"), "at most"),
    **dict.fromkeys(("lt", "exclusiveMaximum"), "less than"),
}
"""Bounds in words, by their names in pydantic and in JSON Schema."""

_SHOWN = 20
"""Letters of a given text that a message repeats; a longer one may be a secret in the wrong place."""


def worded(found: Mapping[str, Any]) -> str:
    """One entry of `ValidationError.errors()` as the end of a sentence whose subject is the value at its place."""
    kind, given, context = str(found["type"]), found["input"], found.get("ctx", {})
    if kind == "missing":
        return "is missing"
    if kind == "extra_forbidden":
        return "is not known"
    if kind in ("literal_error", "enum"):
        return f"is {shown(given)}, {context.get('expected', '')} is due"
    if kind == "string_pattern_mismatch":
        return f"is {shown(given)}, a text that matches {context['pattern']} is due"
    due = due_for(kind) or limit(context)
    if due:
        return f"is {shown(given)}, {due} is due"
    message = str(found["msg"]).removeprefix("Value error, ")
    return message[:1].lower() + message[1:]


def due_for(kind: str) -> str:
    """What is due where pydantic found an error of this type, if that is a type of value; else ""."""
    if kind.startswith("string_too"):
        return ""
    return DUE.get(kind) or next((words for start, words in DUE.items() if kind.startswith(f"{start}_")), "")


def limit(context: Mapping[str, Any]) -> str:
    """`at least 3`, of the context of pydantic's error; "" if it is about no bound."""
    return next((f"{words} {_number(context[name])}" for name, words in BOUNDS.items() if name in context), "")


def shown(value: object) -> str:
    """A value as a message repeats it: short texts in quotes, of others what they are."""
    match value:
        case None:
            return "nothing"
        case bool():
            return "yes" if value else "no"
        case str():
            return f"'{value}'" if len(value) <= _SHOWN else "a long text"
        case int() | float():
            return f"{value:g}" if abs(value) < 1e300 else "a number out of range"
        case Mapping():
            return "an object"
        case list() | tuple():
            return "a list"
    return f"a value of type {type(value).__name__}"


def _number(value: object) -> str:
    return f"{value:.15g}" if isinstance(value, float) else str(value)


__all__ = ["BOUNDS", "DUE", "due_for", "limit", "shown", "worded"]
