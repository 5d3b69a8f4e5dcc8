"""Errors of a `resetScenario` document in words, at its own JSON paths."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from pydantic import ValidationError

from lingjing.errors import Fault, MissionError
from lingjing.mission.faults import kind_of
from lingjing.mission.reset.shapes import PLACELESS, PLACES, fold_key
from lingjing.mission.reset.spelling import KeySpelling
from lingjing.validation import due_for, limit, shown

_PLACE = "give X and Y in centimetres, or lon and lat in degrees"
_PLACE_INSIDE = '"data" holds the place: ' + _PLACE
_SWAPPED = "are lon and lat swapped?"
_SCHEMA = "schemas/reset-scenario.schema.json describes the document"

_UNIT_KEYS = frozenset({"unit", "units", "lengthunit", "coordinateunit", "coordinateunits", "单位", "坐标单位"})
"""Folded keys of a unit of lengths."""
_OTHER_LENGTHS = frozenset({
    "m", "metre", "metres", "meter", "meters", "米", "mm", "millimetre", "millimetres", "millimeter", "millimeters",
    "毫米", "km", "kilometre", "kilometres", "kilometer", "kilometers", "千米", "公里", "ft", "foot", "feet", "inch",
})  # fmt: skip
"""Folded names of units other than centimetres."""

_METRES = frozenset({"m", "metre", "metres", "meter", "meters", "米"})
"""Folded names of metres."""
_UNIT_HINT = 'give X, Y and Z in centimetres, or in metres with "lingjing": {"unit": "m"}; leave other units out'


def document_error(file: str, faults: Sequence[Fault]) -> MissionError:
    """The error of an invalid document, with all its faults."""
    each = tuple(dict.fromkeys(faults))
    message = "\n".join(f"{file}: {fault.where}: {fault.message}" for fault in each)
    return MissionError(message, hint=each[0].hint, faults=each)


def faults_of(error: ValidationError, value: object, root: str, spelling: KeySpelling) -> Iterator[Fault]:
    """Every validation error, at the JSON paths of the document, one for each place."""
    reported: set[str] = set()
    for detail in error.errors(include_url=False):
        if detail["type"] == "too_short" and detail["input"]:
            continue  # it has entries, and their own faults are reported
        where, missing, holder = _path(detail["loc"], value, root, spelling)
        at = where
        if detail["type"] in ("missing", "extra_forbidden"):
            where, missing = where.rpartition(".")[0] if not missing else where, missing or where.rpartition(".")[2]
            at = f"{where}.{missing}"
        if at not in reported:
            reported.add(at)
            yield Fault(where, *_describe(detail, missing))
        if _lacks_a_place(detail["loc"][-1:], holder):
            yield Fault(where.rpartition(".")[0], f"has {PLACELESS}", _PLACE)


def foreign_lengths(root: Mapping[str, Any], path: str, *, in_metres: bool) -> Iterator[Fault]:
    """A fault for each object with lengths in another unit than that of `X`, `Y` and `Z`."""
    others, read_in = (_OTHER_LENGTHS - _METRES, "metres") if in_metres else (_OTHER_LENGTHS, "centimetres")
    stack: list[tuple[object, str]] = [(root, path)]
    while stack:
        value, where = stack.pop()
        if isinstance(value, list):
            stack.extend((item, f"{where}[{k}]") for k, item in enumerate(value))
        elif isinstance(value, Mapping):
            stack.extend((item, f"{where}.{key}") for key, item in value.items() if isinstance(item, Mapping | list))
            for key, item in value.items():
                other = isinstance(item, str) and fold_key(key) in _UNIT_KEYS and fold_key(item) in others
                if other and _holds_lengths(value):
                    yield Fault(f"{where}.{key}", f"says '{item}', and X, Y and Z are read in {read_in}", _UNIT_HINT)


def _holds_lengths(root: object) -> bool:
    stack = [root]
    while stack:
        value = stack.pop()
        if isinstance(value, list):
            stack.extend(value)
        elif isinstance(value, Mapping):
            if any(fold_key(key) in ("x", "y") for key in value):
                return True
            stack.extend(value.values())
    return False


def _lacks_a_place(key: tuple[int | str, ...], holder: object) -> bool:
    """True if a wrong coordinate belongs to a pair of which the other one is missing. pydantic checks that only for
    objects without other errors."""
    if not isinstance(holder, Mapping) or not any(key == (name,) for names in PLACES for name in names):
        return False
    elsewhere = any(holder.get(name) is not None for name in ("data", "position"))
    return not elsewhere and all(any(holder.get(name) is None for name in names) for names in PLACES)


def _path(loc: tuple[int | str, ...], value: object, root: str, spelling: KeySpelling) -> tuple[str, str, object]:
    """The JSON path of a location, the missing key ("" for none), and the object that holds the value."""
    where, holder = root, value
    for part in loc:
        holder = value
        if isinstance(value, Mapping) and isinstance(part, str):
            if part not in value:
                return where, part, holder
            where, value = f"{where}.{spelling.key(value, part)}", value[part]
        elif isinstance(value, list | tuple) and isinstance(part, int):
            if part >= len(value):
                return where, f"[{part}]", holder
            where, value = f"{where}[{part}]", value[part]
    return where, "", holder


def _describe(detail: Mapping[str, Any], key: str) -> tuple[str, str]:
    """The message and the hint of a validation error."""
    kind, value, limits = detail["type"], detail["input"], detail.get("ctx", {})
    if kind == "missing":
        return f"'{key}' is missing", _PLACE_INSIDE if key == "data" else "add the field; " + _SCHEMA
    if kind == "extra_forbidden":
        return (
            f"unknown field '{key}'",
            "the fields of 'lingjing' are mission, mode, settings, seed, origin, datum_m, unit and targets",
        )
    if kind == "value_error":
        message = str(detail["msg"]).removeprefix("Value error, ")
        way_out = _PLACE if message == PLACELESS else "leave one of them"
        return f"has {message}", way_out
    if kind == "multiple_of":
        return f"is {shown(value)}, a whole number is due", _SCHEMA
    if due := due_for(kind):
        hint = "write the number without quotes" if isinstance(value, str) and kind == "float_type" else _SCHEMA
        return f"{due} is due, this is {kind_of(value)}", hint
    if kind == "literal_error":
        return f"'{value}' is not known, {limits.get('expected', '')} is", _SCHEMA
    if kind in ("too_short", "missing_argument"):
        return "is empty", "give at least one entry"
    if bound := limit(limits):
        swapped = detail["loc"][-1:] == ("lat",) and abs(value) <= 180.0
        return f"is {shown(value)}, {bound} is due", _SWAPPED if swapped else _SCHEMA
    return detail["msg"][:1].lower() + detail["msg"][1:], _SCHEMA
