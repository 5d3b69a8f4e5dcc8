"""Goals of single UAVs: rows of the task matrix with a destination or a delivery place each.

They occur only in documents with UAVs alone and without other hidden places, because dogs and cars have other missions
for such places. A delivery point or a destination is such a goal if several rows have one; in a single row it belongs
to all UAVs. A row names its UAV by `uav_id` or by a name or code in its goal; otherwise rows and UAVs are matched in
their order. One goal for several UAVs belongs to all of them.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

from lingjing.mission.reset.document import Parsed
from lingjing.mission.reset.fields import FIELDS, HiddenEntries, field_of, is_pending
from lingjing.mission.reset.shapes import LISTS, Equipment, HiddenPlace, fold_key

GOALS = "goals"
"""The template of such documents."""

_FIELD = next(field for field in FIELDS if field.name == "goalPosition")
"""The general field of goals."""
_PLACES = (_FIELD, *(field for field in FIELDS if field.name in ("deliveryPoints", "destinationPosition")))
"""The fields that may hold a goal."""

_OWNER_KEYS = frozenset({
    "uavid", "droneid", "equipmentcode", "assignee", "uavname", "dronename", "vehicleid", "carid", "dogid", "shipid",
    "agentid", "robotid", "vehiclename", "carname", "dogname", "shipname",
})  # fmt: skip
"""Folded keys of the agent to which a row belongs."""


class _Row(NamedTuple):
    """The goal of one row of a document."""

    place: HiddenPlace
    """The goal's hidden place."""
    path: str
    """The row's JSON path."""
    goal: str
    """The row's goal, which may name a UAV."""
    owner: str
    """The row's agent, or ""."""


class RowGoals(NamedTuple):
    """The goals of UAVs."""

    hidden: HiddenEntries
    """The goals in the order of their UAVs."""
    order: tuple[int, ...]
    """Indices of UAVs in their list: first those with a goal, then the others."""


def has_row_goals(parsed: Parsed, hidden_entries: Sequence[HiddenEntries]) -> bool:
    """True if goals are the only hidden places, and UAVs the only entities or each goal names its UAV."""
    listed = {each.engine for each in LISTS if getattr(parsed.scenario.equipment_list, each.attribute)}
    if "multirotor" not in listed or not only_goals(parsed, hidden_entries):
        return False
    owners = [owner for _, _, _, owner in _entries(parsed)]
    return bool(owners) and (listed == {"multirotor"} or all(_is_drone(owner, parsed) for owner in owners))


def only_goals(parsed: Parsed, hidden_entries: Sequence[HiddenEntries]) -> bool:
    """True if goals are the only hidden places. Delivery points and destinations are goals if several rows have one."""
    full = [field.field for field in hidden_entries if field.targets]
    return all(field is _FIELD for field in full) or (
        all(field in _PLACES for field in full) and rows_with_goals(parsed) > 1
    )


def rows_with_goals(parsed: Parsed) -> int:
    """The number of rows of the task matrix with a goal."""
    return len({path.partition("]")[0] for _, path, _, _ in _entries(parsed)})


def row_goals(parsed: Parsed, hidden_entries: Sequence[HiddenEntries]) -> RowGoals | None:
    """The goals and their UAVs; None if there are none. Undecidable assignments are reported or noted."""
    drones = parsed.scenario.equipment_list.drone_entity_list
    if not drones or not only_goals(parsed, hidden_entries):
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
        parsed.notes.append(f"{parsed.at('taskMatrix')}: no goal belongs to {names}, which no agent commands")
    entries = tuple(row.place for _, row in ranked), tuple(row.path for _, row in ranked)
    goals = HiddenEntries(_FIELD, _FIELD.name, parsed.at("taskMatrix"), *entries)
    return RowGoals(goals, (*(owner for owner, _ in ranked), *idle))


def has_later_places(parsed: Parsed) -> bool:
    """True if a row after the first holds a hidden place."""
    return any(
        field_of(key) and isinstance(value, dict | list) and value
        for holder, _ in parsed.later_holders()
        for key, value in holder.items()
    )


def owners_of(parsed: Parsed) -> tuple[str, ...]:
    """The agents that rows name, each once."""
    holders = (*parsed.holders()[:2], *parsed.later_holders())
    named = (str(value) for holder, _ in holders for key, value in holder.items() if _names_owner(key) and value)
    return tuple(dict.fromkeys(named))


