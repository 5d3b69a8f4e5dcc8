"""The format of a file `kinds.json`: what whoever provides a scene or an engine says of it.

`lingjing.mission.kinds` looks it up, `lingjing.mission.kinds_file` checks a plug-in's.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

import msgspec

from lingjing.mission.geometry2d import Polygon
from lingjing.mission.vocabulary import VerbMotion

Surface = Literal["ground", "road", "roof", "facade", "bridge", "pipe", "water"]
"""What a thing can stand on in a scene."""

_SUFFIXES = {"metres": ("_m",), "size": ("_rows", "_columns"), "range": ("_low_m", "_high_m")}


class _Record(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    pass


class SceneOption(_Record, frozen=True, kw_only=True):
    """An option of a scene.

    `low` and `high` bound a number and both numbers of a size or a range, `points` says how many points a line or an
    outline has at least, `within` that it lies in the scene. `default` is what counts where a mission names none.
    `needs_shore`: it makes no sense in a scene without a shore. `without` is an option that excludes this one.
    `drawn`: an author may draw the value (`~`). A `path` is a text that names a file or folder which must be there.
    """

    type: Literal["text", "path", "number", "metres", "size", "range", "positions", "region"]
    help: str = ""
    low: float | None = None
    high: float | None = None
    points: Annotated[int, msgspec.Meta(ge=0)] = 0
    default: float | tuple[float, float] | None = None
    within: bool = False
    needs_shore: bool = False
    without: str = ""
    drawn: bool = False


class SceneKind(_Record, frozen=True, kw_only=True):
    """A kind of scene.

    `like` names a kind of the same file that says what this one leaves out; options are joined one by one.
    `extent_m` is the width of a scene without the option `extent`, `outskirts_m` how far its city reaches beyond its
    extent on each side, `wider_by` the options with which it may reach farther. `shore` says whether the sea lies
    beside dry ground at elevation 0: always (`own`), where the option `shore` gives it (`given`), or never (`none`).
    `lacks` are the surfaces that it has not, `unless` the options that bring one nevertheless. `level` are those whose
    elevation is known: water lies at the datum, a road on the ground at 0 or, where the option `bridge` names one, up
    to its `deck`. `land` are outlines of dry land that every city of the kind has. `aside_m` is how far it
    may move what stands on no declared surface. Exactly one of the options `one_of` must be given, as `one_of_hint`
    says.
    """

    name: str
    like: str = ""
    summary: str = ""
    options: dict[str, SceneOption] = {}
    extent_m: Annotated[float, msgspec.Meta(gt=0)] | None = None
    outskirts_m: Annotated[float, msgspec.Meta(ge=0)] = 0.0
    wider_by: tuple[str, ...] = ()
    shore: Literal["own", "given", "none"] = "none"
    lacks: tuple[Surface, ...] = ()
    unless: dict[str, str] = {}
    level: tuple[Surface, ...] = ()
    land: tuple[Polygon, ...] = ()
    aside_m: Annotated[float, msgspec.Meta(ge=0)] = 250.0
    one_of: tuple[str, ...] = ()
    one_of_hint: str = ""

    def spelled(self) -> dict[str, str]:
        """Each option as an instance has it → as an author spells it."""
        return {name: spelled for spelled, option in self.options.items() for name in names_of(spelled, option)}

    def default(self, spelled: str) -> tuple[float, ...]:
        """The numbers of an option that a mission leaves out; none where the scene works them out."""
        given = self.options[spelled].default if spelled in self.options else None
        return () if given is None else given if isinstance(given, tuple) else (given,)


class VerbKind(_Record, frozen=True, kw_only=True):
    """The effect of a verb.

    `motion`: how it moves the body. `doc`: the same in words, for those that choose among verbs. `least`: by argument,
    the smallest value that the engine admits. `above_start`: arguments that are heights over the body's place, and not
    elevations. The kernel clips to both, and the engine checks the same values.
    """

    motion: VerbMotion = ""
    doc: str = ""
    least: dict[str, float] = {}
    above_start: tuple[str, ...] = ()


class FlightFloorKind(_Record, frozen=True, kw_only=True):
    """The lowest point to which a flying body may be sent.

    `clearance_m`: metres over what lies below. `over`: `surface`, the ground or the water at a destination (what stands
    there is flown around or refused), or `everything`, the highest thing there.
    """

    clearance_m: Annotated[float, msgspec.Meta(ge=0)]
    over: Literal["surface", "everything"] = "surface"


class TopSpeed(_Record, frozen=True, kw_only=True):
    """What no body of an engine exceeds over ground: the property of that name, m/s, times `factor`, and these shares
    of the strongest wind and current of the mission. Proofs rest on it, so it is generous.

    `least` and `most`: the slowest and the fastest cruise that the engine's bodies hold, m/s; a declared speed beyond
    them is flown or walked as the nearer one. The engine reads them here too.
    """

    property: str
    least: Annotated[float, msgspec.Meta(ge=0)] = 0.0
    most: Annotated[float, msgspec.Meta(gt=0)] | None = None
    factor: Annotated[float, msgspec.Meta(ge=1)] = 1.0
    wind: Annotated[float, msgspec.Meta(ge=0)] = 0.0
    current: Annotated[float, msgspec.Meta(ge=0)] = 0.0

    def held(self, declared_mps: float) -> float:
        """The cruise speed of a body that declares this one, m/s."""
        return max(declared_mps if self.most is None else min(declared_mps, self.most), self.least)


class EngineKind(_Record, frozen=True, kw_only=True):
    """A kind of engine.

    `verbs` are those that it understands beside `stop` and `takePhoto`. `acts`: its entities can perform interactions.
    `landbound`: its bodies are never under the ground or the sea. `stands_on` is the surface that they are always on.
    `anywhere`: they may begin outside of the scene, which they cross at once. `orbits`: elements place them.
    `floor`: the lowest point that the engine lets its bodies be sent to; the kernel clips commands to it.
    `standard_properties`: speeds, endurances and loads mean what the language says.

    The rest is for proofs, and where it is not said nothing is proved. `top_speed` bounds how fast a body is.
    `stays`: one that nobody commands is moved by wind and current alone; `drift_factor`: one is moved by its declared
    `drift` alone, at most so many times as fast. `in_band`: one that flies stays within its altitude `band`.
    `overshoot`: a command to move by a length carries one at most so many times as far, and 2 m beyond. `least_power`:
    the most economical way of moving takes at least this share of the power by which the property `endurance` counts.
    """

    name: str
    verbs: dict[str, VerbKind] = {}
    acts: bool = True
    landbound: bool = False
    stands_on: Surface | Literal[""] = ""
    anywhere: bool = False
    orbits: bool = False
    standard_properties: bool = False
    floor: FlightFloorKind | None = None
    top_speed: TopSpeed | None = None
    stays: bool = False
    drift_factor: Annotated[float, msgspec.Meta(ge=1)] | None = None
    in_band: bool = False
    overshoot: Annotated[float, msgspec.Meta(ge=1)] | None = None
    least_power: Annotated[float, msgspec.Meta(gt=0, le=1)] | None = None

    def is_above_start(self, verb: str, argument: str) -> bool:
        """True if an argument is a height over the body's place."""
        told = self.verbs.get(verb)
        return told is not None and argument in told.above_start


