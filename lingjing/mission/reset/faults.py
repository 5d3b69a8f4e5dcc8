"""What is wrong with a `resetScenario` document, in words, at its own JSON paths."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from pydantic import ValidationError

from lingjing.errors import Fault, MissionError
from lingjing.mission.faults import kind_of
from lingjing.mission.reset.shapes import PLACELESS, PLACES, folded
from lingjing.mission.reset.spelling import Spelt
from lingjing.validation import due_for, limit, shown

_PLACE = "give X and Y in centimetres, or lon and lat in degrees"
_PLACE_INSIDE = '"data" holds the place: ' + _PLACE
_SWAPPED = "are lon and lat swapped?"
_SCHEMA = "schemas/reset-scenario.schema.json describes the document"

_UNIT_KEYS = frozenset({"unit", "units", "lengthunit", "coordinateunit", "coordinateunits", "单位", "坐标单位"})
_OTHER_LENGTHS = frozenset({
    "m", "metre", "metres", "meter", "meters", "米", "mm", "millimetre", "millimetres", "millimeter", "millimeters",
    "毫米", "km", "kilometre", "kilometres", "kilometer", "kilometers", "千米", "公里", "ft", "foot", "feet", "inch",
})  # fmt: skip
"""Lengths that a document may say its coordinates are in, folded."""

_METRES = frozenset({"m", "metre", "metres", "meter", "meters", "米"})
_UNIT_HINT = 'give X, Y and Z in centimetres, or in metres with "lingjing": {"unit": "m"}; leave other units out'


def document_error(file: str, faults: Sequence[Fault]) -> MissionError:
    """The error of a document that is no mission, with every fault that was found."""
    each = tuple(dict.fromkeys(faults))
    said = "\n".join(f"{file}: {one.where}: {one.message}" for one in each)
    return MissionError(said, hint=each[0].hint, faults=each)


def faults_of(error: ValidationError, value: object, root: str, spelt: Spelt) -> Iterator[Fault]:
    """Every fault that validation found, at the JSON paths of the document, one for each place."""
    seen: set[str] = set()
    for one in error.errors(include_url=False):
        if one["type"] == "too_short" and one["input"]:
            continue  # there are entries, whose own faults are told
        where, missing, holder = _path(one["loc"], value, root, spelt)
        told = where
        if one["type"] in ("missing", "extra_forbidden"):
            where, missing = where.rpartition(".")[0] if not missing else where, missing or where.rpartition(".")[2]
            told = f"{where}.{missing}"
        if told not in seen:
            seen.add(told)
            yield Fault(where, *_worded(one, missing))
        if _lacks_a_place(one["loc"][-1:], holder):
            yield Fault(where.rpartition(".")[0], f"has {PLACELESS}", _PLACE)


def foreign_lengths(root: Mapping[str, Any], path: str, *, in_metres: bool) -> Iterator[Fault]:
    """A fault for each object that says its lengths are in another unit than `X`, `Y` and `Z` are read in."""
    others, read_in = (_OTHER_LENGTHS - _METRES, "metres") if in_metres else (_OTHER_LENGTHS, "centimetres")
    stack: list[tuple[object, str]] = [(root, path)]
    while stack:
        value, where = stack.pop()
        if isinstance(value, list):
            stack.extend((one, f"{where}[{k}]") for k, one in enumerate(value))
        elif isinstance(value, Mapping):
            stack.extend((one, f"{where}.{key}") for key, one in value.items() if isinstance(one, Mapping | list))
            for key, one in value.items():
                other = isinstance(one, str) and folded(key) in _UNIT_KEYS and folded(one) in others
                if other and _holds_lengths(value):
                    yield Fault(f"{where}.{key}", f"says '{one}', and X, Y and Z are read in {read_in}", _UNIT_HINT)


def _holds_lengths(root: object) -> bool:
    stack = [root]
    while stack:
        value = stack.pop()
        if isinstance(value, list):
            stack.extend(value)
        elif isinstance(value, Mapping):
            if any(folded(key) in ("x", "y") for key in value):
                return True
            stack.extend(value.values())
    return False


def _lacks_a_place(key: tuple[int | str, ...], holder: object) -> bool:
    """Whether a wrong coordinate stands beside one that is not given, which is looked for only in whole objects."""
    if not isinstance(holder, Mapping) or not any(key == (name,) for names in PLACES for name in names):
        return False
    elsewhere = any(holder.get(name) is not None for name in ("data", "position"))
    return not elsewhere and all(any(holder.get(name) is None for name in names) for names in PLACES)


def _path(loc: tuple[int | str, ...], value: object, root: str, spelt: Spelt) -> tuple[str, str, object]:
    """The JSON path of a location, the key that is not there, if it is about one, and what holds the value."""
    where, holder = root, value
    for part in loc:
        holder = value
        if isinstance(value, Mapping) and isinstance(part, str):
            if part not in value:
                return where, part, holder
            where, value = f"{where}.{spelt.key(value, part)}", value[part]
        elif isinstance(value, list | tuple) and isinstance(part, int):
            if part >= len(value):
                return where, f"[{part}]", holder
            where, value = f"{where}[{part}]", value[part]
    return where, "", holder


def _worded(one: Mapping[str, Any], key: str) -> tuple[str, str]:
    """What is wrong, and the way out."""
    kind, given, limits = one["type"], one["input"], one.get("ctx", {})
    if kind == "missing":
        return f"'{key}' is missing", _PLACE_INSIDE if key == "data" else "add the field; " + _SCHEMA
    if kind == "extra_forbidden":
        return (
            f"unknown field '{key}'",
            "the object 'lingjing' knows mission, mode, settings, seed, origin, datum_m, unit and targets",
        )
    if kind == "value_error":
        said = str(one["msg"]).removeprefix("Value error, ")
        way_out = _PLACE if said == PLACELESS else "leave one of them"
        return f"has {said}", way_out
    if kind == "multiple_of":
        return f"is {shown(given)}, a whole number is due", _SCHEMA
    if due := due_for(kind):
        hint = "write the number without quotes" if isinstance(given, str) and kind == "float_type" else _SCHEMA
        return f"{due} is due, this is {kind_of(given)}", hint
    if kind == "literal_error":
        return f"'{given}' is not known, {limits.get('expected', '')} is", _SCHEMA
    if kind in ("too_short", "missing_argument"):
        return "is empty", "give at least one entry"
    if bound := limit(limits):
        swapped = one["loc"][-1:] == ("lat",) and abs(given) <= 180.0
        return f"is {shown(given)}, {bound} is due", _SWAPPED if swapped else _SCHEMA
    return one["msg"][:1].lower() + one["msg"][1:], _SCHEMA
