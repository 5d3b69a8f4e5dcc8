"""A city in a folder: its frame and what is everywhere in one file, its pieces in tiles, its road network beside them.

    city.msgpack         format, and the `City` without its pieces
    tiles/<i>_<j>.msgpack, tiles/index.msgpack
    road.net.xml         where the city has roads
    …                    whatever else the writer says (`scene.json`)

A folder appears whole or not at all: it is written beside and renamed, and an older one changes places with it in one
step. A folder that already holds the very same city is left as it is, so that who plays in it keeps it. It may be
moved: the paths of the `City` that `read_store` gives are those of where it lies now, and `City.sha256` says what is in
it, not where.
"""

from __future__ import annotations

import ctypes
import errno
import filecmp
import hashlib
import os
import re
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Literal, TypeVar

import msgspec

from lingjing.data import cache_folder
from lingjing.errors import UsageError
from lingjing.scene.atomic_folder import folder_beside
from lingjing.scene.city import City, Pieces
from lingjing.scene.cutting import cut
from lingjing.scene.tiles import INDEX_FILE, TILED, TileIndex, extent, partition, tile_file

CITY_FILE = "city.msgpack"
NETWORK_FILE = "road.net.xml"
_ATTEMPTS = 100
"""How often another writer may come in between before we give up, where two folders cannot change places."""
_AT_FDCWD = -100
_RENAME_EXCHANGE = 2
_DECIDING = ("camera_geometry", "city", "cutting", "lines", "network", "outlines", "store", "tiles")
"""Modules of this package whose change may give another city."""
FoundT = TypeVar("FoundT")

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
    check_free(folder)
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        with folder_beside(folder) as temporary:
            _write_files(temporary, city, pieces, extra or {})
            return _placed(temporary, folder)
    except OSError as error:
        raise _unwritable(folder, error) from None


def cities_folder() -> Path:
    """Where built cities are kept: `cities` in the project's cache folder (`$XDG_CACHE_HOME/lingjing`)."""
    return Path(cache_folder(), "cities")


def code_sha256(package: Path) -> str:
    """SHA-256 over the modules that decide what a provider builds: its package's, and those of cities beside it."""
    digest = hashlib.sha256()
    here = Path(__file__).parent
    for file in (*sorted(package.glob("*.py")), *(here / f"{name}.py" for name in _DECIDING)):
        digest.update(file.name.encode() + b"\0" + hashlib.sha256(file.read_bytes()).digest())
    return digest.hexdigest()


def copy_store(source: Path, folder: Path) -> City:
    """A copy of a city's folder at another place, whole or not at all; errors as in `write_store`."""
    check_free(folder)
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        with folder_beside(folder) as temporary:
            _steady(source, lambda _: _copied(source, temporary))
            return _placed(temporary, folder)
    except OSError as error:
        raise _unwritable(folder, error) from None


def read_store(folder: Path) -> City:
    """The city of a folder. `UsageError` if the folder holds none, or one that is damaged."""
    try:
        data = _steady(folder, _frame_bytes)
        if data is None:
            raise UsageError(f"no city in `{folder}`: it holds no `{CITY_FILE}`", hint=BUILD_HINT)
        city = msgspec.msgpack.decode(data, type=Document).city
    except (FileNotFoundError, NotADirectoryError) as error:
        is_file = isinstance(error, NotADirectoryError) and folder.exists()
        what = "is a file, not a folder" if is_file else "does not exist"
        raise UsageError(f"no city in `{folder}`: it {what}", hint=BUILD_HINT) from None
    except OSError as error:
        raise UsageError(f"cannot read `{folder / CITY_FILE}`: {error.strerror}") from None
    except (msgspec.DecodeError, msgspec.ValidationError) as error:
        hint = "build it again: lingjing scene build"
        raise UsageError(f"the city in `{folder}` is damaged, or of another version: {error}", hint=hint) from None
    network = str(folder / city.network) if city.network else ""
    return msgspec.structs.replace(city, store=str(folder), network=network)


def check_free(folder: Path) -> None:
    """`UsageError` where no city may be written: a file, a folder of something else, a place that is not ours."""
    try:
        names = _steady(folder, os.listdir)
    except FileNotFoundError:
        names = []
    except NotADirectoryError:  # itself, or one of those above it, of which more below
        if folder.exists():
            raise UsageError(f"cannot write `{folder}`: it is a file", hint="name a folder") from None
        names = []
    except OSError as error:
        raise _unwritable(folder, error) from None
    if names and CITY_FILE not in names:
        raise UsageError(f"cannot write `{folder}`: it holds something that is no city", hint="name a new folder")
    around = next(place for place in folder.absolute().parents if place.exists())
    if not around.is_dir() or not os.access(around, os.W_OK):
        why = "nothing may be written there" if around.is_dir() else "it is a file"
        raise UsageError(f"cannot write `{folder}` in `{around}`: {why}", hint="choose another place with -o")


def whole(folder: Path) -> City | None:
    """The city of a folder if every byte that makes it is as it was written, else None: for caches, which may rot."""
    try:
        return _steady(folder, lambda _: _checked(folder))
    except (UsageError, OSError, msgspec.DecodeError):
        return None


# -- private


def _steady(folder: Path, look: Callable[[int], FoundT]) -> FoundT:
    """What `look` finds in the folder of that name, of which it gets a descriptor; anew if another writer put a new one
    in its place meanwhile. The errors are those of a folder that stays: `FileNotFoundError` where there is none."""
    while True:
        here = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
        try:
            found = look(here)
            if _in_place(here, folder):
                return found
        except (OSError, UsageError, msgspec.DecodeError):
            if _in_place(here, folder):
                raise
        finally:
            os.close(here)


