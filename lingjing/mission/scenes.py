"""What the built-in scenes can be: their options, their limits, and on what things can stand in them.

Data alone, for two readers: whoever builds a scene refuses by it, and whoever checks a mission tells so before anything
is built. Of a plug-in's scene, and of what a map holds, nothing is known here.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping

import msgspec

from lingjing.mission.instance import Option, SceneSpec

DISTRICTS = ("residential", "industrial", "commercial", "campus", "logistics", "coastal")

DRY_M = 1.0
"""The sea lies at least this far under the ground, which is at elevation 0."""

EXTENT_M: Mapping[str, float] = {"city": 3000.0}
"""How wide a scene is that names no `extent`, where that is not usual."""
USUAL_EXTENT_M = 800.0

HEIGHT_M: Mapping[str, tuple[float, float]] = {
    "residential": (9.0, 24.0),
    "industrial": (6.0, 14.0),
    "commercial": (12.0, 70.0),
    "campus": (9.0, 24.0),
    "logistics": (6.0, 20.0),
    "coastal": (8.0, 40.0),
    "city": (9.0, 90.0),
}
"""Heights of buildings, lowest and highest, where a scene names none."""

_MADE_UP = {
    "extent_m": "extent",
    "blocks_rows": "blocks",
    "blocks_columns": "blocks",
    "height_low_m": "height",
    "height_high_m": "height",
    "inside": "inside",
    "homes": "homes",
    "pipeline": "pipeline",
    "shore": "shore",
    "bridge": "bridge",
    "deck_m": "deck",
    "traffic": "traffic",
}
OPTIONS: Mapping[str, Mapping[str, str]] = {
    "bay": {"distractors": "distractors"},
    "map": {name: name for name in ("bbox", "file", "folder", "map", "traffic")},
    "city": _MADE_UP,
    **dict.fromkeys(DISTRICTS, _MADE_UP),
}
"""Scene → the options it reads as instances have them → how an author spells them. `datum`, `origin` and `layout` fit
every scene and are not among an instance's options; `traffic` is read by the road engine."""

_BOUNDS: Mapping[str, tuple[float, float]] = {
    "extent_m": (150.0, 12_000.0),
    "blocks_rows": (1.0, 100.0),
    "blocks_columns": (1.0, 100.0),
    "height_low_m": (2.5, 400.0),
    "height_high_m": (2.5, 400.0),
    "deck_m": (6.0, 80.0),
    "distractors": (0.0, 400.0),
}
_POINTS = {"inside": 3, "homes": 3, "pipeline": 2, "shore": 2, "bridge": 2}
"""Option → how many points it has at least."""

LINE_MOST_M = 25_000.0
"""How far from the origin a line or an outline may lead: the widest scene's extent and as much again."""

_MAPS = ("folder", "file", "map")


class SceneFault(msgspec.Struct, frozen=True):
    """What is wrong with a scene: the option at fault as an author spells it ("" for the scene as a whole)."""

    option: str
    message: str
    hint: str = ""


def scene_faults(spec: SceneSpec) -> Iterator[SceneFault]:
    """Everything for which a built-in scene would be refused, whatever the machine; nothing for another scene."""
    known = OPTIONS.get(spec.kind)
    if known is None:
        return
    for name in sorted(set(spec.options) - set(known) - {"datum", "origin"}):
        spelled = _MADE_UP.get(name, name)
        listed = ", ".join(("datum", *dict.fromkeys(known.values())))
        yield SceneFault(spelled, f"scene `{spec.kind}` has no option `{spelled}`", f"known: {listed}")
    if spec.kind == "map":
        yield from _map_faults(spec)
    else:
        yield from _made_up_faults(spec, known)


def has_shore(spec: SceneSpec) -> bool:
    """Whether a made-up scene meets the sea."""
    return spec.kind in ("coastal", "city") or bool(spec.options.get("shore"))


def lacks(spec: SceneSpec, surface: str) -> bool:
    """Whether nothing in a built-in scene is such a surface (`on = bridge`); False where only the scene can tell."""
    if spec.kind == "bay":
        return surface in ("road", "roof", "facade", "bridge", "pipe")
    if spec.kind not in DISTRICTS:
        return False
    if surface == "pipe":
        return spec.kind not in ("industrial", "logistics") and "pipeline" not in spec.options
    return surface == "bridge" and "bridge" not in spec.options


