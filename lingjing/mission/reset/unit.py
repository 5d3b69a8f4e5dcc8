"""The unit of `X`, `Y` and `Z` in a `resetScenario` document: Unreal's centimetres by default.

`lingjing.unit` has precedence, then a `coordinate_system` that names a unit. Otherwise the document's numbers may show
it: bodies that would overlap as centimetres and not as metres, or heights that repeat those of `alt`. If all places lie
within a few metres as centimetres, and nothing decides the unit, that is a fault.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from itertools import combinations
from typing import NamedTuple

from lingjing.errors import Fault
from lingjing.mission.reset.document import Parsed
from lingjing.mission.reset.shapes import LISTS, Coordinates, fold_key

CENTIMETRE_M = 0.01
"""A centimetre in metres."""
METRE_M = 1.0
"""A metre in metres."""

WIDEST_M = 12_000.0
"""Width of the widest scene, metres: places farther apart are not in one scene."""

_FARTHEST_SCENE_M = 25_000.0
"""Largest distance of a scene's middle from the origin, metres (`lingjing.mission.kinds.LINE_MOST_M`)."""

_LOWEST_M = -500.0
"""Smallest plausible height, metres (chosen: the lowest shore is at -430 m)."""
_HIGHEST_M = 6_000.0
"""Largest plausible height of entities, metres (chosen)."""

CROWDED_M = 10.0
"""Distance in metres from X = Y = 0: if all places read as centimetres lie within it, they may be metres (chosen)."""

_WIDTH_M = {"multirotor": 0.9, "quadruped": 0.32, "road": 1.8, "vessel": 2.7, "plane": 8.2}
"""The narrowest side of a body, by its engine, metres (`scenarios/std`): two nearer bodies overlap."""

_HEIGHT_M = 1.0
"""Smaller heights are not compared as repetitions of `alt`, metres (chosen)."""

_CENTIMETRES = frozenset({"cm", "centimetre", "centimetres", "centimeter", "centimeters", "厘米", "公分"})
_METRES = frozenset({"m", "metre", "metres", "meter", "meters", "米"})
_NORTHWARD = frozenset({"enu", "ned", "utm", "gauss", "cgcs", "cgcs2000"})
"""Words of systems with other axes than Unreal's: Y or X to the north."""
_GEODETIC = frozenset({"wgs84", "wgs", "epsg4326", "4326", "gcj02", "gcj", "bd09", "geodetic", "geographic", "lonlat",
                       "latlon", "lla", "经纬度"})  # fmt: skip
"""Words of systems of degrees, in which X and Y cannot be."""
_UNREAL = frozenset({"ue", "ue4", "ue5", "unreal", "unrealengine", "虚幻"})
"""Words of Unreal's own system."""
_SYSTEM = "coordinatesystem"
"""The folded key of the coordinate system."""


class _StatedSystem(NamedTuple):
    """The coordinate system that a document names."""

    path: str
    """Its JSON path."""
    text: str
    words: frozenset[str]
    unit_m: float
    """Its unit in metres; 0 if it names none."""


class ListedBody(NamedTuple):
    """An entity of a list."""

    engine: str
    data: Coordinates
    path: str
    """JSON path of its coordinates."""


def bodies_of(parsed: Parsed) -> Iterator[ListedBody]:
    """The entities of all lists except satellites."""
    for entity_list in LISTS:
        if entity_list.engine != "satellite":
            where = parsed.list_path(entity_list.name)
            rows = getattr(parsed.scenario.equipment_list, entity_list.attribute)
            yield from (ListedBody(entity_list.engine, row.data, f"{where}[{k}].data") for k, row in enumerate(rows))


