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

_BOUNDS = {"ge": "at least", "gt": "more than", "le": "at most", "lt": "less than"}
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
    due = DUE.get(kind) or next((words for start, words in DUE.items() if kind.startswith(f"{start}_")), "")
    if due and not kind.startswith("string_too"):
        return f"is {shown(given)}, {due} is due"
    for bound, words in _BOUNDS.items():
        if bound in context:
            return f"is {shown(given)}, {words} {_number(context[bound])} is due"
    message = str(found["msg"]).removeprefix("Value error, ")
    return message[:1].lower() + message[1:]


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
    return f"{value:,.15g}".replace(",", "") if isinstance(value, int | float) else str(value)


__all__ = ["DUE", "shown", "worded"]
