"""The unit of `X`, `Y` and `Z` in a `resetScenario` document: Unreal's centimetres, unless it says or shows otherwise.

`lingjing.unit` settles it, then a `coordinate_system` that names a unit. Else the document's own numbers may show it:
bodies that would stand in each other as centimetres and not as metres, or heights that repeat those of `alt`. Where all
lies within a few metres as centimetres, and nothing shows which is meant, that is a fault.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import NamedTuple

from lingjing.errors import Fault
from lingjing.mission.reset.document import Parsed
from lingjing.mission.reset.shapes import LISTS, Coordinates, folded

CENTIMETRE_M = 0.01
METRE_M = 1.0

WIDEST_M = 12_000.0
"""The widest scene: places that lie farther apart are not of one."""

FARTHEST_SCENE_M = 25_000.0
"""No scene's middle lies farther from the origin (`lingjing.mission.kinds.LINE_MOST_M`)."""

LOWEST_M, HIGHEST_M = -500.0, 6_000.0
"""Heights on Earth at which things stand or such aircraft fly."""

CROWDED_M = 10.0
"""Where all that a document places lies this near to X = Y = 0, as centimetres, it may be metres."""

WIDTH_M = {"multirotor": 0.9, "quadruped": 0.32, "road": 1.8, "vessel": 2.7, "plane": 8.2}
"""The narrowest side of a body, by its engine, metres (`scenarios/std`): two that are nearer stand in each other."""

_HEIGHT_M = 1.0
"""Heights that differ by less count as the same when two spellings of them are compared."""

_CENTIMETRES = frozenset({"cm", "centimetre", "centimetres", "centimeter", "centimeters", "厘米", "公分"})
_METRES = frozenset({"m", "metre", "metres", "meter", "meters", "米"})
_NORTHWARD = frozenset({"enu", "ned", "utm", "gauss", "cgcs", "cgcs2000"})
"""Words of systems whose axes are not Unreal's: Y to the north, or X to the north."""
_GEODETIC = frozenset({"wgs84", "wgs", "epsg4326", "4326", "gcj02", "gcj", "bd09", "geodetic", "geographic", "lonlat",
                       "latlon", "lla", "经纬度"})  # fmt: skip
"""Words of systems of degrees, which X and Y are not in."""
_UNREAL = frozenset({"ue", "ue4", "ue5", "unreal", "unrealengine", "虚幻"})
SYSTEM = "coordinatesystem"
"""The key that names the coordinate system, folded."""


class _StatedSystem(NamedTuple):
    """The coordinate system that a document names: JSON path, text, its words, and the unit that these say in metres;
    0 where they say none."""

    path: str
    text: str
    words: frozenset[str]
    unit_m: float


class ListedBody(NamedTuple):
    """A listed entity: its engine, its coordinates and their JSON path."""

    engine: str
    data: Coordinates
    path: str


def bodies_of(parsed: Parsed) -> Iterator[ListedBody]:
    """What the document lists, but for what orbits."""
    for one in LISTS:
        if one.engine != "satellite":
            where = parsed.list_path(one.name)
            rows = getattr(parsed.scenario.equipment_list, one.attribute)
            yield from (ListedBody(one.engine, row.data, f"{where}[{k}].data") for k, row in enumerate(rows))


def unit_of(parsed: Parsed, places: Sequence[Coordinates]) -> float:
    """How many metres one of `X`, `Y` and `Z` is. What is inferred is noted, what cannot be is reported."""
    stated = _stated(parsed)
    if stated:
        return stated
    given = [data for data in places if data.x is not None and data.y is not None]
    if not given or not _fits_as_metres(given):
        return CENTIMETRE_M
    wide, farthest = _extent(given), _farthest(given)
    reason = _overlap(parsed)
    if not reason and farthest * CENTIMETRE_M < CROWDED_M:
        reason = _repeated_height(places)
    if reason:
        parsed.notes.append(
            f'{parsed.path}: X, Y and Z are taken for metres: {reason}; "lingjing": {{"unit": "m"}} would say'
        )
        return METRE_M
    if wide > 0.0 and farthest * CENTIMETRE_M < CROWDED_M:
        said = f"X and Y may be centimetres or metres: they lie within {wide * CENTIMETRE_M:.2g} m or {wide:g} m"
        parsed.report(parsed.path, said, '"lingjing": {"unit": "cm"} or {"unit": "m"} in the scenario says which')
    return CENTIMETRE_M


