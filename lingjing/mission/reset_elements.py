"""Two-line elements of satellites: the keys they stand under in a `resetScenario`, and what is wrong with a pair."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from lingjing.mission.elements import line_fault

KEYS = {
    **dict.fromkeys(("tle1", "tleline1", "line1"), "tle1"),
    **dict.fromkeys(("tle2", "tleline2", "line2"), "tle2"),
    **dict.fromkeys(("tle", "tlelines"), "tle"),
}
"""Spellings of the keys, without underscores and in lower case."""


def lifted(row: dict[str, Any]) -> None:
    """Put the element lines of one satellite under `tle1`, `tle2` or `tle` (in place).

    They may also stand inside of its `data`, or in an object under `tle`.
    """
    for holder in [value for value in row.values() if isinstance(value, dict)]:
        _lift(holder, row)
    _lift(row, row)


def _lift(holder: dict[str, Any], row: dict[str, Any]) -> None:
    for key in list(holder):
        name = KEYS.get(key.replace("_", "").casefold())
        if name == "tle" and isinstance(holder[key], dict):
            if not holder[key]:
                del holder[key]
        elif name and name not in row:
            row[name] = holder.pop(key)


def elements_fault(lines: Sequence[str]) -> str:
    """What is wrong with a pair of element lines, or ""."""
    if len(lines) != 2:
        return f"has {len(lines)} line of elements, not two"
    for number, line in enumerate(lines, start=1):
        fault, _ = line_fault(number, line)
        if fault:
            return f"line {number} of its elements {fault}"
    return ""
