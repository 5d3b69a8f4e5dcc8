"""Parsing of option values: `name=value` pairs, seeds and ranges, numbers with a unit."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from functools import partial

from lingjing.errors import ErrorCollector, Fault, UsageError, hint_of
from lingjing.mission.model import Mission
from lingjing.mission.settings import read_setting
from lingjing.mission.tiers import HIGHEST

MOST_SEEDS = 100_000
"""Seeds in a range, at most; a longer range is a typing error. Chosen."""

MOST_SEED = 2**63 - 1
"""The greatest seed: seeds are stored as signed 64-bit numbers."""


def parse_pairs(
    option: str, texts: Iterable[str], errors: ErrorCollector | None = None, field: str = ""
) -> dict[str, str]:
    """Return `["k=v", …]` as a mapping. Raises `UsageError` for a missing `=`, an empty name or a repeated name.

    With `errors` nothing is raised: errors are added to this collector, located at `field` of the option file, and the
    valid pairs are returned.
    """
    pairs: dict[str, str] = {}
    collector = ErrorCollector() if errors is None else errors
    for text in texts:
        name, equals, value = text.partition("=")
        name = name.strip()
        if not equals or not name:
            collector.add(_fault(field, f"{option} {text}: expected name=value", f"for example: {option} name=value"))
        elif name in pairs:
            collector.add(_fault(field, f"{option} {text}: `{name}` is given twice"))
        else:
            pairs[name] = value.strip()
    if errors is None:
        collector.check()
    return pairs


def parse_seeds(text: str) -> tuple[int, ...]:
    """Return the seeds of `"3"` or `"0-19"` (both ends included) in ascending order. Raises `UsageError`."""
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
    """Return a seed, a whole number from 0 to 2**63 - 1. Raises `UsageError`."""
    seed = whole_number(text, MOST_SEED)
    if seed is None:
        raise UsageError(f"`{text}` is not a seed", hint="a seed is a whole number from 0, a range is written 0-19")
    return seed


def whole_number(text: str, most: int) -> int | None:
    """Return the number that a text of ASCII digits writes, or None unless it is from 0 to `most` (below 10**19).

    Texts of any length are safe: at most 19 digits after leading zeros are converted.
    """
    digits = re.fullmatch(r"0*([0-9]{1,19})", text)
    number = most + 1 if digits is None else int(digits[1])
    return number if number <= most else None


def parse_whole(option: str, text: str, most: int) -> int:
    """Return a whole number from 0 to `most`. Raises `UsageError`."""
    number = whole_number(text, most)
    if number is None:
        raise UsageError(f"{option} {text} is not a whole number from 0 to {most}")
    return number


def check_counts(*counts: tuple[str, int | None]) -> None:
    """Raise `UsageError` for a count below 1. `counts` are pairs of option and number, None if not set."""
    for option, number in counts:
        if number is not None and number < 1:
            raise UsageError(f"{option} {number}: must be at least 1")


def parse_amount(option: str, text: str | None, *, whole: bool = False) -> float | int | None:
    """Return a number above 0, whole if `whole` is set, or None if `text` is None. Raises `UsageError`."""
    if text is None:
        return None
    kind = r"[0-9]{1,15}" if whole else r"[0-9]{1,12}(\.[0-9]{1,12})?|\.[0-9]{1,12}"
    if not re.fullmatch(kind, text, re.ASCII) or not float(text) > 0:
        raise UsageError(f"{option} {text} is not a {'whole ' * whole}number above 0")
    return int(text) if whole else float(text)


def parse_tier(text: str) -> int:
    """Return the tier of `--tier`. Raises `UsageError` if the text is no tier."""
    if not re.fullmatch(r"[0-9]{1,3}", text, re.ASCII) or int(text) > HIGHEST:
        raise _fault("tier", f"--tier {text}: there is no such tier", f"tiers are 0 to {HIGHEST}")
    return int(text)


def parse_settings(
    pairs: Mapping[str, str], mission: Mission | None, errors: ErrorCollector | None = None
) -> dict[str, float]:
    """Return the values of `--set` in SI units: `80`, `80 m` or `0.08 km`. Raises `UsageError` for a wrong number or
    unit.

    With `errors` nothing is raised: errors are added to this collector, and the valid values are returned. Without a
    mission every unit is accepted.
    """
    collector = ErrorCollector() if errors is None else errors

    def read(name: str, text: str) -> float:
        try:
            return read_setting(mission, name, text)
        except UsageError as error:
            raise _fault(f"settings.{name}", f"--set {name}={text}: {error}", hint_of(error)) from None

    values = {name: collector.attempt(partial(read, name, text), None) for name, text in pairs.items()}
    if errors is None:
        collector.check()
    return {name: value for name, value in values.items() if value is not None}


def _fault(where: str, message: str, hint: str = "") -> UsageError:
    return UsageError(message, hint=hint, faults=(Fault(where, message, hint),))
