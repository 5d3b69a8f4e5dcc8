"""Two-line elements of satellites: the keys they stand under in a `resetScenario`, and what is wrong with a pair."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from lingjing.mission.elements import line_fault

KEYS = {
    **dict.fromkeys(("tle1", "tleline1", "line1"), "tle1"),
    **dict.fromkeys(("tle2", "tleline2", "line2"), "tle2"),
    **dict.fromkeys(("tle", "tlelines"), "tle"),
}
"""Spellings of the keys, without underscores and in lower case."""


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
        fault, _ = line_fault(number, line)
        if fault:
            return f"line {number} of its elements {fault}"
    return ""
