"""Goals that belong to one UAV each: a place in every row of the task matrix, to fly to or to deliver at.

Only documents that list UAVs alone have them here, and only where no other hidden place is given: dogs and cars have
missions of their own for such places. A delivery point or a destination is such a goal where several rows have one; in
one row it is what all UAVs share. A row names its UAV by `uav_id` or by a name or code in its goal; else rows and
UAVs go together in their order. One goal for several UAVs is everybody's.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from lingjing.mission.reset.document import Parsed
from lingjing.mission.reset.fields import FIELDS, Found, field_of, is_pending
from lingjing.mission.reset.shapes import LISTS, Equipment, HiddenPlace, folded

GOALS = "goals"
"""The template for such documents."""

FIELD = next(field for field in FIELDS if field.name == "goalPosition")
PLACES = (FIELD, *(field for field in FIELDS if field.name in ("deliveryPoints", "destinationPosition")))
"""The fields that may hold a goal."""

_OWNER_KEYS = frozenset({
    "uavid", "droneid", "equipmentcode", "assignee", "uavname", "dronename", "vehicleid", "carid", "dogid", "shipid",
    "agentid", "robotid", "vehiclename", "carname", "dogname", "shipname",
})  # fmt: skip


class _Row(NamedTuple):
    """One goal: its place, its JSON path, and the words of its row that may name its UAV."""

    place: HiddenPlace
    path: str
    goal: str
    owner: str


class RowGoals(NamedTuple):
    """The goals of UAVs. `found` holds them in the order of `order`, which are numbers of UAVs in their list: first
    those that have a goal, then the others."""

    found: Found
    order: tuple[int, ...]


def has_row_goals(parsed: Parsed, found: Sequence[Found]) -> bool:
    """True if goals are all that is hidden, and UAVs all that is listed or each goal names its UAV."""
    listed = {one.engine for one in LISTS if getattr(parsed.scenario.equipment_list, one.attribute)}
    if "multirotor" not in listed or not only_goals(parsed, found):
        return False
    owners = [owner for _, _, _, owner in _entries(parsed)]
    return bool(owners) and (listed == {"multirotor"} or all(_is_drone(owner, parsed) for owner in owners))


def only_goals(parsed: Parsed, found: Sequence[Found]) -> bool:
    """True if goals are all that is hidden; delivery points and destinations are some where several rows have one."""
    full = [one.field for one in found if one.targets]
    return all(one is FIELD for one in full) or (all(one in PLACES for one in full) and rows_with_goals(parsed) > 1)


def rows_with_goals(parsed: Parsed) -> int:
    """How many rows of the task matrix have a goal."""
    return len({path.partition("]")[0] for _, path, _, _ in _entries(parsed)})


def row_goals(parsed: Parsed, found: Sequence[Found]) -> RowGoals | None:
    """The goals and whose they are; None where there are none. What nothing tells is reported or noted."""
    drones = parsed.scenario.equipment_list.drone_entity_list
    if not drones or not only_goals(parsed, found):
        return None
    rows = [_Row(_place(parsed, item, path), path, goal, owner) for item, path, goal, owner in _entries(parsed)]
    if not rows:
        return None
    if any(row.owner for row in rows):
        parsed.understood.update(_OWNER_KEYS)
    owners = _owners(rows, drones, parsed)
    if owners is None:
        return None
    if len(owners) > len(rows):
        rows *= len(owners)
    ranked = sorted(zip(owners, rows, strict=True), key=lambda pair: pair[0])
    idle = [k for k in range(len(drones)) if k not in owners]
    if idle:
        names = ", ".join(f"'{drones[k].name or drones[k].code}'" for k in idle)
        parsed.notes.append(f"{parsed.at('taskMatrix')}: no goal is that of {names}, which nobody commands")
    entries = tuple(row.place for _, row in ranked), tuple(row.path for _, row in ranked)
    goals = Found(FIELD, FIELD.name, parsed.at("taskMatrix"), *entries)
    return RowGoals(goals, (*(owner for owner, _ in ranked), *idle))


def has_later_places(parsed: Parsed) -> bool:
    """True if a row after the first holds a hidden place."""
    return any(
        field_of(key) and isinstance(value, dict | list) and value
        for holder, _ in parsed.later_holders()
        for key, value in holder.items()
    )


def owners_of(parsed: Parsed) -> tuple[str, ...]:
    """What the rows name as whose their places are, each once."""
    holders = (*parsed.holders()[:2], *parsed.later_holders())
    named = (str(value) for holder, _ in holders for key, value in holder.items() if _names_owner(key) and value)
    return tuple(dict.fromkeys(named))


def goal_text(parsed: Parsed) -> str:
    """The goals of all rows as one text, each once."""
    texts = dict.fromkeys(row.goal for row in parsed.scenario.task_matrix if row.goal)
    return " ".join(texts)


# -- private


def _entries(parsed: Parsed) -> Iterator[tuple[Any, str, str, str]]:
    """Each goal of each row, its JSON path, and the words that may name its UAV: those of a row with several name
    none. A goal whose place comes later is left out."""
    rows = parsed.raw.get("taskMatrix")
    for k, row in enumerate(rows if isinstance(rows, list) else ()):
        if not isinstance(row, dict):
            continue
        where = f"{parsed.at('taskMatrix')}[{k}]"
        state = row.get("initial_state")
        inner: Mapping[str, Any] = state if isinstance(state, dict) else {}
        owner = next((str(v) for holder in (inner, row) for key, v in holder.items() if _names_owner(key)), "")
        for holder, path in ((inner, f"{where}.{parsed.spelt.key(row, 'initial_state')}"), (row, where)):
            for key, value in holder.items():
                if field_of(key) not in PLACES:
                    continue
                if not isinstance(value, dict | list):
                    continue  # a remark, or what the reader of hidden fields reports
                items = value if isinstance(value, list) else [value]
                paths = [f"{path}.{key}[{j}]" for j in range(len(items))] if items is value else [f"{path}.{key}"]
                words = (str(row.get("goal", "")), owner) if len(items) == 1 else ("", "")
                for item, at in zip(items, paths, strict=True):
                    if item != {} and not (isinstance(item, dict) and is_pending(item)):
                        yield item, at, *words


def _is_drone(owner: str, parsed: Parsed) -> bool:
    drones = parsed.scenario.equipment_list.drone_entity_list
    return any(owner == word for one in drones for word in (one.name, one.code) if word)


def _names_owner(key: str) -> bool:
    return folded(key) in _OWNER_KEYS


def _place(parsed: Parsed, item: Any, path: str) -> HiddenPlace:
    before, spelt_before = len(parsed.faults), len(parsed.spelt.faults)
    place = parsed.converted(parsed.spelt.unify(item, HiddenPlace, path), HiddenPlace, path)
    new = [*parsed.faults[before:], *parsed.spelt.faults[spelt_before:]]
    del parsed.faults[before:]  # the reader of hidden fields has reported most of them
    parsed.faults.extend(fault for fault in new if fault not in parsed.faults)
    return place


def _owners(rows: Sequence[_Row], drones: Sequence[Equipment], parsed: Parsed) -> list[int] | None:
    """The number of the UAV of each row; None, with a fault, where that cannot be told."""
    where = parsed.at("taskMatrix")
    named = [_named(row, drones) for row in rows]
    if None not in named:
        owners = [k for k in named if k is not None]
        twice = next((k for k in owners if owners.count(k) > 1), None)
        if twice is None:
            return owners
        said = f"gives '{drones[twice].name or drones[twice].code}' {owners.count(twice)} goals"
        parsed.report(where, said, "give each UAV one goal")
        return None
    given = parsed.scenario.lingjing
    counted = given is not None and GOALS in given.settings
    if len(rows) == 1 and len(drones) > 1 and not counted:
        parsed.notes.append(f"{rows[0].path}: one goal for {len(drones)} UAVs: each flies there")
        return list(range(len(drones)))
    if len(rows) > len(drones):
        said = f"holds {len(rows)} goals for {len(drones)} UAVs, and nothing says whose each is"
        parsed.report(where, said, 'name the UAV of each row: "uav_id" in its initial_state')
        return None
    if len(rows) < len(drones):
        parsed.notes.append(f"{where}: {len(rows)} goals for {len(drones)} UAVs: they go to the first, in order")
    return list(range(len(rows)))


def _named(row: _Row, drones: Sequence[Equipment]) -> int | None:
    """The one UAV that a row names."""
    words = [{word for word in (one.name, one.code) if word} for one in drones]
    for text in (row.owner, row.goal):
        fitting = [k for k, names in enumerate(words) if any(_holds(text, name) for name in names)]
        if len(fitting) == 1:
            return fitting[0]
    return None


def _holds(text: str, name: str) -> bool:
    return re.search(rf"(?<![0-9A-Za-z_]){re.escape(name)}(?![0-9A-Za-z_])", text) is not None
