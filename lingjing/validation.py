"""Faults found by pydantic, in plain words, for all values that people and programs write.

This module does not import pydantic: an entry of `ValidationError.errors()` is a mapping, and only its keys are read.
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
"""The expected value, by the first words of pydantic's error types (`int_parsing`, `int_type`, `int_from_float`)."""

BOUNDS = {
    **dict.fromkeys(("ge", "minimum"), "at least"),
    **dict.fromkeys(("gt", "exclusiveMinimum"), "more than"),
    **dict.fromkeys(("le", "maximum"), "at most"),
    **dict.fromkeys(("lt", "exclusiveMaximum"), "less than"),
}
"""Bounds in words, by their names in pydantic and in JSON Schema."""

_SHOWN = 20
"""Longest text in characters that a message repeats; a longer one may be a secret in the wrong place."""


def worded(error: Mapping[str, Any]) -> str:
    """Return one entry of `ValidationError.errors()` as the predicate of a sentence about the value."""
    kind, value, context = str(error["type"]), error["input"], error.get("ctx", {})
    if kind == "missing":
        return "is missing"
    if kind == "extra_forbidden":
        return "is not known"
    if kind in ("literal_error", "enum"):
        return f"is {shown(value)}, {context.get('expected', '')} is due"
    if kind == "string_pattern_mismatch":
        return f"is {shown(value)}, a text that matches {context['pattern']} is due"
    due = due_for(kind) or limit(context)
    if due:
        return f"is {shown(value)}, {due} is due"
    message = str(error["msg"]).removeprefix("Value error, ")
    return message[:1].lower() + message[1:]


def due_for(kind: str) -> str:
    """Return the expected value for a pydantic error type that concerns a type of value; else ""."""
    if kind.startswith("string_too"):
        return ""
    return DUE.get(kind) or next((words for start, words in DUE.items() if kind.startswith(f"{start}_")), "")


def limit(context: Mapping[str, Any]) -> str:
    """Return the bound in the context of a pydantic error, such as `at least 3`; "" without one."""
    return next((f"{words} {_number(context[name])}" for name, words in BOUNDS.items() if name in context), "")


def shown(value: object) -> str:
    """Return a value as a message quotes it: short texts in quotes, other values by their type."""
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
