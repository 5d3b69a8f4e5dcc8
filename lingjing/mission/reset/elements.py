"""Two-line elements of satellites in a `resetScenario`: their keys, and checks of a pair of lines."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import datetime, timedelta
from typing import Any

from lingjing.mission.elements import checksum, line_fault
from lingjing.mission.reset.shapes import OrbitalElements, Satellite, fold_key, keys_of

LINES = ("tle1", "tle2", "tle")
"""The keys of element lines."""


def lift_elements(row: dict[str, Any]) -> None:
    """Move the element lines of one satellite to `tle1`, `tle2` or `tle` (in place).

    They may also be inside of its `data`, in an object under `tle`, or given as numbers: inclination, right ascension,
    argument of perigee, mean anomaly (degrees), eccentricity, mean motion (revolutions a day) and an epoch.
    """
    holders = [*(value for value in row.values() if isinstance(value, dict)), row]
    computed = next((lines for holder in holders if (lines := _from_numbers(holder))), None)
    for holder in holders:
        _lift(holder, row)
    if computed and not any(isinstance(row.get(name), str) for name in LINES):
        row["tle1"], row["tle2"] = computed
        row.pop("tle", None)


def _from_numbers(holder: Mapping[str, Any]) -> tuple[str, str] | None:
    """The two lines of elements given as numbers; None if a number is missing or invalid."""
    known = keys_of(OrbitalElements).spellings
    try:
        n = OrbitalElements.model_validate({known.get(fold_key(key), key): value for key, value in holder.items()})
        epoch = datetime.fromisoformat(str(n.epoch))
    except ValueError:
        return None
    passed = epoch - epoch.replace(month=1, day=1, hour=0, minute=0, second=0, microsecond=0)
    day = f"{epoch:%y}{passed / timedelta(days=1) + 1.0:012.8f}"
    first = f"1 00000U 00000A   {day}  .00000000  00000-0  00000-0 0  999"
    angles = f"{n.inclination:8.4f} {n.raan:8.4f} {min(round(n.eccentricity * 1e7), 9_999_999):07d}"
    second = f"2 00000 {angles} {n.arg_perigee:8.4f} {n.mean_anomaly:8.4f} {n.mean_motion:11.8f}    0"
    return first + checksum(first), second + checksum(second)


def _lift(holder: dict[str, Any], row: dict[str, Any]) -> None:
    for key in list(holder):
        name = keys_of(Satellite).spellings.get(fold_key(key))
        if name not in LINES:
            continue
        if name == "tle" and isinstance(holder[key], dict):
            if not holder[key]:
                del holder[key]
        elif name not in row or holder is row:
            row[name] = holder.pop(key)


def elements_fault(lines: Sequence[str]) -> str:
    """The error of a pair of element lines, or ""."""
    if len(lines) != 2:
        return f"has {len(lines)} line of elements, not two"
    for number, line in enumerate(lines, start=1):
        fault, _ = line_fault(number, line)
        if fault:
            return f"line {number} of its elements {fault}"
    return ""
