"""A city in a folder: its frame and what is everywhere in one file, its pieces in tiles, its road network beside them.

    city.msgpack         format, and the `City` without its pieces
    tiles/<i>_<j>.msgpack, tiles/index.msgpack
    road.net.xml         where the city has roads
    …                    whatever else the writer says (`scene.json`)

A folder appears whole or not at all: it is written beside and renamed. It may be moved: the paths of the `City` that
`read_store` gives are those of where it lies now, and `City.sha256` says what is in it, not where.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import shutil
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Literal

import msgspec

from lingjing.errors import UsageError
from lingjing.scene.city import City, Pieces
from lingjing.scene.cutting import cut
from lingjing.scene.tiles import INDEX_FILE, TILED, Index, extent, partition, tile_file

CITY_FILE = "city.msgpack"
NETWORK_FILE = "road.net.xml"
BUILD_HINT = "a city's folder is written by: lingjing scene build MAP.osm -o FOLDER"


class Document(msgspec.Struct, frozen=True, kw_only=True):
    """`city.msgpack`: the paths in `city` are relative to the folder."""

    format: Literal["lingjing-city/1"] = "lingjing-city/1"
    city: City


def write_store(folder: Path, city: City, pieces: Pieces, extra: Mapping[str, bytes] | None = None) -> City:
    """Write a city into a folder of tiles and give it as `read_store` would.

    `city` holds the frame and what is everywhere; of `pieces` everything but waters and lands goes into tiles, long
    ones cut at their squares, and waters and lands join those of `city`. A network named by `city` is copied in.
    `extra` are more files by name. An older city in that folder is replaced; `UsageError` if it holds anything else
    or cannot be written.
    """
    _refuse_foreign(folder)
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        with _beside(folder) as temporary:
            _write_files(temporary, city, pieces, extra or {})
            _replace(temporary, folder)
    except OSError as error:
        raise UsageError(f"cannot write `{folder}`: {error.strerror}", hint="choose another place with -o") from None
    return read_store(folder)


def copy_store(source: Path, folder: Path) -> City:
    """A copy of a city's folder at another place, whole or not at all; errors as in `write_store`."""
    _refuse_foreign(folder)
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        with _beside(folder) as temporary:
            shutil.copytree(source, temporary, dirs_exist_ok=True)
            _replace(temporary, folder)
    except OSError as error:
        raise UsageError(f"cannot write `{folder}`: {error.strerror}", hint="choose another place with -o") from None
    return read_store(folder)


def read_store(folder: Path) -> City:
    """The city of a folder. `UsageError` if the folder holds none, or one that is damaged."""
    file = folder / CITY_FILE
    if not folder.is_dir():
        what = "is a file, not a folder" if folder.exists() else "does not exist"
        raise UsageError(f"no city in `{folder}`: it {what}", hint=BUILD_HINT)
    try:
        city = msgspec.msgpack.decode(file.read_bytes(), type=Document).city
    except FileNotFoundError:
        raise UsageError(f"no city in `{folder}`: it holds no `{CITY_FILE}`", hint=BUILD_HINT) from None
    except OSError as error:
        raise UsageError(f"cannot read `{file}`: {error.strerror}") from None
    except (msgspec.DecodeError, msgspec.ValidationError) as error:
        hint = "build it again: lingjing scene build"
        raise UsageError(f"the city in `{folder}` is damaged, or of another version: {error}", hint=hint) from None
    network = str(folder / city.network) if city.network else ""
    return msgspec.structs.replace(city, store=str(folder), network=network)


# -- private


def _refuse_foreign(folder: Path) -> None:
    if folder.exists() and not folder.is_dir():
        raise UsageError(f"cannot write `{folder}`: it is a file", hint="name a folder")
    if folder.is_dir() and not (folder / CITY_FILE).exists() and any(folder.iterdir()):
        raise UsageError(f"cannot write `{folder}`: it holds something that is no city", hint="name a new folder")


def _write_files(folder: Path, city: City, pieces: Pieces, extra: Mapping[str, bytes]) -> None:
    tiles = partition(cut(pieces, city.tile_m), city.tile_m)
    digest = hashlib.sha256()
    (folder / "tiles").mkdir()
    for key, tile in tiles.items():
        data = msgspec.msgpack.encode(tile)
        digest.update(hashlib.sha256(data).digest())
        (folder / tile_file(key)).write_bytes(data)
    index = Index(tuple(tiles), tuple(extent(tile, city.tile_m) for tile in tiles.values()))
    (folder / INDEX_FILE).write_bytes(msgspec.msgpack.encode(index))
    if city.network:
        shutil.copyfile(city.network, folder / NETWORK_FILE)
        digest.update(hashlib.sha256((folder / NETWORK_FILE).read_bytes()).digest())
    light = msgspec.structs.replace(
        city,
        waters=(*city.waters, *pieces.waters),
        lands=(*city.lands, *pieces.lands),
        network=NETWORK_FILE if city.network else "",
        store="",
        tiles=tuple(tiles),
        sha256="",
        **dict.fromkeys(TILED, ()),
    )
    digest.update(msgspec.msgpack.encode(light))
    light = msgspec.structs.replace(light, sha256=digest.hexdigest())
    for name, data in extra.items():
        (folder / name).write_bytes(data)
    (folder / CITY_FILE).write_bytes(msgspec.msgpack.encode(Document(city=light)))


@contextlib.contextmanager
def _beside(folder: Path) -> Iterator[Path]:
    """An empty folder next to `folder` on the same file system, gone at the end; so are those of dead writers."""
    for left in folder.parent.glob(f".{folder.name}.*.part"):
        if not _alive(left.name.split(".")[-2]):
            shutil.rmtree(left, ignore_errors=True)
    temporary = folder.with_name(f".{folder.name}.{os.getpid()}.part")
    shutil.rmtree(temporary, ignore_errors=True)
    temporary.mkdir()
    try:
        yield temporary
    finally:
        shutil.rmtree(temporary, ignore_errors=True)


def _alive(process: str) -> bool:
    if not process.isdigit():
        return False
    try:
        os.kill(int(process), 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return True


def _replace(temporary: Path, folder: Path) -> None:
    """Put the written folder where it belongs; an older city there goes away once the new one stands."""
    if not folder.exists() or not any(folder.iterdir()):
        temporary.replace(folder)
        return
    old = temporary.with_suffix(".old.part")
    folder.replace(old)
    try:
        temporary.replace(folder)
    except OSError:
        old.replace(folder)
        raise
    shutil.rmtree(old, ignore_errors=True)
