"""The format of a file `kinds.json`, in which a plug-in describes its scenes and engines.

`lingjing.mission.kinds` finds the file, `lingjing.mission.kinds_file` checks a plug-in's.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

import msgspec

from lingjing.mission.geometry2d import Polygon
from lingjing.mission.vocabulary import VerbMotion

Surface = Literal["ground", "road", "roof", "facade", "bridge", "pipe", "water"]
"""Surfaces of a scene on which an entity can stand."""

_SUFFIXES = {"metres": ("_m",), "size": ("_rows", "_columns"), "range": ("_low_m", "_high_m")}
"""Suffixes of the values of an option in an instance, by its type."""


class _Record(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    pass


class SceneOption(_Record, frozen=True, kw_only=True):
    """An option of a scene."""

    type: Literal["text", "path", "number", "metres", "size", "range", "positions", "region"]
    """A `path` is a text with the name of an existing file or folder."""
    help: str = ""
    low: float | None = None
    """Lower bound of a number, or of both numbers of a size or a range."""
    high: float | None = None
    """Upper bound, likewise."""
    points: Annotated[int, msgspec.Meta(ge=0)] = 0
    """Smallest number of points of a line or an outline."""
    default: float | tuple[float, float] | None = None
    """The value if a mission names none."""
    within: bool = False
    """True if a line or an outline must lie in the scene."""
    needs_shore: bool = False
    """True if it has a meaning only in a scene with a shore."""
    without: str = ""
    """An option that excludes this one; "" for none."""
    drawn: bool = False
    """True if an author may draw the value (`~`)."""


class SceneKind(_Record, frozen=True, kw_only=True):
    """A kind of scene."""

    name: str
    like: str = ""
    """A kind of the same file that supplies the omitted fields; options are joined one by one."""
    summary: str = ""
    options: dict[str, SceneOption] = {}
    extent_m: Annotated[float, msgspec.Meta(gt=0)] | None = None
    """Width of a scene without the option `extent`, metres."""
    outskirts_m: Annotated[float, msgspec.Meta(ge=0)] = 0.0
    """Distance by which its city reaches beyond its extent on each side, metres."""
    wider_by: tuple[str, ...] = ()
    """Options with which it may reach farther."""
    shore: Literal["own", "given", "none"] = "none"
    """The sea lies beside dry ground at elevation 0 always (`own`), with the option `shore` (`given`), or never
    (`none`)."""
    lacks: tuple[Surface, ...] = ()
    """Surfaces that it does not have."""
    unless: dict[str, str] = {}
    """Surface of `lacks` → the option that adds it."""
    level: tuple[Surface, ...] = ()
    """Surfaces of known elevation: water is at the datum, a road on the ground at 0 or, with the option `bridge`, at
    most at its `deck`."""
    land: tuple[Polygon, ...] = ()
    """Outlines of dry land in every city of the kind, metres."""
    aside_m: Annotated[float, msgspec.Meta(ge=0)] = 250.0
    """Largest distance by which it may move an entity without a declared surface, metres (chosen)."""
    one_of: tuple[str, ...] = ()
    """Exactly one of these options must be set."""
    one_of_hint: str = ""
    """The hint for an error of `one_of`."""

    def spelled(self) -> dict[str, str]:
        """Each option in the instance's spelling → in the author's spelling."""
        return {name: spelled for spelled, option in self.options.items() for name in names_of(spelled, option)}

    def default(self, spelled: str) -> tuple[float, ...]:
        """The default numbers of an option; empty if the scene computes them."""
        numbers = self.options[spelled].default if spelled in self.options else None
        return () if numbers is None else numbers if isinstance(numbers, tuple) else (numbers,)


class VerbKind(_Record, frozen=True, kw_only=True):
    """The effect of a verb. The kernel clips to its bounds, and the engine checks the same values."""

    motion: VerbMotion = ""
    """The kind of motion of the body."""
    doc: str = ""
    """The effect of the verb in words, for policies that choose among verbs."""
    least: dict[str, float] = {}
    """Argument → the smallest value that the engine admits."""
    above_start: tuple[str, ...] = ()
    """Arguments that are heights above the body's place, in contrast to elevations."""


class FlightFloorKind(_Record, frozen=True, kw_only=True):
    """The lowest destination of a flying body."""

    clearance_m: Annotated[float, msgspec.Meta(ge=0)]
    """Height above the reference, metres."""
    over: Literal["surface", "everything"] = "surface"
    """The reference: `surface`, the ground or the water at a destination (obstacles there are flown around or
    rejected), or `everything`, the highest obstacle there."""