def goal_text(parsed: Parsed) -> str:
    """The goals of all rows as one text, each once."""
    texts = dict.fromkeys(row.goal for row in parsed.scenario.task_matrix if row.goal)
    return " ".join(texts)


# -- private


def _entries(parsed: Parsed) -> Iterator[tuple[Any, str, str, str]]:
    """Each goal of each row with its JSON path and the texts that may name its UAV. These are empty for a row with
    several goals. A goal without a place yet is left out."""
    rows = parsed.raw.get("taskMatrix")
    for k, row in enumerate(rows if isinstance(rows, list) else ()):
        if not isinstance(row, dict):
            continue
        where = f"{parsed.at('taskMatrix')}[{k}]"
        state = row.get("initial_state")
        inner: Mapping[str, Any] = state if isinstance(state, dict) else {}
        owner = next((str(v) for holder in (inner, row) for key, v in holder.items() if _names_owner(key)), "")
        for holder, path in ((inner, f"{where}.{parsed.spelling.key(row, 'initial_state')}"), (row, where)):
            for key, value in holder.items():
                if field_of(key) not in _PLACES:
                    continue
                if not isinstance(value, dict | list):
                    continue  # a remark, or a fault that `hidden_fields` reports
                items = value if isinstance(value, list) else [value]
                paths = [f"{path}.{key}[{j}]" for j in range(len(items))] if items is value else [f"{path}.{key}"]
                words = (str(row.get("goal", "")), owner) if len(items) == 1 else ("", "")
                for item, at in zip(items, paths, strict=True):
                    if item != {} and not (isinstance(item, dict) and is_pending(item)):
                        yield item, at, *words


def _is_drone(owner: str, parsed: Parsed) -> bool:
    drones = parsed.scenario.equipment_list.drone_entity_list
    return any(owner == word for drone in drones for word in (drone.name, drone.code) if word)


def _names_owner(key: str) -> bool:
    return fold_key(key) in _OWNER_KEYS


def _place(parsed: Parsed, item: Any, path: str) -> HiddenPlace:
    before, spelling_before = len(parsed.faults), len(parsed.spelling.faults)
    place = parsed.convert(parsed.spelling.unify(item, HiddenPlace, path), HiddenPlace, path)
    new = [*parsed.faults[before:], *parsed.spelling.faults[spelling_before:]]
    del parsed.faults[before:]  # `hidden_fields` has reported most of them
    parsed.faults.extend(fault for fault in new if fault not in parsed.faults)
    return place


def _owners(rows: Sequence[_Row], drones: Sequence[Equipment], parsed: Parsed) -> list[int] | None:
    """The index of the UAV of each row; None, with a fault, if it cannot be decided."""
    where = parsed.at("taskMatrix")
    named = [_named(row, drones) for row in rows]
    if None not in named:
        owners = [k for k in named if k is not None]
        twice = next((k for k in owners if owners.count(k) > 1), None)
        if twice is None:
            return owners
        message = f"gives '{drones[twice].name or drones[twice].code}' {owners.count(twice)} goals"
        parsed.report(where, message, "give each UAV one goal")
        return None
    extra = parsed.scenario.lingjing
    counted = extra is not None and GOALS in extra.settings
    if len(rows) == 1 and len(drones) > 1 and not counted:
        parsed.notes.append(f"{rows[0].path}: one goal for {len(drones)} UAVs: each flies there")
        return list(range(len(drones)))
    if len(rows) > len(drones):
        message = f"holds {len(rows)} goals for {len(drones)} UAVs, and nothing assigns them"
        parsed.report(where, message, 'name the UAV of each row: "uav_id" in its initial_state')
        return None
    if len(rows) < len(drones):
        parsed.notes.append(
            f"{where}: {len(rows)} goals for {len(drones)} UAVs: they are assigned to the first ones, in order"
        )
    return list(range(len(rows)))


def _named(row: _Row, drones: Sequence[Equipment]) -> int | None:
    """The index of the only UAV that a row names, or None."""
    words = [{word for word in (drone.name, drone.code) if word} for drone in drones]
    for text in (row.owner, row.goal):
        fitting = [k for k, names in enumerate(words) if any(_holds(text, name) for name in names)]
        if len(fitting) == 1:
            return fitting[0]
    return None


def _holds(text: str, name: str) -> bool:
    return re.search(rf"(?<![0-9A-Za-z_]){re.escape(name)}(?![0-9A-Za-z_])", text) is not None