def _in_place(descriptor: int, folder: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(descriptor), folder.stat())
    except (FileNotFoundError, NotADirectoryError):
        return False


def _frame_bytes(folder: int) -> bytes | None:
    try:
        descriptor = os.open(CITY_FILE, os.O_RDONLY, dir_fd=folder)
    except FileNotFoundError:
        return None
    with os.fdopen(descriptor, "rb") as file:
        return file.read()


def _copied(source: Path, target: Path) -> None:
    shutil.rmtree(target)  # what an attempt before left, of a city that is gone
    shutil.copytree(source, target)


def _checked(folder: Path) -> City | None:
    city = read_store(folder)
    index = msgspec.msgpack.decode((folder / INDEX_FILE).read_bytes(), type=TileIndex)
    digest = hashlib.sha256()
    for key in city.tiles:
        digest.update(hashlib.sha256((folder / tile_file(key)).read_bytes()).digest())
    light = msgspec.structs.replace(city, store="", sha256="", network=NETWORK_FILE if city.network else "")
    _close(digest, folder, light)
    return city if digest.hexdigest() == city.sha256 and index.keys == city.tiles else None


def _write_files(folder: Path, city: City, pieces: Pieces, extra: Mapping[str, bytes]) -> None:
    tiles = partition(cut(pieces, city.tile_m), city.tile_m)
    digest = hashlib.sha256()
    (folder / "tiles").mkdir()
    for key, tile in tiles.items():
        data = msgspec.msgpack.encode(tile)
        digest.update(hashlib.sha256(data).digest())
        (folder / tile_file(key)).write_bytes(data)
    index = TileIndex(tuple(tiles), tuple(extent(tile, city.tile_m) for tile in tiles.values()))
    (folder / INDEX_FILE).write_bytes(msgspec.msgpack.encode(index))
    if city.network:
        shutil.copyfile(city.network, folder / NETWORK_FILE)
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
    _close(digest, folder, light)
    light = msgspec.structs.replace(light, sha256=digest.hexdigest())
    for name, data in extra.items():
        (folder / name).write_bytes(data)
    (folder / CITY_FILE).write_bytes(msgspec.msgpack.encode(Document(city=light)))


def _close(digest: hashlib._Hash, folder: Path, light: City) -> None:
    """Take the network and the frame into the hash of a city's content, after its tiles."""
    if light.network:
        digest.update(hashlib.sha256((folder / NETWORK_FILE).read_bytes()).digest())
    digest.update(msgspec.msgpack.encode(light))


def _placed(temporary: Path, folder: Path) -> City:
    """Put the written folder where it belongs and give its city, read before another writer can take it away."""
    city = read_store(temporary)
    if not _is_there(city, temporary, folder):
        _replace(temporary, folder)
    network = str(folder / NETWORK_FILE) if city.network else ""
    return msgspec.structs.replace(city, store=str(folder), network=network)


def _is_there(city: City, temporary: Path, folder: Path) -> bool:
    """Whether the folder holds the same city already, whole, with the same files beside it."""
    there = whole(folder)
    if there is None or there.sha256 != city.sha256:
        return False
    names = [path.name for path in temporary.iterdir() if path.is_file()]
    same, _, _ = filecmp.cmpfiles(temporary, folder, names, shallow=False)
    return len(same) == len(names)


def _replace(temporary: Path, folder: Path) -> None:
    """Put the written folder where it belongs; an older city there takes its place, to go away with it."""
    try:
        temporary.replace(folder)  # there is none yet, or an empty one
    except OSError as error:
        is_link = error.errno == errno.ENOTDIR and folder.is_dir()
        if error.errno not in (errno.ENOTEMPTY, errno.EEXIST) and not is_link:
            raise
        if not _exchanged(temporary, folder):
            _replace_in_two_steps(temporary, folder)


def _exchanged(one: Path, other: Path) -> bool:
    """Have two folders change places at once, as renameat2(2) does; False where the system or its disk cannot."""
    renameat2 = getattr(ctypes.CDLL(None, use_errno=True), "renameat2", None)
    if renameat2 is None:
        return False
    return bool(renameat2(_AT_FDCWD, os.fsencode(one), _AT_FDCWD, os.fsencode(other), _RENAME_EXCHANGE) == 0)


def _replace_in_two_steps(temporary: Path, folder: Path) -> None:
    """The same where folders cannot change places. Another writer may put its own there in between the steps: then that
    is the older one."""
    for attempt in range(_ATTEMPTS):
        try:
            if folder.exists():
                folder.replace(temporary.with_name(f"old-{attempt}"))
            temporary.replace(folder)
        except OSError as error:
            if error.errno not in (errno.ENOTEMPTY, errno.EEXIST, errno.ENOENT) or attempt == _ATTEMPTS - 1:
                _put_back(temporary, folder)
                raise
        else:
            return


def _put_back(temporary: Path, folder: Path) -> None:
    taken = sorted(temporary.parent.glob("old-*"))
    if taken and not folder.exists():
        taken[-1].replace(folder)


def _unwritable(folder: Path, error: OSError) -> UsageError:
    """`shutil.Error`, a list of failed copies, is an `OSError` that has no `strerror`."""
    said = error.args[0][0][2] if isinstance(error, shutil.Error) else error.strerror or str(error)
    first = re.sub(r"^\[Errno \d+\] ([^:]*).*$", r"\1", said, flags=re.DOTALL)
    return UsageError(f"cannot write `{folder}`: {first}", hint="choose another place with -o")
