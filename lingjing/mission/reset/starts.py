"""Where bodies begin as the initial state repeats it (`uav_start_position`, `car_start_positions`).

The lists of entities place bodies. A repeated place that agrees with one of them says nothing new; one that agrees with
none is noted, for a reader of the initial state alone would put the body elsewhere.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from lingjing.mission.reset.document import Parsed
from lingjing.mission.reset.shapes import LISTS, Coordinates, Equipment, folded

_ENDINGS = ("startposition", "startpositions", "startpoint", "startpoints", "起始位置", "起点")
_ENGINES = {
    "uav": "multirotor", "drone": "multirotor", "无人机": "multirotor", "dog": "quadruped", "机器狗": "quadruped",
    "car": "road", "vehicle": "road", "truck": "road", "van": "road", "无人车": "road", "ship": "vessel",
    "boat": "vessel", "plane": "plane",
}  # fmt: skip
"""Which bodies a key speaks of, by the word in it; without one of them, of any."""

_AXES = {"x": "x", "y": "y", "lon": "lon", "lng": "lon", "longitude": "lon", "lat": "lat", "latitude": "lat"}
_SAME = 1e-6


class _Start(NamedTuple):
    """A repeated place: its JSON path, the word for its body (a key of the object, or ""), its coordinates by axis."""

    path: str
    body: str
    place: Mapping[str, float]


def note_starts(parsed: Parsed) -> None:
    """Note every repeated place at which no listed body begins."""
    state, path = parsed.holders()[0]
    for key, value in state.items():
        word = folded(key)
        if not word.endswith(_ENDINGS) or not isinstance(value, dict | list):
            continue
        parsed.understood.add(word)
        engine = next((engine for name, engine in _ENGINES.items() if name in word), "")
        listed = [item for one in LISTS if engine in ("", one.engine) for item in _bodies(parsed, one.attribute)]
        parsed.notes.extend(
            f"{start.path}: is not where a listed body begins; the lists of entities count"
            for start in _starts(value, f"{path}.{key}")
            if start.place and not any(_begins_at(item, start.place) for item in _named(listed, start.body))
        )


def _named(listed: list[Equipment], word: str) -> list[Equipment]:
    """The bodies of that code or name; all of them where none has it."""
    return [item for item in listed if word in (item.code, item.name)] or listed


def _bodies(parsed: Parsed, attribute: str) -> tuple[Equipment, ...]:
    bodies: tuple[Equipment, ...] = getattr(parsed.scenario.equipment_list, attribute)
    return bodies


def _starts(value: dict[str, Any] | list[Any], path: str) -> Iterator[_Start]:
    """The places under a key: one object, a list of them, or one for each body."""
    if isinstance(value, list):
        yield from (_Start(f"{path}[{k}]", "", _place(one)) for k, one in enumerate(value))
    elif _place(value):
        yield _Start(path, "", _place(value))
    else:
        yield from (_Start(f"{path}.{body}", body, _place(one)) for body, one in value.items())


def _place(value: object) -> dict[str, float]:
    if not isinstance(value, dict):
        return {}
    read = {_AXES.get(folded(key), ""): number for key, number in value.items() if isinstance(number, int | float)}
    return {axis: float(number) for axis, number in read.items() if axis}


def _begins_at(item: Equipment, place: Mapping[str, float]) -> bool:
    data: Coordinates = item.data
    own = {"x": data.x, "y": data.y, "lon": data.lon, "lat": data.lat}
    given = ((own[axis], said) for axis, said in place.items())
    return all(value is not None and abs(value - said) <= _SAME for value, said in given)
