"""Start positions that the initial state repeats (`uav_start_position`, `car_start_positions`).

The lists of entities place bodies. A repeated place that agrees with one of them adds nothing. One that agrees with
none is noted, because the document contradicts itself.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from lingjing.mission.reset.document import Parsed
from lingjing.mission.reset.shapes import LISTS, Coordinates, Equipment, fold_key

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
