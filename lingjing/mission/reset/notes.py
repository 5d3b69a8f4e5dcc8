"""Notes on the unread parts of a `resetScenario`: repeated keys, repeated codes, unknown fields, repeated places.

All of them stay in the document, which the mission keeps unchanged. The lists of entities place bodies, and the initial
state may repeat their places (`uav_start_position`, `car_start_positions`). A repeated place that agrees with a list
adds nothing. One that agrees with none is noted, because the document contradicts itself.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, NamedTuple

from lingjing.mission import jsontext
from lingjing.mission.reset.document import Parsed
from lingjing.mission.reset.fields import HiddenEntries, field_of
from lingjing.mission.reset.shapes import (
    LISTS,
    Coordinates,
    DocumentPart,
    Equipment,
    InitialState,
    Scenario,
    TaskRow,
    fold_key,
)


def unread_notes(text: str, parsed: Parsed, hidden_entries: Iterable[HiddenEntries]) -> Iterator[str]:
    """Notes on repeated keys, repeated codes and unread fields, in this order."""
    yield from (f"{where}: is repeated in its object; the last one is used" for where in jsontext.repeated(text))
    yield from _codes(parsed)
    known = frozenset({"tasktype", *parsed.understood})
    equipment, state = parsed.scenario.equipment_list, parsed.task.initial_state
    if parsed.envelope is not None:
        yield from _unread([parsed.envelope], "$", known)
    yield from _unread([parsed.scenario], parsed.path, known)
    yield from _unread([equipment], parsed.lists_path, known)
    for entity_list in LISTS:
        rows = getattr(equipment, entity_list.attribute)
        yield from _unread(rows, f"{parsed.list_path(entity_list.name)}[]", known)
        yield from _unread([row.data for row in rows], f"{parsed.list_path(entity_list.name)}[].data", known)
    yield from _unread([parsed.task], parsed.task_path, known)
    yield from _unread([state], parsed.state_path, known)
    yield from _unread(state.rescue_range, f"{parsed.in_state('rescueRange')}[]", known)
    for field in hidden_entries:
        yield from _unread(field.targets, f"{field.path}[]", known)
        inner = [part for target in field.targets for part in (target.data, target.position) if part is not None]
        yield from _unread(inner, f"{field.path}[].data", known)


def _codes(parsed: Parsed) -> Iterator[str]:
    """One note for the codes that several entities of all lists share: commands name entities by their codes."""
    lists = (getattr(parsed.scenario.equipment_list, entity_list.attribute) for entity_list in LISTS)
    times = Counter(item.equipment_code for items in lists for item in items if item.equipment_code)
    shared = [f"'{code}'" for code, count in times.items() if count > 1]
    if shared:
        yield f"{parsed.lists_path}: an equipmentCode is repeated: {', '.join(shared)}"


def _unread(parts: Iterable[DocumentPart], where: str, known: frozenset[str]) -> Iterator[str]:
    """One note for all unread keys of these parts, except the `known` ones (folded), and hidden fields in
    their places."""
    unknown = dict.fromkeys(
        key
        for part in parts
        for key in part.model_extra or ()
        if fold_key(key) not in known and not (isinstance(part, Scenario | TaskRow | InitialState) and field_of(key))
    )
    if unknown:
        yield f"{where}: {', '.join(repr(key) for key in unknown)} not understood and kept"


# -- repeated start positions ----------------------------------------------------------------------------------------

_ENDINGS = ("startposition", "startpositions", "startpoint", "startpoints", "起始位置", "起点")
"""Endings of folded keys with start positions."""
_ENGINES = {
    "uav": "multirotor", "drone": "multirotor", "无人机": "multirotor", "dog": "quadruped", "机器狗": "quadruped",
    "car": "road", "vehicle": "road", "truck": "road", "van": "road", "无人车": "road", "ship": "vessel",
    "boat": "vessel", "plane": "plane",
}  # fmt: skip
"""Word in a key → engine of its bodies. A key without such a word is about all bodies."""

_AXES = {"x": "x", "y": "y", "lon": "lon", "lng": "lon", "longitude": "lon", "lat": "lat", "latitude": "lat"}
"""Folded key of a coordinate → its axis."""
_SAME = 1e-6
"""Largest difference of equal coordinates, in their own unit (chosen)."""


class _Start(NamedTuple):
    """A repeated place."""

    path: str
    """Its JSON path."""
    body: str
    """The name of its body (a key of the object), or ""."""
    place: Mapping[str, float]
    """Coordinates by axis."""


def note_starts(parsed: Parsed) -> None:
    """Note every repeated place at which no listed body begins."""
    state, path = parsed.holders()[0]
    for key, value in state.items():
        word = fold_key(key)
        if not word.endswith(_ENDINGS) or not isinstance(value, dict | list):
            continue
        parsed.understood.add(word)
        engine = next((engine for name, engine in _ENGINES.items() if name in word), "")
        listed = [
            item
            for entity_list in LISTS
            if engine in ("", entity_list.engine)
            for item in _bodies(parsed, entity_list.attribute)
        ]
        parsed.notes.extend(
            f"{start.path}: is not the place of a listed body; the lists of entities are used"
            for start in _starts(value, f"{path}.{key}")
            if start.place and not any(_begins_at(item, start.place) for item in _named(listed, start.body))
        )


def _named(listed: list[Equipment], word: str) -> list[Equipment]:
    """The bodies with that code or name; all of them if none has it."""
    return [item for item in listed if word in (item.code, item.name)] or listed


def _bodies(parsed: Parsed, attribute: str) -> tuple[Equipment, ...]:
    bodies: tuple[Equipment, ...] = getattr(parsed.scenario.equipment_list, attribute)
    return bodies


def _starts(value: dict[str, Any] | list[Any], path: str) -> Iterator[_Start]:
    """The places under a key: one object, a list of them, or one for each body."""
    if isinstance(value, list):
        yield from (_Start(f"{path}[{k}]", "", _place(item)) for k, item in enumerate(value))
    elif _place(value):
        yield _Start(path, "", _place(value))
    else:
        yield from (_Start(f"{path}.{body}", body, _place(item)) for body, item in value.items())


def _place(value: object) -> dict[str, float]:
    if not isinstance(value, dict):
        return {}
    read = {_AXES.get(fold_key(key), ""): number for key, number in value.items() if isinstance(number, int | float)}
    return {axis: float(number) for axis, number in read.items() if axis}


def _begins_at(item: Equipment, place: Mapping[str, float]) -> bool:
    data: Coordinates = item.data
    own = {"x": data.x, "y": data.y, "lon": data.lon, "lat": data.lat}
    pairs = ((own[axis], stated) for axis, stated in place.items())
    return all(value is not None and abs(value - stated) <= _SAME for value, stated in pairs)