def unit_of(parsed: Parsed, places: Sequence[Coordinates]) -> float:
    """The unit of `X`, `Y` and `Z` in metres. An inferred unit is noted, an undecidable one is reported."""
    stated = _stated(parsed)
    if stated:
        return stated
    planar = [data for data in places if data.x is not None and data.y is not None]
    if not planar or not _fits_as_metres(planar):
        return CENTIMETRE_M
    wide, farthest = _extent(planar), _farthest(planar)
    reason = _overlap(parsed)
    if not reason and farthest * CENTIMETRE_M < CROWDED_M:
        reason = _repeated_height(places)
    if reason:
        parsed.notes.append(
            f'{parsed.path}: X, Y and Z are read as metres: {reason}; "lingjing": {{"unit": "m"}} would state it'
        )
        return METRE_M
    if wide > 0.0 and farthest * CENTIMETRE_M < CROWDED_M:
        message = f"X and Y may be centimetres or metres: they lie within {wide * CENTIMETRE_M:.2g} m or {wide:g} m"
        parsed.report(parsed.path, message, '"lingjing": {"unit": "cm"} or {"unit": "m"} in the scenario says which')
    return CENTIMETRE_M


def stated_fault(parsed: Parsed, every: Sequence[Coordinates]) -> Fault | None:
    """The fault of a document with different units in `lingjing.unit` and `coordinate_system`, or with X and Y in a
    system with other axes than Unreal's; None if it has none. `lingjing.unit` overrides such a system."""
    extra, system = parsed.scenario.lingjing, _system(parsed)
    if extra is None or extra.unit is None:
        return _foreign_fault(system, every)
    if system is None or not system.unit_m:
        return None
    if system.unit_m == _unit(extra.unit):
        return None
    return Fault(
        system.path, f"says {_word(system.unit_m)}, 'lingjing' {_word(_unit(extra.unit))}", "leave one of them"
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
    """Note an unknown coordinate system."""
    system = _system(parsed)
    if system is None:
        return
    parsed.understood.add(_SYSTEM)
    if not system.unit_m and not system.words & _GEODETIC:
        parsed.notes.append(
            f"{system.path}: '{system.text}' is not understood and kept; X counts to the east and Y to the south"
        )


# -- what the document says ------------------------------------------------------------------------------------------


def _stated(parsed: Parsed) -> float:
    extra, system = parsed.scenario.lingjing, _system(parsed)
    if extra is not None and extra.unit is not None:
        return _unit(extra.unit)
    return system.unit_m if system else 0.0


def _unit(word: str) -> float:
    return METRE_M if word == "m" else CENTIMETRE_M


def _word(unit_m: float) -> str:
    return "metres" if unit_m == METRE_M else "centimetres"


def _system(parsed: Parsed) -> _StatedSystem | None:
    for holder, path in (*parsed.holders(), *parsed.later_holders()):
        for key, value in holder.items():
            if fold_key(key) == _SYSTEM and isinstance(value, str):
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
    """The largest distance of a place from the origin along an axis, in their own unit."""
    return max((max(abs(data.x or 0.0), abs(data.y or 0.0)) for data in places), default=0.0)


def _fits_as_metres(places: Sequence[Coordinates]) -> bool:
    """True if the places could be those of one scene if their numbers were metres."""
    heights = [data.z for data in places if data.z is not None]
    return (
        _extent(places) <= WIDEST_M
        and _farthest(places) <= _FARTHEST_SCENE_M
        and all(_LOWEST_M <= height <= _HIGHEST_M for height in heights)
    )


def _overlap(parsed: Parsed) -> str:
    """Two bodies of one engine that would overlap as centimetres and not as metres, in words; "" if there are none."""
    placed = [body for body in bodies_of(parsed) if body.data.x is not None and body.data.y is not None]
    for first, second in combinations(placed, 2):
        width = _WIDTH_M.get(first.engine, 0.0)
        apart = math.dist(_numbers(first.data), _numbers(second.data))
        if first.engine == second.engine and apart * CENTIMETRE_M < width <= apart:
            name = second.path.rpartition(".equipmentList.")[2].removesuffix(".data")
            return f"as centimetres {name} would stand {apart * CENTIMETRE_M:.2g} m from another, within its own width"
    return ""


def _numbers(data: Coordinates) -> tuple[float, float, float]:
    return data.x or 0.0, data.y or 0.0, data.z or 0.0


def _repeated_height(places: Sequence[Coordinates]) -> str:
    """A `Z` that equals another place's `alt`, in words; "" if there is none."""
    heights = {data.alt for data in places if data.alt is not None and data.z is None}
    for data in places:
        if data.z in heights and data.alt is None and abs(data.z or 0.0) > _HEIGHT_M:
            return f"Z {data.z:g} repeats alt {data.z:g}, which is metres"
    return ""