class KindsFile(_Record, frozen=True, kw_only=True):
    """What one file says, with `like` resolved (`joined`)."""

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
    """The decoded text of a file with `like` resolved: each scene with all that the ones it is like say.

    What is of another type than it should be stays as it is.
    """
    scenes = document.get("scenes") if isinstance(document, dict) else None
    if not isinstance(document, dict) or not isinstance(scenes, list):
        return document
    named = {scene["name"]: scene for scene in scenes if isinstance(scene, dict) and isinstance(scene.get("name"), str)}
    return document | {"scenes": [_joined(scene, named) if isinstance(scene, dict) else scene for scene in scenes]}


def names_of(spelled: str, option: SceneOption) -> tuple[str, ...]:
    """What an instance calls the values of an option: `height` is `height_low_m` and `height_high_m`."""
    return tuple(spelled + suffix for suffix in _SUFFIXES.get(option.type, ("",)))


# -- private


def _joined(scene: dict[str, Any], named: dict[str, Any], passed: tuple[str, ...] = ()) -> dict[str, Any]:
    like = scene.get("like")
    if not isinstance(like, str) or like not in named or like in passed:
        return scene
    base = _joined(named[like], named, (*passed, like))
    given, own = base.get("options", {}), scene.get("options", {})
    inherited = {field: value for field, value in base.items() if field not in ("name", "like")}
    if not isinstance(given, dict) or not isinstance(own, dict):
        return inherited | scene
    options = {name: _option_joined(given.get(name), option) for name, option in own.items()}
    return inherited | scene | {"options": given | options}


def _option_joined(base: object, option: object) -> object:
    return base | option if isinstance(base, dict) and isinstance(option, dict) else option
