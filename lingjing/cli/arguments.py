"""Options that come as text and mean something: `name=value` pairs, seed ranges, numbers with a unit."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from functools import partial

from lingjing.errors import ErrorCollector, Fault, UsageError
from lingjing.mission.model import Mission
from lingjing.mission.settings import read_setting

MOST_SEEDS = 100_000
"""A range beyond this is a slip of the finger."""

MOST_SEED = 2**63 - 1


def parse_pairs(
    option: str, texts: Iterable[str], errors: ErrorCollector | None = None, field: str = ""
) -> dict[str, str]:
    """`["k=v", …]` as a mapping; a missing `=`, an empty name or a repeated one is a `UsageError`.

    With `errors` the faults go there, said of `field` of the options, and what is left is returned.
    """
    pairs: dict[str, str] = {}
    found = ErrorCollector() if errors is None else errors
    for text in texts:
        name, equals, value = text.partition("=")
        name = name.strip()
        if not equals or not name:
            found.add(_fault(field, f"{option} {text}: expected name=value", f"for example: {option} name=value"))
        elif name in pairs:
            found.add(_fault(field, f"{option} {text}: `{name}` is given twice"))
        else:
            pairs[name] = value.strip()
    if errors is None:
        found.check()
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
    seed = whole_number(text, MOST_SEED)
    if seed is None:
        raise UsageError(f"`{text}` is not a seed", hint="a seed is a whole number from 0, a range is written 0-19")
    return seed


def whole_number(text: str, most: int) -> int | None:
    """The number from 0 to `most` (below 10**19) that a text of ASCII digits writes; None for any other text, however
    long it is."""
    digits = re.fullmatch(r"0*([0-9]{1,19})", text)
    number = most + 1 if digits is None else int(digits[1])
    return number if number <= most else None


def parse_whole(option: str, text: str, most: int) -> int:
    """A whole number from 0 to `most`. Raises `UsageError`."""
    number = whole_number(text, most)
    if number is None:
        raise UsageError(f"{option} {text}: a whole number from 0 to {most} is due")
    return number


def check_counts(*given: tuple[str, int | None]) -> None:
    """Raise `UsageError` for an option whose number is below one; None is not given."""
    for option, number in given:
        if number is not None and number < 1:
            raise UsageError(f"{option} {number}: at least one")


def parse_amount(option: str, text: str | None, *, whole: bool = False) -> float | int | None:
    """A number above 0, None if none is given; a whole one where a fraction means nothing. Raises `UsageError`."""
    if text is None:
        return None
    kind = r"[0-9]{1,15}" if whole else r"[0-9]{1,12}(\.[0-9]{1,12})?|\.[0-9]{1,12}"
    if not re.fullmatch(kind, text, re.ASCII) or not float(text) > 0:
        raise UsageError(f"{option} {text}: a {'whole ' * whole}number above 0 is due")
    return int(text) if whole else float(text)


def parse_settings(
    pairs: Mapping[str, str], mission: Mission | None, errors: ErrorCollector | None = None
) -> dict[str, float]:
    """Values of `--set` in SI units: `80`, `80 m` or `0.08 km`; a wrong number or unit is a `UsageError`.

    With `errors` the faults go there and what is left is returned. Without a mission every unit will do.
    """
    found = ErrorCollector() if errors is None else errors

    def read(name: str, text: str) -> float:
        try:
            return read_setting(mission, name, text)
        except UsageError as error:
            raise _fault(f"settings.{name}", f"--set {name}={text}: {error}", error.hint) from None

    values = {name: found.attempt(partial(read, name, text), None) for name, text in pairs.items()}
    if errors is None:
        found.check()
    return {name: value for name, value in values.items() if value is not None}


def _fault(where: str, message: str, hint: str = "") -> UsageError:
    return UsageError(message, hint=hint, faults=(Fault(where, message, hint),))
