"""Where the files that ship with the package are: the standard library, the missions and the schemas.

A wheel carries them under `lingjing/_data`; an editable installation reads the repository's own folders, so that an
edit there counts at once. What can be made again is kept in the user's cache folder, or in a temporary one where that
cannot be written.
"""

from __future__ import annotations

import contextlib
import os
from pathlib import Path
from typing import NamedTuple

_PACKAGE = Path(__file__).resolve().parent
_PACKAGED = _PACKAGE / "_data"
_FOLDERS = {
    "std": Path("scenarios", "std"),
    "scenarios": Path("scenarios"),
    "schemas": Path("schemas"),
    "suites": Path("suites"),
    "errors": Path("docs", "errors"),
}


def data_path(*parts: str) -> Path:
    """The path of shipped data: the first part is `std`, `scenarios`, `schemas`, `suites` or `errors` (the
    pages of the error codes), the rest goes below it.

    The packaged copy wins; without one the repository's folder answers. The path need not exist. An unknown first
    part raises `KeyError`.
    """
    kind, *rest = parts
    root = _PACKAGED if _PACKAGED.is_dir() else _PACKAGE.parent
    return root.joinpath(_FOLDERS[kind], *rest)


CACHE_OFF = "LINGJING_NO_CACHE"
"""Environment variable: set to anything but 0, nothing is read from or kept in the caches of missions, of cities made
from maps and of meshes."""


def cache_is_off() -> bool:
    """Whether the user wants everything made anew."""
    return os.environ.get(CACHE_OFF, "0") not in ("", "0")


CACHE_KINDS = ("missions", "cities", "networks", "meshes", "shaders")
"""The folders within the cache."""

LEAST_FREE_BYTES = 32 << 20
"""With less room a folder counts as full. Chosen: ten road networks of shipped missions (up to 3.4 MB each)."""


class CacheChoice(NamedTuple):
    """The cache that is used: its `folder`; `refused`, why the user's own is not used ("" where it is); `is_usable`,
    False where no temporary folder can be written either and `folder` is the user's own all the same."""

    folder: str
    refused: str = ""
    is_usable: bool = True


def user_cache_folder() -> str:
    """The folder of files that the project can make again.

    A relative XDG_CACHE_HOME is ignored, as the XDG base directory specification says: processes of one episode have
    working folders of their own.
    """
    base = os.environ.get("XDG_CACHE_HOME", "")
    own = base if os.path.isabs(base) else os.path.expanduser("~/.cache")  # noqa: PTH111, PTH117 - a cold start
    return os.path.join(own, "lingjing")  # noqa: PTH118


def choose_cache() -> CacheChoice:
    """The user's cache folder, or a temporary one of the user's where nothing can be written in that."""
    own = user_cache_folder()
    refused = write_fault(own)
    if not refused:
        return CacheChoice(own)
    temporary = _temporary_cache()
    return CacheChoice(temporary or own, refused, bool(temporary))


def cache_folder() -> str:
    """The folder of the cache that is written to; see `choose_cache`."""
    return choose_cache().folder


def kept_path(*parts: str) -> str:
    """Where to read something of the cache: in the user's own folder, if it is there and the folder is not used only
    because it cannot be written; else in the folder that is used."""
    folder = cache_folder()
    own = os.path.join(user_cache_folder(), *parts)  # noqa: PTH118 - a cold start
    return own if os.path.exists(own) else os.path.join(folder, *parts)  # noqa: PTH110, PTH118


def write_fault(folder: str) -> str:
    """Why nothing can be kept in a folder of the cache, there or to be made; "" if it can."""
    places = (folder, *(os.path.join(folder, kind) for kind in CACHE_KINDS))  # noqa: PTH118 - a cold start
    try:
        faults = (_write_fault(place) for place in dict.fromkeys(map(_existing, places)))
        return next(filter(None, faults), "")
    except OSError as error:
        return f"`{folder}`: {error.strerror}"


def _existing(place: str) -> str:
    """A place, or the nearest one above it that is there."""
    while not os.path.lexists(place):
        above = os.path.dirname(place) or "."  # noqa: PTH120
        if above == place:  # a working folder that was removed, or a disk that answers no question
            break
        place = above
    return place


def _write_fault(place: str) -> str:
    if not os.path.isdir(place):  # noqa: PTH112
        return f"`{place}` is no folder"
    state = os.statvfs(place)
    if state.f_flag & os.ST_RDONLY:
        return f"`{place}` is on a read-only file system"
    if not os.access(place, os.W_OK | os.X_OK):
        return f"`{place}` may not be written"
    if state.f_bavail * state.f_frsize < LEAST_FREE_BYTES or (state.f_files and not state.f_favail):
        return f"no space is left for `{place}`"
    return ""


def _temporary_cache() -> str:
    """A folder that no other user can write; "" where none can be made. Others may have made one of its name first."""
    import stat
    import tempfile

    try:
        base = os.path.join(tempfile.gettempdir(), f"lingjing-cache-{os.geteuid()}")  # noqa: PTH118 - as above
        for folder in (base, *(f"{base}-{number}" for number in range(1, 10))):
            with contextlib.suppress(FileExistsError):
                os.mkdir(folder, 0o700)  # noqa: PTH102
            state = os.lstat(folder)
            is_own = state.st_uid == os.geteuid() and not state.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
            if stat.S_ISDIR(state.st_mode) and is_own and not write_fault(folder):
                return folder
    except OSError:
        pass  # no place for temporary files, or one that is full
    return ""
