"""Read OpenStreetMap files: `.osm`, `.osm.gz`, `.osm.bz2` and `.osm.pbf`; the only module that imports osmium.

Everything is kept as it stands in the file, in the order of ids, so that the order of a file (nodes may come last) and
its format make no difference.
"""

from __future__ import annotations

import bz2
import gzip
import hashlib
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lingjing.errors import UsageError
from lingjing.installation import install_line

SUFFIXES = (".osm", ".osm.gz", ".osm.bz2", ".osm.pbf", ".pbf", ".osm.xml")
STRETCH = 100
"""How many times its own size a map may unpack to: map XML shrinks to a tenth or a twentieth, bombs to a thousandth."""

_WINDOW = 64 << 20
_CHUNK = 1 << 20
_FEW = 100_000

DegreeBox = tuple[float, float, float, float]
"""West, south, east, north in degrees."""


@dataclass(frozen=True, slots=True)
class MapSpot:
    """A node that has tags; degrees."""

    id: int
    tags: dict[str, str]
    latitude: float
    longitude: float


@dataclass(frozen=True, slots=True)
class Way:
    """A line through nodes, closed if its first node is its last."""

    id: int
    tags: dict[str, str]
    nodes: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class MapRelation:
    """A multipolygon or a turn restriction: its members as (`n`, `w` or `r`, id, role)."""

    id: int
    tags: dict[str, str]
    members: tuple[tuple[str, int, str], ...]


@dataclass(frozen=True, slots=True)
class MapData:
    """What a file holds. `nodes` are (latitude, longitude) by id; `box` is what the file says it covers, if it does."""

    nodes: dict[int, tuple[float, float]]
    spots: tuple[MapSpot, ...]
    ways: tuple[Way, ...]
    relations: tuple[MapRelation, ...]
    box: DegreeBox | None


def read(path: Path) -> MapData:
    """The contents of a file. `UsageError` if it is missing, empty, no OpenStreetMap data, or unpacks without end."""
    check(path)
    _check_unpacked(path)
    left = max(_FEW, path.stat().st_size)
    nodes: dict[int, tuple[float, float]] = {}
    spots, ways, relations = [], [], []
    try:
        import osmium

        with osmium.io.Reader(str(path)) as reader:
            box = reader.header().box()
        for item in osmium.FileProcessor(str(path)):
            if item.deleted:
                continue
            left -= 1 + len(item.tags) + _length(item)
            if left < 0:  # before anything is made of it
                raise _bomb(path, "it holds more than it has bytes")
            if item.is_node():
                if not item.location.valid():
                    continue
                nodes[item.id] = (item.location.lat, item.location.lon)
                if len(item.tags):
                    spots.append(MapSpot(item.id, _tags(item), item.location.lat, item.location.lon))
            elif item.is_way():
                ways.append(Way(item.id, _tags(item), tuple(node.ref for node in item.nodes)))
            elif item.is_relation() and item.tags.get("type") in ("multipolygon", "restriction"):
                members = tuple((member.type, member.ref, member.role) for member in item.members)
                relations.append(MapRelation(item.id, _tags(item), members))
    except ImportError:
        raise _missing() from None
    except (RuntimeError, osmium.InvalidLocationError) as error:
        raise UsageError(f"`{path}` is not OpenStreetMap data: {error}", hint=_HINT) from None
    if not nodes:
        raise UsageError(f"`{path}` holds no map: not one node with a position", hint=_HINT)
    said = (box.bottom_left.lon, box.bottom_left.lat, box.top_right.lon, box.top_right.lat) if box.valid() else None
    return MapData(nodes, _by_id(spots), _by_id(ways), _by_id(relations), said)


def check(path: Path) -> None:
    """`UsageError` unless there is a file that is not empty and whose name says that it is map data."""
    if path.is_dir():
        raise UsageError(f"`{path}` is a folder, not a map", hint="name an .osm or .osm.pbf file")
    if not path.is_file():
        raise UsageError(f"no map at `{path}`: the file does not exist", hint="a path begins in the working folder")
    if not path.name.lower().endswith(SUFFIXES):
        raise UsageError(f"`{path}` is not named like a map", hint=f"known are {', '.join(SUFFIXES)}")
    try:
        if path.stat().st_size == 0:
            raise UsageError(f"`{path}` is empty: 0 bytes", hint="download the map again")
        with path.open("rb") as file:
            file.read(1)
    except OSError as error:
        raise UsageError(f"cannot read `{path}`: {error.strerror}") from None


def digest(path: Path) -> str:
    """SHA-256 of a file's bytes."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def versions() -> dict[str, str]:
    """Versions of what decides how a file is read."""
    try:
        import osmium.version
    except ImportError:
        raise _missing() from None
    return {"osmium": osmium.version.pyosmium_release, "libosmium": osmium.version.libosmium_version}


# -- private

_HINT = "give the map as it was downloaded (.osm, .osm.gz, .osm.bz2 or .osm.pbf)"


def _check_unpacked(path: Path) -> None:
    """`UsageError` if a packed file unpacks to far more than maps do; read to its end, never held."""
    kind = path.suffix.lower()
    if kind not in (".gz", ".bz2"):
        return
    try:
        with path.open("rb") as packed:
            plain = gzip.GzipFile(fileobj=packed) if kind == ".gz" else bz2.BZ2File(packed)
            before = count = 0
            while chunk := plain.read(_CHUNK):
                count += len(chunk)
                if count >= _WINDOW:
                    if count > STRETCH * (packed.tell() - before):
                        raise _bomb(path, f"it unpacks to more than {STRETCH} times its size")
                    before, count = packed.tell(), 0
    except (OSError, EOFError, zlib.error) as error:
        raise UsageError(f"`{path}` is not OpenStreetMap data, it cannot be unpacked: {error}", hint=_HINT) from None


def _bomb(path: Path, why: str) -> UsageError:
    return UsageError(f"`{path}` is no map: {why}", hint=_HINT)


def _length(item: Any) -> int:
    """Nodes of a way, members of a relation."""
    return len(item.nodes) if item.is_way() else len(item.members) if item.is_relation() else 0


def _missing() -> UsageError:
    return UsageError("reading maps needs the package `osmium`", hint=install_line("maps"))


def _tags(item: Any) -> dict[str, str]:
    return {tag.k: tag.v for tag in item.tags}


def _by_id(items: list[Any]) -> tuple[Any, ...]:
    return tuple(sorted(items, key=lambda item: item.id))