# -- private


def _map_faults(spec: SceneSpec) -> Iterator[SceneFault]:
    hint = 'write: scene map { folder = "DIR" } with a folder that `lingjing scene build MAP.osm -o DIR` wrote'
    named = [name for name in _MAPS if name in spec.options]
    if len(named) != 1:
        said = "names no map" if not named else f"names its map {len(named)} times ({', '.join(named)})"
        yield SceneFault("", f"scene `map` {said}", hint)
    for name in named:
        value = spec.options[name]
        if not isinstance(value, str) or not value:
            yield SceneFault(name, f"scene `map`: `{name}` is {value!r}, not a path in quotes", hint)
    if "folder" in named and "bbox" in spec.options:
        message = "scene `map`: a folder is a finished city, `bbox` cannot cut it"
        yield SceneFault("bbox", message, "name the map's `file`")


def _made_up_faults(spec: SceneSpec, known: Mapping[str, str]) -> Iterator[SceneFault]:
    for name, value in spec.options.items():
        if name in _BOUNDS and name in known and not _is_between(value, *_BOUNDS[name]):
            low, high = _BOUNDS[name]
            message = f"scene `{spec.kind}`: `{known[name]}` is {value!r}"
            yield SceneFault(known[name], message, f"give {low:g} to {high:g}")
        if name in _POINTS and name in known and not _is_line(value, _POINTS[name]):
            message = f"scene `{spec.kind}`: `{name}` is no line of {_POINTS[name]} or more points"
            yield SceneFault(name, message, "write [(0 m, 0 m), (10 m, 0 m)]")
        elif name in _POINTS and name in known:
            yield from _far(spec, name, value)
    if spec.kind in HEIGHT_M:
        yield from _contradictions(spec)


def _far(spec: SceneSpec, name: str, value: Option) -> Iterator[SceneFault]:
    """A site lies in its scene: no farther from the origin than the scene is wide."""
    extent = spec.options.get("extent_m", EXTENT_M.get(spec.kind, USUAL_EXTENT_M))
    most = extent if name in ("inside", "homes") and isinstance(extent, float) else LINE_MOST_M
    points = value if isinstance(value, tuple) else ()
    reach = max((abs(metres) for point in points if isinstance(point, tuple) for metres in point), default=0.0)
    if reach > most:
        message = f"scene `{spec.kind}`: `{name}` reaches {reach:g} m from the origin"
        yield SceneFault(name, message, f"{most:g} m at most")


def _contradictions(spec: SceneSpec) -> Iterator[SceneFault]:
    low, high = spec.options.get("height_low_m", HEIGHT_M[spec.kind][0]), spec.options.get("height_high_m")
    if isinstance(low, int | float) and isinstance(high, int | float) and low > high:
        yield SceneFault("height", f"scene `{spec.kind}`: `height` is {high!r}", f"give {low:g} to 400")
    if has_shore(spec) and spec.datum_m > -DRY_M:
        message = f"scene `{spec.kind}`: the sea at {spec.datum_m:g} m would flood the ground, which is at 0 m"
        yield SceneFault("datum", message, "write: datum = sea level at -3 m")
    if spec.options.get("bridge") and not has_shore(spec):
        yield SceneFault(
            "bridge", f"scene `{spec.kind}` has no `bridge`", "a bridge needs a shore: scene coastal { … }"
        )
    for name in ("inside", "pipeline", "bridge"):
        if spec.kind == "city" and spec.options.get(name):
            message = "scene `city` knows extent, blocks and height only"
            yield SceneFault(name, message, "use one district for a site")
            return


def _is_between(value: Option, low: float, high: float) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and low <= value <= high


def _is_line(value: Option, least: int) -> bool:
    if not isinstance(value, tuple):
        return False
    points = [point for point in value if isinstance(point, tuple) and all(map(math.isfinite, point))]
    return not value or len(points) == len(value) >= least
