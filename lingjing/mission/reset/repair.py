"""A document with faults, mended so far that the rest of it is looked at in the same run. What is made of it is no
mission: its faults are told, and those that follow from the mending are not (`followed`)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from pydantic import ValidationError

from lingjing.errors import Fault
from lingjing.mission.reset.shapes import LISTS, PLACES, Data, P, folded

ROUNDS = 8
"""A mended value may show another fault; after so many rounds the document is given up."""

_MOST = 1e7
"""Coordinates beyond are not taken for a place."""

_UNION_TYPES = ("str", "int", "dict[str,any]")
"""What pydantic calls the types of a union, in a location where a document has keys."""

_DECIDING = {"scenario", "equipmentList", "taskMatrix", "initial_state", "lingjing", *(one.name for one in LISTS)}
"""What decides which template a document is for, with the task types."""


def stand_in(scenario: Mapping[str, Any]) -> dict[str, float]:
    """The coordinates of some entity, for places that are none; those of the origin if there is no entity."""
    lists = scenario.get("equipmentList")
    rows = [row for one in LISTS for row in _rows(lists.get(one.name) if isinstance(lists, Mapping) else None)]
    for row in rows:
        data = row.get("data")
        for pair in PLACES:
            given = {name: data.get(name) for name in pair} if isinstance(data, Mapping) else {}
            try:
                place: dict[str, float] = Data.model_validate(given).model_dump(by_alias=True, exclude_none=True)
            except ValidationError:
                continue
            if all(abs(one) < _MOST for one in place.values()):
                return place
    return {"X": 0.0, "Y": 0.0}


def mended(value: dict[str, Any], shape: type[P], place: Mapping[str, float]) -> tuple[P | None, bool]:
    """The value in its shape, its faults replaced in place; None where that fails. And whether what says which
    template it is for was left as it was."""
    decided = True
    for _ in range(ROUNDS):
        try:
            return shape.model_validate(value), decided
        except ValidationError as error:
            for one in error.errors(include_url=False):
                decided &= _mend(value, one["type"], one["loc"], place)
    return None, False


def followed(faults: Sequence[Fault], first: int, task: str) -> tuple[Fault, ...]:
    """The faults without those after the `first` ones that may come from the mending of the first: of the same row of
    a list, or of a list that holds one of them. `task` is the path of the task's own row, which counts for none."""
    early = [fault.where for fault in faults[:first]]
    rows = [where[: where.rfind("]") + 1] for where in early]

    def may_follow(where: str) -> bool:
        in_row = any(row not in ("", task) and where.startswith(row) for row in rows)
        return in_row or any(one == where or one.startswith(f"{where}[") for one in early)

    return (*faults[:first], *(fault for fault in faults[first:] if not may_follow(fault.where)))


def _rows(value: object) -> Iterable[Mapping[str, Any]]:
    return (row for row in value if isinstance(row, Mapping)) if isinstance(value, list) else ()


def _mend(value: Any, kind: str, location: tuple[int | str, ...], place: Mapping[str, float]) -> bool:
    """Mend one fault; whether the template is as certain as before."""
    holder: Any = value
    key: Any = ""
    for part in location:
        inside = isinstance(value, dict) and isinstance(part, str)
        if inside and part not in value:
            if part in _UNION_TYPES:
                break
            if kind != "missing":
                return True  # taken out for another of its faults
            value[part] = {"data": dict(place), "equipmentList": {}, "taskMatrix": [{}]}.get(str(part), {})
            return part not in _DECIDING
        if inside or (isinstance(value, list) and isinstance(part, int) and part < len(value)):
            holder, key, value = value, part, value[part]
    if kind == "value_error" and isinstance(value, dict):
        for name in ("data", "position", "demand"):
            value.pop(name, None)
        value.update(place)
    elif kind == "too_short" and value:
        return True  # it is only short of entries that are right
    elif kind == "too_short":
        holder[key] = [{}]
    elif isinstance(holder, list):
        holder[key] = {**place, "data": dict(place)}
    elif isinstance(holder, dict):
        holder.pop(key, None)
    return key not in _DECIDING and folded(str(key)) != "tasktype"
