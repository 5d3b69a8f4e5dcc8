"""Kinds of scenes and engines as data: the facts that checks of a mission need before any plug-in is imported.

A plug-in with a scene or an engine describes it in a file `kinds.json` beside the module that its entry point (group
`lingjing`) names; the built-in ones are in `lingjing/kinds.json`. The file is found without importing the
plug-in, and only if a mission names a kind that is not built in. A kind without a description is accepted unchecked.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Mapping
from functools import cache
from typing import TYPE_CHECKING, Literal

import msgspec

from lingjing.decoding import converted, from_json
from lingjing.errors import Fault, PluginError, UsageError
from lingjing.mission.geometry2d import Polygon, Vector2, left_of
from lingjing.mission.instance import Option, SceneSpec, VerbSpec
from lingjing.mission.kinds_format import EngineKind, KindsFile, SceneKind, SceneOption, joined, names_of

if TYPE_CHECKING:
    from pathlib import Path

FILE = "kinds.json"
"""Name of a file of kinds."""

_DRY_M = 1.0
"""Smallest depth of the sea below the ground of a town, which is at elevation 0, metres (chosen)."""

SEA_M = -3.0
"""Elevation of the sea beside a town if the mission names no datum, metres (chosen)."""

LINE_MOST_M = 25_000.0
"""Largest distance of a line or an outline from the origin, metres (chosen): twice the widest scene's extent."""

DISPLACEMENT = "displacement_m"
"""The option of every scene with the largest distance by which it may move a body from its declared place. Providers do
not read it."""

# pathlib takes 4 ms of a cold start
_BUILTIN = os.path.join(os.path.dirname(os.path.dirname(os.path.abspath(__file__))), FILE)  # noqa: PTH100, PTH118, PTH120


class SceneFault(msgspec.Struct, frozen=True):
    """An error of a scene."""

    option: str
    """The option at fault in the author's spelling; "" for the scene as a whole."""
    message: str
    hint: str = ""


@cache
def builtin_scenes() -> dict[str, SceneKind]:
    """The scenes of the project, by name."""
    return _builtin().by_scene


@cache
def builtin_engines() -> dict[str, EngineKind]:
    """The engines of the project, by name."""
    return _builtin().by_engine


def scene_kind(name: str) -> SceneKind | None:
    """The description of a scene; None if no file has one. Raises `PluginError` for a file that cannot be read."""
    if name in builtin_scenes():
        return builtin_scenes()[name]
    file = _describing("scene", name)
    return file.by_scene[name] if file is not None else None


def engine_kind(name: str) -> EngineKind:
    """The description of an engine; without one, only that its entities act."""
    if name in builtin_engines():
        return builtin_engines()[name]
    file = _describing("engine", name)
    return file.by_engine[name] if file is not None else EngineKind(name=name)


def least_value(kind: EngineKind, verb: str, argument: str) -> float:
    """The smallest value of an argument that an engine admits; minus infinity if its description names none."""
    verb_kind = kind.verbs.get(verb)
    return -math.inf if verb_kind is None else verb_kind.least.get(argument, -math.inf)


def admitted(verb: VerbSpec, kind: EngineKind) -> VerbSpec:
    """The verb with the bounds that its engine admits: no minimum is below the engine's least value."""
    arguments = []
    for spec in verb.arguments:
        least = least_value(kind, verb.name, spec.name)
        if least > (-math.inf if spec.minimum is None else spec.minimum):
            spec = msgspec.structs.replace(spec, minimum=least)
        arguments.append(spec)
    return msgspec.structs.replace(verb, arguments=tuple(arguments))


def is_described(kind: Literal["scene", "engine"], name: str) -> bool:
    """True if a file describes a scene or an engine of that name. Raises `PluginError` for a file that cannot
    be read."""
    if kind == "scene":
        return scene_kind(name) is not None
    return name in builtin_engines() or _describing("engine", name) is not None


def described_by(plugin: str) -> KindsFile:
    """The kinds in the file of an installed entry point; none if it has no file. Raises `PluginError` if it
    has errors."""
    file = next((file for name, file in _files() if name == plugin), None)
    if file is None:
        return KindsFile()
    return _builtin() if file.samefile(_BUILTIN) else _read(file, plugin)


def scene_faults(spec: SceneSpec) -> Iterator[SceneFault]:
    """All errors of a scene that do not depend on the machine; none for a scene without a description."""
    kind = scene_kind(spec.kind)
    if kind is None:
        return
    for name in sorted(set(spec.options) - kind.spelled().keys() - {"datum", "origin", DISPLACEMENT}):
        spelled = next((o.spelled()[name] for o in builtin_scenes().values() if name in o.spelled()), name)
        listed = ", ".join(("datum", *kind.options))
        yield SceneFault(spelled, f"scene `{kind.name}` has no option `{spelled}`", f"known: {listed}")
    yield from _choice_faults(spec, kind)
    for spelled, option in kind.options.items():
        yield from _option_faults(spec, kind, spelled, option)
    if _has_shore(spec) and spec.datum_m > -_DRY_M:
        message = f"scene `{kind.name}`: the sea at {spec.datum_m:g} m would flood the ground, which is at 0 m"
        yield SceneFault("datum", message, "write: datum = sea level at -3 m")


