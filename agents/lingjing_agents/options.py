"""`--policy-arg k=v` values: text in, checked values out; a bad one is a `UsageError` that names it."""

from __future__ import annotations

import math

from lingjing.plugins.policy import UsageError


def number(name: str, text: str, low: float = -math.inf, high: float = math.inf) -> float:
    """`text` as a finite number in [low, high]."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not low <= value <= high or math.isinf(value):
        raise UsageError(f"policy argument {name}={text}: a number is due", hint=_interval(low, high))
    return value


def whole(name: str, text: str, low: int, high: int) -> int:
    """`text` as an integer in [low, high]."""
    value = number(name, text, low, high)
    if value != int(value):
        raise UsageError(f"policy argument {name}={text}: a whole number is due", hint=_interval(low, high))
    return int(value)


def choice(name: str, text: str, allowed: tuple[str, ...]) -> str:
    """`text` if it is one of `allowed`."""
    if text not in allowed:
        raise UsageError(f"policy argument {name}={text} is not known", hint=f"one of {', '.join(allowed)}")
    return text


def _interval(low: float, high: float) -> str:
    if math.isinf(low) and math.isinf(high):
        return "any finite number"
    return f"from {low:g}" if math.isinf(high) else f"from {low:g} to {high:g}"
