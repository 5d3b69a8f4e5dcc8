"""Fill the holes of goals and prompts: `Fly at {altitude}.` becomes `Fly at 100 m`; and say values in words.

What a hole may name is checked by `lingjing.dsl.checking.wording`. Numbers are shown in the author's unit, positions as
`(east, north)` in metres, a group as the ids of its members, a region as its corners, a grid as its cells' names.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence

from lingjing.mission.instance import Datum, Entity
from lingjing.mission.units import field_named, unit_behind

HOLE = re.compile(r"\{\{|\}\}|\{([^{}\n]*)\}")
"""A doubled brace, or a hole with its inside as group 1."""
PATH = re.compile(r"\s*(?P<name>[^\W\d]\w*)(?:\[\s*(?P<index>\w+)\s*\])?(?:\.(?P<field>[^\W\d]\w*))?\s*")


def fill(text: str, look_up: Callable[[str, str | None, str | None], str | None]) -> str:
    """The text with its holes filled. `look_up(name, index, field)` gives what stands there; None leaves the hole."""
    if "{" not in text and "}" not in text:
        return text

    def put(hole: re.Match[str]) -> str:
        if hole[1] is None:
            return hole[0][0]
        path = PATH.fullmatch(hole[1])
        found = look_up(path["name"], path["index"], path["field"]) if path else None
        return hole[0] if found is None else found

    return HOLE.sub(put, text)


def some(words: Sequence[str], most: int = 6) -> str:
    """`a, b, c and 12 more`: the first of many."""
    rest = len(words) - most
    return ", ".join(words) if rest <= 0 else f"{', '.join(words[:most])} and {rest} more"


def shown_number(value: float, unit: str = "", factor: float = 1.0) -> str:
    """`100 m`: a number in SI in the unit it is shown in, of which one is `factor` SI units."""
    amount = value / factor
    text = f"{round(amount, 6):g}" if math.isfinite(amount) else str(amount)
    return f"{text} {unit}" if unit else text


def shown_point(place: tuple[float, ...]) -> str:
    """`(12.4, -1351.8)`: east and north in metres."""
    return f"({place[0]:g}, {place[1]:g})"


def shown_field(entity: Entity, field: str) -> str | None:
    """What a public field of an entity says; None if it has none of that name."""
    if field == "position":
        return shown_point(entity.position)
    if field == "heading":
        return shown_number(entity.heading_deg, "deg")
    known = entity.properties
    if (stored := field_named(field, known)) is not None:
        return shown_datum(known[stored], unit_behind(field, stored))
    low, high = field_named(f"{field}_low", known), field_named(f"{field}_high", known)
    if low is None or high is None:
        return None
    return f"{shown_datum(known[low])} to {shown_datum(known[high], unit_behind(f'{field}_high', high))}"


def shown_datum(value: Datum, unit: str = "") -> str:
    """A property's value in words."""
    match value:
        case bool():
            return "true" if value else "false"
        case int() | float():
            return shown_number(float(value), unit)
        case tuple():
            return ", ".join(shown_datum(item, unit) for item in value)
    return str(value)