def missing_paths(kind: str, texts: Mapping[str, str]) -> Iterator[SceneFault]:
    """Files and folders named by text options of a scene that do not exist. They may exist on another machine or in
    another working folder."""
    for name, path in named_paths(kind, texts):
        yield from missing_path(name, path, f"scene `{kind}`")


def named_paths(kind: str, texts: Mapping[str, str]) -> Iterator[tuple[str, str]]:
    """Yield the options of a scene that are paths, each with its text, in the order of the kind."""
    known = scene_kind(kind)
    for name, option in known.options.items() if known else ():
        if option.type == "path" and (path := texts.get(name, "")):
            yield name, path


def missing_path(name: str, path: str, what: str) -> Iterator[SceneFault]:
    """The error of an option or property that names a file or folder that does not exist."""
    if not os.path.exists(path):  # noqa: PTH110 - an invalid path does not exist either
        hint = f"a path begins in the working folder, `{os.getcwd()}`"  # noqa: PTH109
        yield SceneFault(name, f"{what}: there is no `{path}`", "" if os.path.isabs(path) else hint)  # noqa: PTH117


def check_scene(spec: SceneSpec) -> None:
    """Raise `UsageError` with all errors of a scene's options."""
    faults = tuple(Fault(each.option, each.message, each.hint) for each in scene_faults(spec))
    if faults:
        hints = dict.fromkeys(fault.hint for fault in faults if fault.hint)
        raise UsageError("\n".join(fault.message for fault in faults), hint="; ".join(hints), faults=faults)


def _has_shore(spec: SceneSpec) -> bool:
    """True if dry ground at elevation 0 meets the sea."""
    kind = scene_kind(spec.kind)
    return kind is not None and (kind.shore == "own" or (kind.shore == "given" and bool(spec.options.get("shore"))))


def lacks(spec: SceneSpec, surface: str) -> bool:
    """True if a scene has no such surface (`on = bridge`); False if only the built scene can decide that."""
    kind = scene_kind(spec.kind)
    return kind is not None and surface in kind.lacks and kind.unless.get(surface) not in spec.options


def spoken(surface: str) -> str:
    """A surface in a sentence: a road, the ground, the water."""
    return f"the {surface}" if surface in ("ground", "water") else f"a {surface}"


def levels_m(spec: SceneSpec, surface: str) -> tuple[float, float] | None:
    """The lowest and the highest elevation of a surface, metres; None if only the built scene has them."""
    kind = scene_kind(spec.kind)
    if kind is None or surface not in kind.level:
        return None
    if surface == "water":
        return spec.datum_m, spec.datum_m
    deck = spec.options.get("deck_m", sum(kind.default("deck"))) if spec.options.get("bridge") else 0.0
    return 0.0, float(deck) if isinstance(deck, int | float) else 0.0


def land(spec: SceneSpec) -> tuple[Polygon, ...]:
    """Outlines of dry land as far as the text has them, metres from the scene's origin."""
    kind = scene_kind(spec.kind)
    shore = spec.options.get("shore") if _has_shore(spec) else None
    own = tuple(_moved(outline, centre_m(spec)) for outline in kind.land) if kind else ()
    if kind is None or not shore or _coordinates(shore, 2) is None:
        return own
    return *own, left_of(shore, LINE_MOST_M)  # type: ignore[arg-type]


def extent_m(spec: SceneSpec) -> float | None:
    """The width of a scene in metres, or None if unknown."""
    kind = scene_kind(spec.kind)
    extent = spec.options.get("extent_m", next(iter(kind.default("extent")), kind.extent_m) if kind else None)
    return float(extent) if isinstance(extent, int | float) and extent > 0 else None


def centre_m(spec: SceneSpec) -> Vector2:
    """East and north of the middle of a scene, metres; the origin if the mission names no `centre`."""
    metres = _coordinates(spec.options.get("centre", ()), 1)
    return (metres[0], metres[1]) if metres else (0.0, 0.0)


def reach_m(spec: SceneSpec) -> float | None:
    """Distance from the centre to the edge of a scene's city, metres; None if unknown."""
    kind, extent = scene_kind(spec.kind), extent_m(spec)
    if kind is None or extent is None or any(name in spec.options for name in kind.wider_by):
        return None
    return extent / 2.0 + kind.outskirts_m


# -- private


@cache
def _builtin() -> KindsFile:
    with open(_BUILTIN, "rb") as file:  # noqa: PTH123 - as above
        document = from_json(file.read())
    return converted(joined(document), KindsFile)


