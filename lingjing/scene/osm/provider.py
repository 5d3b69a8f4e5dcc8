"""The `map` scene: a city that `lingjing scene build` wrote, or one built from a map file and cached.

Options: `folder` (a city's folder), or `file` (also `map`; an OpenStreetMap file), with `bbox` (`"W,S,E,N"` in degrees)
for a part of it, `default_levels` for buildings without tagged height, and `furniture`. Paths are relative to the
working folder. A mission's `datum` gives the elevation of the waters. Random details are those of `lingjing scene
build` with its default seed, whatever the mission's seed.
"""

from __future__ import annotations

from math import dist
from pathlib import Path

import msgspec

from lingjing.errors import UsageError, hint_of
from lingjing.mission.frames import from_geodetic
from lingjing.mission.instance import SceneSpec
from lingjing.mission.kinds import check_scene
from lingjing.scene.city import City
from lingjing.scene.osm.build import Options, build
from lingjing.scene.osm.frame import parse_box
from lingjing.scene.store import intact_city, read_store


def city_of(spec: SceneSpec) -> City:
    """The city of a spec. Raises `UsageError` for options that are unknown or name no city."""
    check_scene(spec)
    name = next(name for name in ("folder", "file", "map") if name in spec.options)
    path = str(spec.options[name])
    stored = name == "folder" or Path(path).is_dir()
    for option in ("bbox", "default_levels", "furniture"):
        if stored and option in spec.options:
            raise UsageError(
                f"scene `map`: a folder is a finished city, `{option}` cannot change it", hint="name the map's `file`"
            )
    city = _stored(Path(path)) if stored else _built(spec, Path(path))
    _check_origin(spec, city)
    return _at_level(city, spec.datum_m)


# -- private


def _stored(folder: Path) -> City:
    try:
        city = read_store(folder.absolute())
        if intact_city(folder.absolute()) is None:
            raise UsageError(
                f"the city in `{folder}` is damaged: its files have changed since they were written",
                hint="build it again: lingjing scene build",
            )
        return city
    except UsageError as error:
        where = "" if folder.is_absolute() else f" (from the working folder `{Path.cwd()}`)"
        raise UsageError(f"scene `map`: {error}{where}", hint=hint_of(error)) from None


def _built(spec: SceneSpec, path: Path) -> City:
    box = parse_box(str(spec.options["bbox"])) if "bbox" in spec.options else None
    try:
        levels, furnished = _default_levels(spec), bool(spec.options.get("furniture"))
        return build(path.absolute(), Options(box=box, default_levels=levels, furniture=furnished)).city
    except UsageError as error:
        raise UsageError(f"scene `map`: {error}", hint=hint_of(error)) from None


def _default_levels(spec: SceneSpec) -> int | None:
    levels = spec.options.get("default_levels")
    if levels is None:
        return None
    if not isinstance(levels, int | float) or levels != int(levels):
        raise UsageError(f"`default_levels` is {levels}, not a whole number", hint="write: default_levels = 3")
    return int(levels)


def _check_origin(spec: SceneSpec, city: City) -> None:
    """Check that a mission's own origin is the city's: its places in degrees are already in metres about that
    origin."""
    if spec.origin == SceneSpec(kind="").origin:
        return
    apart = dist((0.0, 0.0), from_geodetic(*spec.origin, city.origin))
    if apart > 0.5:
        raise UsageError(
            f"scene `map`: the mission's origin is {apart:.0f} m from the city's",
            hint=f"write: origin = ({city.origin[0]:.7f} deg, {city.origin[1]:.7f} deg)",
        )


def _at_level(city: City, datum_m: float) -> City:
    """The city with its waters at the mission's datum. A datum of 0, the ground's elevation, means that none is
    declared.
    """
    if datum_m == 0.0:
        return city
    if datum_m > -0.3:
        raise UsageError(
            f"scene `map`: waters at {datum_m:g} m would flood the ground, which is at 0 m",
            hint="write: datum = sea level at -1.5 m",
        )
    if all(body.level_m == datum_m for body in city.waters):
        return city
    waters = tuple(msgspec.structs.replace(body, level_m=datum_m) for body in city.waters)
    return msgspec.structs.replace(city, waters=waters, sha256=f"{city.sha256}@{datum_m:g}")
