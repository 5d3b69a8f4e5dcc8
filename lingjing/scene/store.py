"""A city in a folder: its frame in one file, its pieces in tiles, its road network beside them.

    city.msgpack         format, and the `City` with its waters and lands, without its other pieces
    tiles/<i>_<j>.msgpack, tiles/index.msgpack
    road.net.xml         only for a city with roads
    …                    additional files of the writer (`scene.json`)

A folder appears complete or not at all. It is written beside its final place and renamed; an older one is exchanged for
it in one step. A folder that already holds the same city is left unchanged, so that running episodes keep their files.
A folder may be moved: `read_store` gives paths at its present place, and `City.sha256` depends on the content alone.
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
from lingjing.decoding import from_msgpack
from lingjing.errors import UsageError
from lingjing.scene.atomic_folder import folder_beside
from lingjing.scene.city import City, Pieces
from lingjing.scene.cutting import cut
from lingjing.scene.tiles import INDEX_FILE, TILED, TileIndex, extent, partition, tile_file

CITY_FILE = "city.msgpack"
"""File of the frame."""
NETWORK_FILE = "road.net.xml"
"""File of the road network."""
_ATTEMPTS = 100
"""Attempts to replace a folder in two steps while other writers interfere (chosen)."""
_AT_FDCWD = -100
"""Linux's constant of renameat2(2): paths are relative to the working directory."""
_RENAME_EXCHANGE = 2
"""Linux's flag of renameat2(2): exchange the two paths."""
_DECIDING = ("camera_geometry", "city", "cutting", "lines", "network", "outlines", "store", "tiles")
"""Modules of this package that decide the content of a city. Cache keys include their hash."""
ResultT = TypeVar("ResultT")

BUILD_HINT = "a city's folder is written by: lingjing scene build MAP.osm -o FOLDER"


class Document(msgspec.Struct, frozen=True, kw_only=True):
    """Content of `city.msgpack`. The paths in `city` are relative to the folder."""

    format: Literal["lingjing-city/1"] = "lingjing-city/1"
    city: City


def write_store(folder: Path, city: City, pieces: Pieces, extra: Mapping[str, bytes] | None = None) -> City:
    """Write a city into a folder of tiles and return it as `read_store` would.

    `city`: the frame, with pieces that belong to no tile. `pieces`: waters and lands join those of `city`; all others
    go into tiles, and long ones are cut at the squares. The network that `city` names is copied. `extra`: contents of
    additional files by name. An older city in the folder is replaced. Raises `UsageError` if the folder holds anything
    else or cannot be written.
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
    """The folder of built cities: `cities` in the project's cache folder (`$XDG_CACHE_HOME/lingjing`)."""
    return Path(cache_folder(), "cities")


def code_sha256(package: Path) -> str:
    """SHA-256 over the modules that decide a provider's result: those of its package and those named by `_DECIDING`."""
    digest = hashlib.sha256()
    here = Path(__file__).parent
    for file in (*sorted(package.glob("*.py")), *(here / f"{name}.py" for name in _DECIDING)):
        digest.update(file.name.encode() + b"\0" + hashlib.sha256(file.read_bytes()).digest())
    return digest.hexdigest()


def copy_store(source: Path, folder: Path) -> City:
    """Copy a city's folder to another place, completely or not at all. Errors are those of `write_store`."""
    check_free(folder)
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        with folder_beside(folder) as temporary:
            _steady(source, lambda _: _copied(source, temporary))
            return _placed(temporary, folder)
    except OSError as error:
        raise _unwritable(folder, error) from None


def read_store(folder: Path) -> City:
    """Read the city of a folder. Raises `UsageError` if the folder holds none, or a damaged one."""
    try:
        data = _steady(folder, _frame_bytes)
        if data is None:
            raise UsageError(f"no city in `{folder}`: it holds no `{CITY_FILE}`", hint=BUILD_HINT)
        city = from_msgpack(data, Document).city
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
    """Raise `UsageError` if a city cannot be written to `folder`: a file, a folder of other content, or no
    permission."""
    try:
        names = _steady(folder, os.listdir)
    except FileNotFoundError:
        names = []
    except NotADirectoryError:  # `folder` itself, or one of its parents, which is checked below
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


