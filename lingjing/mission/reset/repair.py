"""Repairs a document with faults, so that the rest of it can be checked in the same run. The result is no mission: its
faults are reported, without the consequences of the repair (`without_consequences`).
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from pydantic import ValidationError

from lingjing.errors import Fault
from lingjing.mission.reset.shapes import LISTS, PLACES, Data, P, fold_key

_ROUNDS = 8
"""A repaired value may have another fault; after this many rounds the document is given up (chosen)."""

_MOST = 1e7
"""Larger coordinates are not used as a substitute (chosen)."""

_UNION_TYPES = ("str", "int", "dict[str,any]")
"""Names of a union's types in a pydantic location, where a document has keys."""

_DECIDING = {"scenario", "equipmentList", "taskMatrix", "initial_state", "lingjing", *(each.name for each in LISTS)}
"""Keys that select the template, in addition to the task types."""


def substitute_place(scenario: Mapping[str, Any]) -> dict[str, float]:
    """The coordinates of some entity, as a substitute for invalid places; those of the origin if there is no entity."""
    lists = scenario.get("equipmentList")
    rows = [row for each in LISTS for row in _rows(lists.get(each.name) if isinstance(lists, Mapping) else None)]
    for row in rows:
        data = row.get("data")
        for pair in PLACES:
            coordinates = {name: data.get(name) for name in pair} if isinstance(data, Mapping) else {}
            try:
                place: dict[str, float] = Data.model_validate(coordinates).model_dump(by_alias=True, exclude_none=True)
            except ValidationError:
                continue
            if all(abs(coordinate) < _MOST for coordinate in place.values()):
                return place
    return {"X": 0.0, "Y": 0.0}


def repair(value: dict[str, Any], shape: type[P], place: Mapping[str, float]) -> tuple[P | None, bool]:
    """The value in its shape with its faults replaced in place, or None if that fails; and True if no repair changed a
    part that selects the template."""
    decided = True
    for _ in range(_ROUNDS):
        try:
            return shape.model_validate(value), decided
        except ValidationError as error:
            for fault in error.errors(include_url=False):
                decided &= _repair_fault(value, fault["type"], fault["loc"], place)
    return None, False


def without_consequences(faults: Sequence[Fault], first: int, task: str) -> tuple[Fault, ...]:
    """The faults without consequences of the repair: faults after the `first` ones in the same row of a list, or of a
    list that holds one of them. `task` is the path of the task's own row, which is not considered."""
    early = [fault.where for fault in faults[:first]]
    rows = [where[: where.rfind("]") + 1] for where in early]

    def may_follow(where: str) -> bool:
        in_row = any(row not in ("", task) and where.startswith(row) for row in rows)
        return in_row or any(path == where or path.startswith(f"{where}[") for path in early)

    return (*faults[:first], *(fault for fault in faults[first:] if not may_follow(fault.where)))


def _rows(value: object) -> Iterable[Mapping[str, Any]]:
    return (row for row in value if isinstance(row, Mapping)) if isinstance(value, list) else ()


def _repair_fault(value: Any, kind: str, location: tuple[int | str, ...], place: Mapping[str, float]) -> bool:
    """Repair one fault. Return True if that does not affect the selection of the template."""
    holder: Any = value
    key: Any = ""
    for part in location:
        inside = isinstance(value, dict) and isinstance(part, str)
        if inside and part not in value:
            if part in _UNION_TYPES:
                break
            if kind != "missing":
                return True  # already removed because of another fault
            value[part] = {"data": dict(place), "equipmentList": {}, "taskMatrix": [{}]}.get(str(part), {})
            return part not in _DECIDING
        if inside or (isinstance(value, list) and isinstance(part, int) and part < len(value)):
            holder, key, value = value, part, value[part]
    if kind == "value_error" and isinstance(value, dict):
        for name in ("data", "position", "demand"):
            value.pop(name, None)
        value.update(place)
    elif kind == "too_short" and value:
        return True  # its entries are present and have faults of their own
    elif kind == "too_short":
        holder[key] = [{}]
    elif isinstance(holder, list):
        holder[key] = {**place, "data": dict(place)}
    elif isinstance(holder, dict):
        holder.pop(key, None)
    return key not in _DECIDING and fold_key(str(key)) != "tasktype"
