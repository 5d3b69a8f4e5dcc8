"""Two-line elements of satellites: the many keys they stand under in a `resetScenario`, and what makes a line one.

The format of the lines is NORAD's (Hoots and Roehrich, Spacetrack Report No. 3): 69 characters, a line number first and
a checksum last, the sum of all digits, with 1 for each minus, modulo 10.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

KEYS = {
    **dict.fromkeys(("tle1", "tleline1", "line1"), "tle1"),
    **dict.fromkeys(("tle2", "tleline2", "line2"), "tle2"),
    **dict.fromkeys(("tle", "tlelines"), "tle"),
}
"""Spellings of the keys, without underscores and in lower case."""

LINE_LENGTH = 69


def unify(root: object) -> object:
    """Put the element lines of a document's satellites under `tle1`, `tle2` or `tle` (in place).

    They may also stand inside of a satellite's `data`, or in an object under `tle`.
    """
    for row in _satellites(root):
        for holder in [value for value in row.values() if isinstance(value, dict)]:
            _lift(holder, row)
        _lift(row, row)
    return root


def _lift(holder: dict[str, object], row: dict[str, object]) -> None:
    for key in list(holder):
        name = KEYS.get(key.replace("_", "").casefold())
        if name == "tle" and isinstance(holder[key], dict):
            if not holder[key]:
                del holder[key]
        elif name and name not in row:
            row[name] = holder.pop(key)


def _satellites(root: object) -> Iterator[dict[str, object]]:
    scenario = root.get("scenario", root) if isinstance(root, dict) else None
    equipment = scenario.get("equipmentList") if isinstance(scenario, dict) else None
    rows = equipment.get("satelliteEntityList") if isinstance(equipment, dict) else None
    yield from (row for row in (rows if isinstance(rows, list) else ()) if isinstance(row, dict))


def elements_fault(lines: Sequence[str]) -> str:
    """What is wrong with a pair of element lines, or ""."""
    if len(lines) != 2:
        return f"has {len(lines)} line of elements, not two"
    for number, line in enumerate(lines, start=1):
        if not (len(line) == LINE_LENGTH and line.isascii() and line.startswith(f"{number} ") and line[-1].isdigit()):
            return f"line {number} of its elements is not 69 characters that begin with '{number} ' and end in a digit"
        total = sum(int(c) if c.isdigit() else c == "-" for c in line[:-1]) % 10
        if total != int(line[-1]):
            return f"the checksum of line {number} of its elements is {line[-1]}, its digits give {total}"
    return ""
