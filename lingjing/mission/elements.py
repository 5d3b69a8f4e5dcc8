"""Checks of two-line elements and epochs as texts, without the library that propagates orbits.

The format of the lines is NORAD's (Hoots and Roehrich, Spacetrack Report No. 3): 69 characters that begin with the line
number and end with a checksum. The checksum is the sum of all digits, with 1 for each minus, modulo 10.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from datetime import datetime

from lingjing.mission.instance import Datum

_LENGTH = 69
"""Characters of a line (Spacetrack Report No. 3)."""


def line_fault(number: int, line: str) -> tuple[str, str]:
    """The error of line 1 or 2 of a satellite's elements, and its hint; ("", "") if the line is correct."""
    if len(line) != _LENGTH or not line.isascii() or not line.startswith(f"{number} ") or not line[-1].isdigit():
        return (
            f"is not {_LENGTH} characters that begin with `{number} ` and end in a digit",
            f"copy the whole line into `tle{number}`, or leave `tle1` and `tle2` empty",
        )
    total = checksum(line[:-1])
    if line[-1] != total:
        return f"has the checksum {line[-1]}, its digits give {total}", "copy the line again"
    return "", ""


def checksum(line: str) -> str:
    """The checksum digit of a line. `line` holds the characters before it."""
    return str(sum(int(letter) if letter.isdigit() else letter == "-" for letter in line) % 10)


def epoch_fault(text: str) -> tuple[str, str]:
    """The error of an epoch, and its hint; ("", "") if it is a date and time in ISO 8601."""
    try:
        datetime.fromisoformat(text)
    except ValueError:
        return "is no epoch of a satellite", "write a UTC date and time such as 2026-03-20T12:00:00Z"
    return "", ""


def faults(properties: Mapping[str, Datum]) -> Iterator[tuple[str, str, str]]:
    """(property, message, hint) of each error in a satellite's texts."""
    lines = {number: str(properties.get(f"tle{number}") or "").strip() for number in (1, 2)}
    for number, line in lines.items() if any(lines.values()) else ():
        message, hint = line_fault(number, line)
        if message:
            yield f"tle{number}", f"line {number} of the elements {message}", hint
    epoch = str(properties.get("epoch") or "")
    message, hint = epoch_fault(epoch) if epoch else ("", "")
    if message:
        yield "epoch", f"`{epoch}` {message}", hint