@cache
def _describing(kind: Literal["scene", "engine"], name: str) -> KindsFile | None:
    """The plug-in's file that describes a kind of that name. A file with errors is skipped, unless its text contains
    the name and no other file describes it: then `PluginError` is raised."""
    fault: PluginError | None = None
    for plugin, file in _files():
        if file.samefile(_BUILTIN):
            continue
        try:
            described = _read(file, plugin)
        except PluginError as error:
            fault = fault or (error if _mentions(file, name) else None)
            continue
        if name in (described.by_scene if kind == "scene" else described.by_engine):
            return described
    if fault is not None:
        raise fault
    return None


def _mentions(file: Path, name: str) -> bool:
    try:
        return msgspec.json.encode(name) in file.read_bytes()
    except OSError:
        return False


def _read(file: Path, plugin: str) -> KindsFile:
    from lingjing.mission.kinds_file import read  # its checks are needed only where a plug-in has a file

    return read(file, plugin, _builtin())


def _files() -> Iterator[tuple[str, Path]]:
    """(name of the entry point, file) of the plug-ins with a file."""
    from lingjing.installed_plugins.entry_points import PLUGINS, find_entries, package_folders

    for point in find_entries(PLUGINS).points:
        for within in package_folders(point.module):
            file = (within if within.is_dir() else within.parent) / FILE
            if file.is_file():
                yield point.name, file


def _choice_faults(spec: SceneSpec, kind: SceneKind) -> Iterator[SceneFault]:
    named = [name for name in kind.one_of if name in spec.options]
    if kind.one_of and len(named) != 1:
        choice = f"its {kind.name} {len(named)} times ({', '.join(named)})" if named else f"no {kind.name}"
        yield SceneFault("", f"scene `{kind.name}` names {choice}", kind.one_of_hint)


def _option_faults(spec: SceneSpec, kind: SceneKind, spelled: str, option: SceneOption) -> Iterator[SceneFault]:
    names = names_of(spelled, option)
    values = {name: spec.options[name] for name in names if name in spec.options}
    for value in values.values():
        message, hint = _value_fault(spec, kind, option, value)
        if message:
            yield SceneFault(spelled, f"scene `{kind.name}`: `{spelled}` {message}", hint)
    if option.type == "range" and values:
        low, high = (
            values.get(name, usual) for name, usual in zip(names, kind.default(spelled) or (None, None), strict=True)
        )
        if isinstance(low, int | float) and isinstance(high, int | float) and low > high:
            message = f"scene `{kind.name}`: `{spelled}` is {high!r}"
            yield SceneFault(spelled, message, _bounds(low, option.high))
    if any(values.values()) and option.needs_shore and not _has_shore(spec):
        hint = f"a {spelled} needs a shore: scene coastal {{ … }}"
        yield SceneFault(spelled, f"scene `{kind.name}` has no `{spelled}`", hint)
    if values and option.without in spec.options:
        message = f"scene `{kind.name}`: with `{option.without}` there is no `{spelled}`"
        yield SceneFault(spelled, message, f"leave out `{option.without}` or `{spelled}`")


def _value_fault(spec: SceneSpec, kind: SceneKind, option: SceneOption, value: Option) -> tuple[str, str]:
    """The error of one value of an option, and its hint; ("", "") for a correct value."""
    if option.type in ("text", "path"):
        return (
            ("", "") if isinstance(value, str) and value else (f"is {value!r}, not a text in quotes", kind.one_of_hint)
        )
    if option.type in ("positions", "region"):
        least = max(option.points, 3 if option.type == "region" else 1)
        metres = _coordinates(value, least)
        if metres is None:
            return f"is no line of {least} or more points", "write [(0 m, 0 m), (10 m, 0 m)]"
        within = extent_m(spec) if option.within else None
        east, north = centre_m(spec) if within else (0.0, 0.0)
        away = (abs(metre - (north if k % 2 else east)) for k, metre in enumerate(metres))
        reach, most = max(away, default=0.0), within or LINE_MOST_M
        middle = "origin" if (east, north) == (0.0, 0.0) else "scene's centre"
        return (f"reaches {reach:g} m from the {middle}", f"{most:g} m at most") if reach > most else ("", "")
    low = -math.inf if option.low is None else option.low
    high = math.inf if option.high is None else option.high
    if isinstance(value, int | float) and not isinstance(value, bool) and low <= value <= high:
        return "", ""
    return f"is {value!r}", _bounds(option.low, option.high)


def _moved(outline: Polygon, by: Vector2) -> Polygon:
    return tuple((east + by[0], north + by[1]) for east, north in outline)


def _bounds(low: float | None, high: float | None) -> str:
    """The hint for a number outside of its bounds."""
    if high is None:
        return "give a number" if low is None else f"give {low:g} or more"
    return f"give {high:g} at most" if low is None else f"give {low:g} to {high:g}"


def _coordinates(value: Option, least: int) -> list[float] | None:
    """The coordinates of a line of at least `least` points, or of an empty one; None if the value is no such line."""
    if not isinstance(value, tuple):
        return None
    points = [point for point in value if isinstance(point, tuple) and all(map(math.isfinite, point))]
    whole = not value or len(points) == len(value) >= least
    return [metres for point in points for metres in point] if whole else None