def intact_city(folder: Path) -> City | None:
    """Return the city of a folder if every byte of it is intact, else None. For caches: their files may be damaged."""
    try:
        return _steady(folder, lambda _: _checked(folder))
    except (UsageError, OSError, msgspec.DecodeError):
        return None


# -- private


def _steady(folder: Path, look: Callable[[int], ResultT]) -> ResultT:
    """Return `look(descriptor)` for the folder of that name; repeat it if another writer replaced the folder meanwhile.

    Errors count only if the folder is still in place, such as `FileNotFoundError` if there is none.
    """
    while True:
        descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
        try:
            result = look(descriptor)
            if _in_place(descriptor, folder):
                return result
        except (OSError, UsageError, msgspec.DecodeError):
            if _in_place(descriptor, folder):
                raise
        finally:
            os.close(descriptor)


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
    shutil.rmtree(target)  # the remainder of an earlier attempt, from a city that was replaced meanwhile
    shutil.copytree(source, target)


def _checked(folder: Path) -> City | None:
    city = read_store(folder)
    index = from_msgpack((folder / INDEX_FILE).read_bytes(), TileIndex)
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
    """Add the network and the frame to the hash of a city's content, after its tiles."""
    if light.network:
        digest.update(hashlib.sha256((folder / NETWORK_FILE).read_bytes()).digest())
    digest.update(msgspec.msgpack.encode(light))


def _placed(temporary: Path, folder: Path) -> City:
    """Move the written folder to its final place. Return its city, read before another writer can replace it."""
    city = read_store(temporary)
    if not _is_there(city, temporary, folder):
        _replace(temporary, folder)
    network = str(folder / NETWORK_FILE) if city.network else ""
    return msgspec.structs.replace(city, store=str(folder), network=network)


def _is_there(city: City, temporary: Path, folder: Path) -> bool:
    """True if the folder already holds the same city, intact, with the same additional files."""
    there = intact_city(folder)
    if there is None or there.sha256 != city.sha256:
        return False
    names = [path.name for path in temporary.iterdir() if path.is_file()]
    same, _, _ = filecmp.cmpfiles(temporary, folder, names, shallow=False)
    return len(same) == len(names)


def _replace(temporary: Path, folder: Path) -> None:
    """Move the written folder to its final place. An older city moves to the temporary place and is removed with it."""
    try:
        temporary.replace(folder)  # works if there is no folder, or an empty one
    except OSError as error:
        is_link = error.errno == errno.ENOTDIR and folder.is_dir()
        if error.errno not in (errno.ENOTEMPTY, errno.EEXIST) and not is_link:
            raise
        if not _exchanged(temporary, folder):
            _replace_in_two_steps(temporary, folder)


def _exchanged(first: Path, second: Path) -> bool:
    """Exchange two folders atomically by renameat2(2). False if the system or the file system does not support it."""
    renameat2 = getattr(ctypes.CDLL(None, use_errno=True), "renameat2", None)
    if renameat2 is None:
        return False
    return bool(renameat2(_AT_FDCWD, os.fsencode(first), _AT_FDCWD, os.fsencode(second), _RENAME_EXCHANGE) == 0)


def _replace_in_two_steps(temporary: Path, folder: Path) -> None:
    """Replace a folder in two steps, where folders cannot be exchanged.

    Another writer may put its folder there between the steps; the next attempt replaces that one.
    """
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
    backups = sorted(temporary.parent.glob("old-*"))
    if backups and not folder.exists():
        backups[-1].replace(folder)


def _unwritable(folder: Path, error: OSError) -> UsageError:
    """The error for a folder that cannot be written.

    `shutil.Error`, a list of failed copies, is an `OSError` without `strerror`.
    """
    reason = error.args[0][0][2] if isinstance(error, shutil.Error) else error.strerror or str(error)
    first = re.sub(r"^\[Errno \d+\] ([^:]*).*$", r"\1", reason, flags=re.DOTALL)
    return UsageError(f"cannot write `{folder}`: {first}", hint="choose another place with -o")