def stated_fault(parsed: Parsed, every: Sequence[Coordinates]) -> Fault | None:
    """The fault of a document whose `lingjing.unit` and `coordinate_system` differ, or whose X and Y are in a system
    with other axes than Unreal's, if they do. `lingjing.unit` settles the latter."""
    given, system = parsed.scenario.lingjing, _system(parsed)
    if given is None or given.unit is None:
        return _foreign_fault(system, every)
    if system is None or not system.unit_m:
        return None
    if system.unit_m == _unit(given.unit):
        return None
    return Fault(
        system.path, f"says {_word(system.unit_m)}, 'lingjing' {_word(_unit(given.unit))}", "leave one of them"
    )


def _foreign_fault(system: _StatedSystem | None, every: Sequence[Coordinates]) -> Fault | None:
    if system is None or all(data.x is None for data in every):
        return None
    hint = '"lingjing": {"unit": "cm"} or {"unit": "m"} in the scenario says that it is X east, Y south in that unit'
    if system.words & _NORTHWARD:
        return Fault(system.path, f"says '{system.text}', whose axes are not Unreal's (X east, Y south)", hint)
    if system.words & _GEODETIC and all(data.lon is None for data in every):
        return Fault(system.path, f"says '{system.text}', and places have X and Y: degrees are lon and lat", hint)
    return None


def note_system(parsed: Parsed) -> None:
    """Note a coordinate system that is not understood."""
    system = _system(parsed)
    if system is None:
        return
    parsed.understood.add(SYSTEM)
    if not system.unit_m and not system.words & _GEODETIC:
        parsed.notes.append(
            f"{system.path}: '{system.text}' is not understood and kept; X counts to the east and Y to the south"
        )


# -- what the document says ------------------------------------------------------------------------------------------


def _stated(parsed: Parsed) -> float:
    given, system = parsed.scenario.lingjing, _system(parsed)
    if given is not None and given.unit is not None:
        return _unit(given.unit)
    return system.unit_m if system else 0.0


def _unit(word: str) -> float:
    return METRE_M if word == "m" else CENTIMETRE_M


def _word(unit_m: float) -> str:
    return "metres" if unit_m == METRE_M else "centimetres"


def _system(parsed: Parsed) -> _StatedSystem | None:
    for holder, path in (*parsed.holders(), *parsed.later_holders()):
        for key, value in holder.items():
            if folded(key) == SYSTEM and isinstance(value, str):
                words = frozenset(re.findall(r"[a-z0-9]+|[\u4e00-\u9fff]+", value.lower()))
                return _StatedSystem(f"{path}.{key}", value, words, _unit_named(words))
    return None


def _unit_named(words: frozenset[str]) -> float:
    if words & _CENTIMETRES:
        return CENTIMETRE_M
    if words & _METRES:
        return METRE_M
    return CENTIMETRE_M if words & _UNREAL else 0.0


# -- what its numbers show -------------------------------------------------------------------------------------------


def _extent(places: Sequence[Coordinates]) -> float:
    """The longer side of the box around places, in their own unit."""
    axes = [[data.x or 0.0 for data in places], [data.y or 0.0 for data in places]]
    return max((max(axis) - min(axis) for axis in axes if axis), default=0.0)


def _farthest(places: Sequence[Coordinates]) -> float:
    """How far from the origin the farthest place lies along an axis, in their own unit."""
    return max((max(abs(data.x or 0.0), abs(data.y or 0.0)) for data in places), default=0.0)


def _fits_as_metres(places: Sequence[Coordinates]) -> bool:
    """True if the places could be those of a scene if their numbers were metres."""
    heights = [data.z for data in places if data.z is not None]
    return (
        _extent(places) <= WIDEST_M
        and _farthest(places) <= FARTHEST_SCENE_M
        and all(LOWEST_M <= height <= HIGHEST_M for height in heights)
    )


def _overlap(parsed: Parsed) -> str:
    """Two bodies of one engine that would stand in each other as centimetres and not as metres, in words."""
    placed = [body for body in bodies_of(parsed) if body.data.x is not None and body.data.y is not None]
    for one, other in combinations(placed, 2):
        width = WIDTH_M.get(one.engine, 0.0)
        apart = math.dist(_numbers(one.data), _numbers(other.data))
        if one.engine == other.engine and apart * CENTIMETRE_M < width <= apart:
            name = other.path.rpartition(".equipmentList.")[2].removesuffix(".data")
            return f"as centimetres {name} would stand {apart * CENTIMETRE_M:.2g} m from another, within its own width"
    return ""


def _numbers(data: Coordinates) -> tuple[float, float, float]:
    return data.x or 0.0, data.y or 0.0, data.z or 0.0


def _repeated_height(places: Sequence[Coordinates]) -> str:
    """A `Z` that is the number of another place's `alt`, in words."""
    heights = {data.alt for data in places if data.alt is not None and data.z is None}
    for data in places:
        if data.z in heights and data.alt is None and abs(data.z or 0.0) > _HEIGHT_M:
            return f"Z {data.z:g} repeats alt {data.z:g}, which is metres"
    return ""
