"""Options that come as text and mean something: `name=value` pairs, seed ranges, numbers with a unit."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import Any

from lingjing.errors import UsageError
from lingjing.mission.expression import Expr, Number
from lingjing.mission.model import Mission
from lingjing.mission.units import Unit, dimension_name, unit_of

_QUANTITY = re.compile(r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(\S*)", re.ASCII)

MODES = ("star", "broadcast", "single")
"""What `--mode` takes; whether the mission has it is said by the mission."""

MOST_SEEDS = 100_000
"""A range beyond this is a slip of the finger."""


def all_of(*readers: Callable[[], Any]) -> list[Any]:
    """What each of the readers gives. A `UsageError` tells the faults of all of them, a line each."""
    read, faults = [], []
    for reader in readers:
        try:
            read.append(reader())
        except UsageError as error:
            faults.append(error)
    if faults:
        hints = dict.fromkeys(fault.hint for fault in faults if fault.hint)
        raise UsageError("\n".join(map(str, faults)), hint="; ".join(hints))
    return read


def parse_pairs(option: str, texts: Iterable[str]) -> dict[str, str]:
    """`["k=v", …]` as a mapping; a missing `=`, an empty name or a repeated one is a `UsageError`."""
    pairs: dict[str, str] = {}

    def read(text: str) -> None:
        name, equals, value = text.partition("=")
        name = name.strip()
        if not equals or not name:
            raise UsageError(f"{option} {text}: expected name=value", hint=f"for example: {option} name=value")
        if name in pairs:
            raise UsageError(f"{option} {text}: `{name}` is given twice")
        pairs[name] = value.strip()

    all_of(*(partial(read, text) for text in texts))
    return pairs


def parse_seeds(text: str) -> tuple[int, ...]:
    """`"3"` or `"0-19"` (both ends included) as seeds in order."""
    first, dash, last = text.partition("-")
    if dash and not (first and last):
        raise UsageError(f"--seeds {text}: a range has two ends", hint="write it like 0-19, both ends included")
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


def parse_settings(pairs: Mapping[str, str], mission: Mission) -> dict[str, float]:
    """Values of `--set` in SI units: `80`, `80 m` or `0.08 km`; a wrong number or unit is a `UsageError`."""
    units = {parameter.name: _unit_of(parameter.default) for parameter in mission.parameters}
    return dict(
        zip(
            pairs,
            all_of(*(partial(_quantity, name, text, units.get(name)) for name, text in pairs.items())),
            strict=True,
        )
    )


def _unit_of(default: Expr) -> Unit | None:
    """The unit of a parameter whose default is a plain quantity; None where it is computed."""
    return unit_of(default.unit) if isinstance(default, Number) and default.unit else None


def _quantity(name: str, text: str, expected: Unit | None) -> float:
    match = _QUANTITY.fullmatch(text)
    value = float(match[1]) if match else math.nan
    if match is None or not math.isfinite(value):
        raise UsageError(f"--set {name}={text}: `{text}` is not a number", hint="write a number, then its unit")
    if not match[2]:
        return value
    unit = unit_of(match[2])
    if unit is None:
        raise UsageError(f"--set {name}={text}: there is no unit `{match[2]}`", hint="without a unit it is in SI units")
    if expected is not None and unit.dimension != expected.dimension:
        raise UsageError(
            f"--set {name}={text}: {dimension_name(unit.dimension)} where {dimension_name(expected.dimension)} is due"
        )
    return value * unit.factor
