"""The content of a `resetScenario` document's mission that neither the document nor a note declares.

`silent_guesses` reads the document again, by rules of its own: the place of each entity and hidden thing that was
placed (east = X/100, north = -Y/100, elevation = Z/100 m, or all in metres where a note tells so, or degrees on the
scene's origin), its heading (`heading`, `raw`, or 90 degrees more than `yaw`; a `raw` of 0 beside `yaw` is a
placeholder), how many of each list are played, and that the document written back reads as the same mission.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import msgspec

from lingjing.errors import LingjingError
from lingjing.mission import expression as ex
from lingjing.mission import frames
from lingjing.mission.model import Group, Mission
from lingjing.mission.reset.emit import emit
from lingjing.mission.reset.groups import origin_of
from lingjing.mission.reset.reading import instantiate_document
from lingjing.mission.reset.shapes import LISTS, fold_key

EAST, NORTH = ("x",), ("y",)
LONGITUDE, LATITUDE = ("lon", "lng", "long", "longitude", "经度"), ("lat", "latitude", "纬度")
ALTITUDE = ("alt", "altitude", "海拔")
UNSAID = (None, "", [], {})
"""Values that count as absent: another spelling of the key is used instead (`docs/reset-scenario.md`)."""
SAME_M = 0.001
GuessedRow = Mapping[str, Any]


def silent_guesses(
    text: str, mission: Mission, notes: Sequence[str], templates: Callable[[str], Mission]
) -> Iterator[str]:
    """Yield the content of the mission that neither the document nor a note declares."""
    whole = json.loads(text)
    groups = {group.name: group for group in mission.groups}
    origin = origin_of(mission)
    unit_m = 1.0 if _in_metres(whole, notes) else 0.01
    planar = any("lon and lat are read as X and Y in metres" in note for note in notes)
    raised: set[float] = set()
    for member, path in mission.origin.places.items():
        row = _at(whole, path.removesuffix(".data"))
        place = _place(row)
        if place is None:
            if groups[member.partition("[")[0]].engine != "satellite":
                yield f"{path} says no place of {member}"
            continue
        yield from (f"{path} says two things of {name}" for name in _ambiguous(place))
        played = _value(groups, member, "position")
        stated = _said(place, origin, unit_m, planar=planar)
        if stated is None or played is None or max(abs(a - b) for a, b in zip(stated, played, strict=False)) > SAME_M:
            yield f"{path} says {stated}, {member} lies at {played}"
        heights = [height for height in (_first(place, ("z",)), _first(place, ALTITUDE)) if height is not None]
        if len(heights) == 1 and played is not None:
            metres = heights[0] * (1.0 if _first(place, ("z",)) is None else unit_m)
            raised.add(round(metres - (played[2] if len(played) > 2 else math.inf), 3))
        turn, turned = _turn(row, place), _value(groups, member, "heading_deg")
        if turn is not None and (turned is None or abs((turn - turned + 180.0) % 360.0 - 180.0) > SAME_M):
            yield f"{path} turns to {turn}, {member} to {turned}"
    moved = "datum_m" in text or any("heights begin at" in note or "heights of Z" in note for note in notes)
    if len(raised) > 1 + any("heights of Z" in note for note in notes) or (raised - {0.0} and not moved):
        yield f"heights are lowered by {sorted(raised)[:4]} m"
    yield from _uncounted(whole, mission, notes)
    yield from _changed(mission, templates)


def _changed(mission: Mission, templates: Callable[[str], Mission]) -> Iterator[str]:
    """Return whether the document written back reads as another mission."""
    try:
        again, _ = instantiate_document(emit(mission), "m.json", templates)
    except LingjingError as error:
        yield f"is refused when it is written back: {error}"
    else:
        if msgspec.structs.replace(again, origin=mission.origin) != mission:
            yield "reads as another mission when it is written back"


def _uncounted(whole: Any, mission: Mission, notes: Sequence[str]) -> Iterator[str]:
    """Yield the lists with another number of played entities than listed ones, without a note."""
    lists = _get(_get(whole, "data") or whole, "equipmentList") or _get(_get(whole, "scenario"), "equipmentList")
    names = {fold_key(each.name) for each in LISTS}
    for name, rows in lists.items() if isinstance(lists, dict) else ():
        listed = len(rows) if isinstance(rows, list) else 1
        if fold_key(name) not in names or not rows:
            continue
        played = sum(f".{name}[" in path for path in mission.origin.places.values())
        if listed != played and not any(f".{name}: " in note and "not played" in note for note in notes):
            yield f"{name} lists {listed}, {played} are played"


# -- the document by rules of its own --------------------------------------------------------------------------------


def _at(value: Any, path: str) -> Any:
    """Return the value at a JSON path; a single object may stand for a list."""
    for part in re.findall(r"[^.\[\]]+", path.removeprefix("$")):
        if isinstance(value, list):
            value = value[int(part)]
        elif part in value:
            value = value[part]
    return value


def _get(holder: Any, key: str) -> Any:
    """Return the value of a key in any letter case."""
    if not isinstance(holder, dict):
        return None
    return next(
        (value for name, value in holder.items() if fold_key(name) == fold_key(key) and value not in UNSAID), None
    )


def _first(holder: GuessedRow, names: Sequence[str]) -> float | None:
    return next((value for name in names if (value := _get(holder, name)) is not None), None)


def _place(row: Any) -> GuessedRow | None:
    """Return the object with the coordinates of an entity or a hidden thing."""
    for holder in (_get(row, "data"), _get(row, "position"), row):
        if isinstance(holder, dict) and any(
            all(_first(holder, name) is not None for name in pair) for pair in ((EAST, NORTH), (LONGITUDE, LATITUDE))
        ):
            return holder
    return None


def _ambiguous(place: GuessedRow) -> Iterator[str]:
    """Yield the coordinates with several spellings and different values."""
    for names in (EAST, NORTH, LONGITUDE, LATITUDE, ALTITUDE):
        values = [value for key, value in place.items() if fold_key(key) in names and value not in UNSAID]
        if any(value != values[0] for value in values):
            yield names[0]


def _in_metres(whole: Any, notes: Sequence[str]) -> bool:
    """Return whether X, Y and Z are metres, by the `lingjing` object, a coordinate system or a note."""
    scenario = _get(_get(whole, "data") or whole, "scenario") or _get(whole, "scenario") or whole
    unit = _get(_get(scenario, "lingjing"), "unit")
    if unit is not None:
        return bool(unit == "m")
    return any("are read as metres" in note for note in notes) or '_m"' in json.dumps(
        [_get(row, "coordinate_system") for row in _rows(scenario)]
    )


def _rows(scenario: Any) -> list[Any]:
    """Return the scenario, its tasks and their initial states."""
    tasks = _get(scenario, "taskMatrix")
    listed = tasks if isinstance(tasks, list) else [tasks]
    return [scenario, *listed, *(_get(task, "initial_state") for task in listed)]


def _said(place: GuessedRow, origin: tuple[float, float], unit_m: float, *, planar: bool) -> tuple[float, float] | None:
    """Return east and north in metres; None if one is no number."""
    x, y, longitude, latitude = (_first(place, names) for names in (EAST, NORTH, LONGITUDE, LATITUDE))
    pair = (latitude, longitude) if x is None or y is None else (x, y)
    if not all(
        isinstance(number, int | float) and not isinstance(number, bool) and abs(number) < math.inf for number in pair
    ):
        return None
    if x is None or y is None:
        if planar:
            return longitude, -(latitude or 0.0)
        return frames.from_geodetic(latitude or 0.0, longitude or 0.0, origin)
    return x * unit_m, -y * unit_m


def _turn(row: GuessedRow, place: GuessedRow) -> float | None:
    """Return the compass heading in degrees."""
    yaw = _first(row, ("yaw",))
    yaw = _first(place, ("yaw",)) if yaw is None else yaw
    raw, turned = _first(row, ("raw",)), None if yaw is None else yaw + 90.0
    angles = (_first(row, ("heading",)), *((turned, raw) if raw == 0 else (raw, turned)))
    return next((angle for angle in angles if angle is not None), None)


def _value(groups: Mapping[str, Group], member: str, name: str) -> Any:
    """Return the fixed value of a member's property, places as numbers; None without one."""
    stem, _, index = member.rstrip("]").partition("[")
    value = next((field.value for field in groups[stem].properties if field.name == name), None)
    if isinstance(value, ex.Call) and isinstance(value.arguments[1], ex.Sequence):
        value = value.arguments[1].items[int(index) - 1]
    if isinstance(value, ex.Point):
        return tuple(item.value for item in value.items if isinstance(item, ex.Number))
    return value.value if isinstance(value, ex.Number) else None
