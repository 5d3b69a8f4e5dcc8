"""Read OpenStreetMap files (XML and PBF, compressed or not): recognise, parse, normalise.

All other modules use the resulting `MapData`, and so does netconvert (`streets` writes its input from it). So the order
of a file, its format, its history and its metadata make no difference (ADR 0021).
"""

from __future__ import annotations

import hashlib
from pathlib import Path

from lingjing.errors import UsageError
from lingjing.scene.osm import pbf_format
from lingjing.scene.osm.map_data import MapCollector, MapData
from lingjing.scene.osm.pbf_format import read_pbf
from lingjing.scene.osm.source import HINT, recognise
from lingjing.scene.osm.xml_format import read_xml


def read(path: Path) -> MapData:
    """Return the normalised content of a file.

    Raises `UsageError` if it is missing, empty, incomplete, no OpenStreetMap data of streets and houses, or unpacks to
    an implausible size.
    """
    source = recognise(path)
    collector = MapCollector()
    (read_pbf if source.encoding == "pbf" else read_xml)(source, collector)
    if collector.is_lanelet():
        raise _lanelet(path, collector)
    data = collector.finish()
    if not data.nodes:
        raise UsageError(f"`{path}` holds no map: not one node with a position", hint=_no_nodes_hint(data))
    return data


def check(path: Path) -> None:
    """Raise `UsageError` if the file is missing or empty, or begins like a file of another format."""
    recognise(path)


def digest(path: Path) -> str:
    """SHA-256 of a file's bytes."""
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise UsageError(f"cannot read `{path}`: {error.strerror}") from None


def versions() -> dict[str, str]:
    """Versions of the libraries that read map files."""
    return pbf_format.versions()


# -- private


def _no_nodes_hint(data: MapData) -> str:
    if not data.ways and not data.relations:
        return HINT
    return "the file has ways without their nodes: ask Overpass for `out geom;`, or `(._;>;); out;`"


def _lanelet(path: Path, collector: MapCollector) -> UsageError:
    """The error for a Lanelet2 map, which stores lanes in OpenStreetMap's XML."""
    hint = "give the OpenStreetMap data of the same place"
    places = list(collector.places())
    if places:
        latitudes, longitudes = zip(*places, strict=True)
        box = ",".join(f"{value:.4f}" for value in (min(longitudes), min(latitudes), max(longitudes), max(latitudes)))
        hint += f" ({box} as W,S,E,N)"
    return UsageError(f"`{path}` is a Lanelet2 map: it has lanes, and no streets and houses", hint=hint)
