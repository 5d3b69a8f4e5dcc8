"""Options that come as text and mean something: `name=value` pairs, seed ranges, numbers with a unit."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

from lingjing.errors import UsageError

MOST_SEEDS = 100_000
"""A range beyond this is a slip of the finger."""


def parse_pairs(option: str, texts: Iterable[str]) -> dict[str, str]:
    """`["k=v", …]` as a mapping; a missing `=`, an empty name or a repeated one is a `UsageError`."""
    pairs: dict[str, str] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        name = name.strip()
        if not equals or not name:
            raise UsageError(f"{option} {text}: expected name=value", hint=f"for example: {option} name=value")
        if name in pairs:
            raise UsageError(f"{option} {text}: `{name}` is given twice")
        pairs[name] = value.strip()
    return pairs


def parse_seeds(text: str) -> tuple[int, ...]:
    """`"3"` or `"0-19"` (both ends included) as seeds in order."""
    first, dash, last = text.partition("-")
    low = parse_seed(first)
    high = parse_seed(last) if dash else low
    if high < low:
        raise UsageError(f"--seeds {text}: the range runs backwards", hint=f"write --seeds {high}-{low}")
    if high - low >= MOST_SEEDS:
        raise UsageError(f"--seeds {text}: more than {MOST_SEEDS} seeds")
    return tuple(range(low, high + 1))


def parse_seed(text: str) -> int:
    """A seed: a whole number from 0 to 2**63 - 1."""
    if not (text.isascii() and text.isdigit()) or int(text) >= 2**63:
        raise UsageError(f"`{text}` is not a seed", hint="a seed is a whole number from 0, a range is written 0-19")
    return int(text)


def parse_settings(pairs: Mapping[str, str]) -> dict[str, float]:
    """Values of `--set`: a number in SI units; anything else is a `UsageError`."""
    return {name: _number(name, text) for name, text in pairs.items()}


def _number(name: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise UsageError(
            f"--set {name}={text}: `{text}` is not a number", hint="write a number in SI units, without unit"
        )
    return value
