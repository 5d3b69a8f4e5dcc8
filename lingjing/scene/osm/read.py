"""Read OpenStreetMap files (XML and PBF, packed or not): recognise, parse, normalise.

Every other module sees the `MapData` that comes out here, netconvert too (`streets` writes its document from it), so
the order of a file, its format, its history and its metadata make no difference.
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
    """The normalised contents of a file.

    `UsageError` if it is missing, empty, not whole, no OpenStreetMap data of streets and houses, or unpacks without
    end.
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
    """`UsageError` unless there is a file that is not empty and does not begin as another kind of file does."""
    recognise(path)


def digest(path: Path) -> str:
    """SHA-256 of a file's bytes."""
    try:
        with path.open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise UsageError(f"cannot read `{path}`: {error.strerror}") from None


def versions() -> dict[str, str]:
    """Versions of what decides how a file is read."""
    return pbf_format.versions()


# -- private


def _no_nodes_hint(data: MapData) -> str:
    if not data.ways and not data.relations:
        return HINT
    return "the file has ways without their nodes: ask Overpass for `out geom;`, or `(._;>;); out;`"


def _lanelet(path: Path, collector: MapCollector) -> UsageError:
    """Lanelet2 writes its lanes in OpenStreetMap's XML."""
    hint = "give the OpenStreetMap data of the same place"
    places = list(collector.places())
    if places:
        latitudes, longitudes = zip(*places, strict=True)
        box = ",".join(f"{value:.4f}" for value in (min(longitudes), min(latitudes), max(longitudes), max(latitudes)))
        hint += f" ({box} as W,S,E,N)"
    return UsageError(f"`{path}` is a Lanelet2 map: it has lanes, and no streets and houses", hint=hint)
