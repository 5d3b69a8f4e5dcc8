"""Spellings of coordinates in a `resetScenario`: `longitude`, `lng`, `Lat` and their like, under one name.

Degrees can be nothing else, so their spellings are read, with a note. `x` and `y` in lower case may be metres or
centimetres, and left- or right-handed: what they mean is never guessed, and `lower_case` tells why they are refused.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

KEYS = {
    **dict.fromkeys(("lon", "lng", "long", "longitude", "经度"), "lon"),
    **dict.fromkeys(("lat", "latitude", "纬度"), "lat"),
    **dict.fromkeys(("alt", "altitude", "海拔"), "alt"),
}
"""Spellings of the keys, in lower case. A `height` is over the ground as often as over the sea: it is none of them."""

_ROW = re.compile(r"\[\d+\](?!\.initial_state)")
"""The index of a list's entry; the task matrix keeps its own, for its first row is the one that is played."""


def unify(root: object, notes: list[str]) -> object:
    """Put the degrees of all places under `lon`, `lat` and `alt` (in place), with one note for each list and spelling.

    An object is a place if it has a longitude and a latitude, and neither of them under its own name already.
    """
    for where, holder in _objects(root):
        found = {name: key for key in holder if (name := KEYS.get(key.casefold()))}
        if {"lon", "lat"} <= found.keys() and not {"lon", "lat"} <= holder.keys():
            renamed = {key: name for name, key in found.items() if name not in holder}
            for key, name in renamed.items():
                holder[name] = holder.pop(key)
            spelt, read = ", ".join(f"'{key}'" for key in renamed), ", ".join(renamed.values())
            note = f"{_ROW.sub('[]', where)}: {spelt} read as {read}"
            if note not in notes:
                notes.append(note)
    return root


def lower_case(root: object, where: str) -> bool:
    """Whether the object at a JSON path spells its coordinates `x` and `y`."""
    value = root
    for part in re.findall(r"\.([^.\[]+)|\[(\d+)\]", where):
        key, index = part
        if isinstance(value, Mapping):
            value = value.get(key)
        elif isinstance(value, list) and index:
            value = value[int(index)]
    inner = [value, *value.values()] if isinstance(value, Mapping) else []
    return any(isinstance(one, Mapping) and {"x", "y"} <= one.keys() for one in inner)


def _objects(root: object) -> Iterator[tuple[str, dict[str, object]]]:
    """Every object and its JSON path; a loop, for documents nest deeply."""
    stack = [("$", root)]
    while stack:
        where, value = stack.pop()
        if isinstance(value, dict):
            yield where, value
            stack.extend((f"{where}.{key}", item) for key, item in reversed(value.items()))
        elif isinstance(value, list):
            stack.extend((f"{where}[{k}]", value[k]) for k in reversed(range(len(value))))
