"""A city as a file of other programs: `lingjing scene export`.

Each format is written through a library, and a test reads it back with the reader of the format. World coordinates
(east, north, elevation) stay as they are, and each file names the projection that turns them into WGS84: a transverse
Mercator about the city's origin (`projection`). GeoJSON holds degrees.

- `glb` (glTF 2.0, trimesh): ground, waters, roads and buildings as meshes, one node for each building.
- `geojson` (shapely): every piece with its properties, in degrees.
- `sumo`: the road network, which SUMO, netedit and sumolib open.
- `mjcf` (mujoco): the solid shapes as static geoms, as the robot dogs touch them.

`write_city` chooses the writer and writes the file whole or not at all.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from pathlib import Path

from lingjing.errors import UsageError
from lingjing.scene.city import City
from lingjing.suggest import nearest_or
from lingjing.whole_files import written_whole

SUFFIXES = {"glb": ".glb", "geojson": ".geojson", "sumo": ".net.xml", "mjcf": ".xml"}
"""The formats with the usual ends of their files' names."""

Encode = Callable[[City], bytes]


def projection(city: City) -> str:
    """Return the projection of world coordinates, for PROJ. East and north are metres from the city's origin."""
    latitude, longitude = city.origin
    return f"+proj=tmerc +lat_0={latitude!r} +lon_0={longitude!r} +k=1 +x_0=0 +y_0=0 +ellps=WGS84 +units=m"


def write_city(city: City, kind: str, path: Path) -> int:
    """Write a city in a format, and return the number of bytes.

    Raises `UsageError` for an unknown format, a city that lacks what the format holds, a package that is not installed,
    and a file that cannot be written; nothing half-written stays behind.
    """
    if kind not in SUFFIXES:
        raise UsageError(
            f"no format is called `{kind}`", hint=nearest_or(kind, SUFFIXES, f"there are: {', '.join(SUFFIXES)}")
        )
    encode: Encode = import_module(f"lingjing.scene.exports.{kind}").encode
    return write_export(path, encode(city))


def write_export(path: Path, data: bytes) -> int:
    """Write an exported file whole or not at all, and return its number of bytes. Raises `UsageError` if that fails."""
    try:
        with written_whole(path) as partial:
            partial.write_bytes(data)
    except OSError as error:
        hint = "free some space, or choose another place with -o; nothing was left behind"
        raise UsageError(f"cannot write `{path}`: {error.strerror or error}", hint=hint) from error
    return len(data)


__all__ = ["SUFFIXES", "projection", "write_city", "write_export"]