class TopSpeed(_Record, frozen=True, kw_only=True):
    """Upper bound of the speed over ground: the property times `factor`, plus shares of the mission's strongest wind
    and current. Proofs depend on it, so that it is generous."""

    property: str
    """Name of the property with the declared speed, m/s."""
    least: Annotated[float, msgspec.Meta(ge=0)] = 0.0
    """The slowest cruise of the engine's bodies, m/s; a slower declared speed is raised to it."""
    most: Annotated[float, msgspec.Meta(gt=0)] | None = None
    """The fastest cruise of the engine's bodies, m/s; a faster declared speed is lowered to it. The engine reads both
    here."""
    factor: Annotated[float, msgspec.Meta(ge=1)] = 1.0
    wind: Annotated[float, msgspec.Meta(ge=0)] = 0.0
    """Share of the wind speed that is added."""
    current: Annotated[float, msgspec.Meta(ge=0)] = 0.0
    """Share of the current speed that is added."""

    def held(self, declared_mps: float) -> float:
        """The cruise speed of a body with this declared speed, m/s."""
        return max(declared_mps if self.most is None else min(declared_mps, self.most), self.least)


class EngineKind(_Record, frozen=True, kw_only=True):
    """A kind of engine. Fields from `top_speed` on are for proofs; without them nothing is proved."""

    name: str
    verbs: dict[str, VerbKind] = {}
    """Its verbs besides `stop` and `takePhoto`."""
    words: tuple[str, ...] | None = None
    """The status words that the engine gives to its bodies; interactions and absence add theirs. None if they are not
    described: then a mission may compare a status with any word."""
    shares: tuple[str, ...] = ()
    """Resources between 0 and 1 that the engine reports of each body: `battery`, `fuel`. Rules read them as fields."""
    acts: bool = True
    """True if its entities can perform interactions."""
    landbound: bool = False
    """True if its bodies are never below the ground or the sea."""
    stands_on: Surface | Literal[""] = ""
    """The surface that its bodies never leave; "" for none."""
    anywhere: bool = False
    """True if its bodies may begin outside of the scene, which they cross at once."""
    orbits: bool = False
    """True if its bodies are placed by orbital elements."""
    standard_properties: bool = False
    """True if speeds, endurances and loads have the language's meaning."""
    floor: FlightFloorKind | None = None
    """The lowest destination of its bodies, to which the kernel clips commands; None for no bound."""
    top_speed: TopSpeed | None = None
    """Upper bound of a body's speed."""
    stays: bool = False
    """True if only wind and current move a body without commands."""
    drift_factor: Annotated[float, msgspec.Meta(ge=1)] | None = None
    """Largest speed as a multiple of the declared `drift`, if only drift moves a body; else None."""
    in_band: bool = False
    """True if a flying body stays within its altitude `band`."""
    overshoot: Annotated[float, msgspec.Meta(ge=1)] | None = None
    """A command to move by a length moves the body at most this many times as far, plus 2 m."""
    least_power: Annotated[float, msgspec.Meta(gt=0, le=1)] | None = None
    """The most economical motion takes at least this share of the power on which the property `endurance` is based."""

    def is_above_start(self, verb: str, argument: str) -> bool:
        """True if an argument is a height above the body's place."""
        verb_kind = self.verbs.get(verb)
        return verb_kind is not None and argument in verb_kind.above_start


class KindsFile(_Record, frozen=True, kw_only=True):
    """The content of one file, with `like` resolved (`joined`)."""

    scenes: tuple[SceneKind, ...] = ()
    engines: tuple[EngineKind, ...] = ()

    @property
    def by_scene(self) -> dict[str, SceneKind]:
        """The scenes by name."""
        return {kind.name: kind for kind in self.scenes}

    @property
    def by_engine(self) -> dict[str, EngineKind]:
        """The engines by name."""
        return {kind.name: kind for kind in self.engines}


def joined(document: object) -> Any:
    """The decoded file with `like` resolved: each scene with the fields of the scenes it refers to.

    Values of a wrong type stay as they are.
    """
    scenes = document.get("scenes") if isinstance(document, dict) else None
    if not isinstance(document, dict) or not isinstance(scenes, list):
        return document
    named = {scene["name"]: scene for scene in scenes if isinstance(scene, dict) and isinstance(scene.get("name"), str)}
    return document | {"scenes": [_joined(scene, named) if isinstance(scene, dict) else scene for scene in scenes]}


def names_of(spelled: str, option: SceneOption) -> tuple[str, ...]:
    """The names of an option's values in an instance: `height` gives `height_low_m` and `height_high_m`."""
    return tuple(spelled + suffix for suffix in _SUFFIXES.get(option.type, ("",)))


# -- private


def _joined(scene: dict[str, Any], named: dict[str, Any], passed: tuple[str, ...] = ()) -> dict[str, Any]:
    like = scene.get("like")
    if not isinstance(like, str) or like not in named or like in passed:
        return scene
    base = _joined(named[like], named, (*passed, like))
    base_options, own = base.get("options", {}), scene.get("options", {})
    inherited = {field: value for field, value in base.items() if field not in ("name", "like")}
    if not isinstance(base_options, dict) or not isinstance(own, dict):
        return inherited | scene
    options = {name: _option_joined(base_options.get(name), option) for name, option in own.items()}
    return inherited | scene | {"options": base_options | options}


def _option_joined(base: object, option: object) -> object:
    return base | option if isinstance(base, dict) and isinstance(option, dict) else option
