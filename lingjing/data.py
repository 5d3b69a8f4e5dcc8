"""The place of the files that ship with the package (standard library, missions, schemas), and of the cache.

A wheel contains them under `lingjing/_data`. An editable installation reads the repository's own folders, so that edits
take effect at once. Files that can be generated again are cached in the user's cache folder, or in a temporary one if
that is not writable.
"""

from __future__ import annotations

import contextlib
import os
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from pathlib import Path  # it takes 4 ms of a cold start

# ruff: noqa: PTH112, PTH118, PTH120

_PACKAGE = os.path.dirname(os.path.realpath(__file__))
_PACKAGED = os.path.join(_PACKAGE, "_data")
_FOLDERS = {
    "std": ("scenarios", "std"),
    "scenarios": ("scenarios",),
    "schemas": ("schemas",),
    "suites": ("suites",),
    "errors": ("docs", "errors"),
}


def data_path(*parts: str) -> Path:
    """Return the path of shipped data. The first part is `std`, `scenarios`, `schemas`, `suites` or `errors` (error
    pages).

    The packaged copy has precedence over the repository's folder. The path need not exist. Raises `KeyError` for an
    unknown first part.
    """
    from pathlib import Path

    kind, *rest = parts
    return Path(data_folder(kind), *rest)


def data_folder(kind: str) -> str:
    """Return the folder of one kind of shipped data; see `data_path`."""
    root = _PACKAGED if os.path.isdir(_PACKAGED) else os.path.dirname(_PACKAGE)
    return os.path.join(root, *_FOLDERS[kind])


CACHE_OFF = "LINGJING_NO_CACHE"
"""Environment variable: if it is set to anything but 0, the caches of missions, of cities made from maps and of meshes
are neither read nor written.
"""


def cache_is_off() -> bool:
    """Return whether the user has disabled the caches."""
    return os.environ.get(CACHE_OFF, "0") not in ("", "0")


CACHE_KINDS = ("missions", "cities", "networks", "meshes", "shaders", "sites", "trials")
"""The folders within the cache."""

LEAST_FREE_BYTES = 32 << 20
"""Free space below which a folder counts as full. Chosen: ten road networks of shipped missions (up to 3.4 MB each)."""


class CacheChoice(NamedTuple):
    """The cache in use."""

    folder: str
    """The folder."""
    refused: str = ""
    """The reason for which the user's own folder is not used; "" if it is."""
    is_usable: bool = True
    """False if no temporary folder is writable either; `folder` is then the user's own all the same."""


def _user_cache_folder() -> str:
    """Return the user's folder of files that can be generated again.

    A relative XDG_CACHE_HOME is ignored, as the XDG base directory specification demands: processes of one episode have
    different working folders.
    """
    base = os.environ.get("XDG_CACHE_HOME", "")
    own = base if os.path.isabs(base) else os.path.expanduser("~/.cache")  # noqa: PTH111, PTH117 - a cold start
    return os.path.join(own, "lingjing")


def choose_cache() -> CacheChoice:
    """Return the user's cache folder, or a temporary one if it is not writable."""
    own = _user_cache_folder()
    refused = write_fault(own)
    if not refused:
        return CacheChoice(own)
    temporary = _temporary_cache()
    return CacheChoice(temporary or own, refused, bool(temporary))


def cache_folder() -> str:
    """Return the folder to which the cache is written; see `choose_cache`."""
    return choose_cache().folder


def kept_path(*parts: str) -> str:
    """Return the path from which a cached file is read: the user's own folder if the file is there, else the folder in
    use.
    """
    folder = cache_folder()
    own = os.path.join(_user_cache_folder(), *parts)
    return own if os.path.exists(own) else os.path.join(folder, *parts)  # noqa: PTH110


def write_fault(folder: str) -> str:
    """Return the reason for which a cache folder, existing or to be made, is not writable; "" if it is."""
    places = (folder, *(os.path.join(folder, kind) for kind in CACHE_KINDS))
    try:
        faults = (_write_fault(place) for place in dict.fromkeys(map(_existing, places)))
        return next(filter(None, faults), "")
    except OSError as error:
        return f"`{folder}`: {error.strerror}"


def _existing(place: str) -> str:
    """Return a path, or its nearest existing ancestor."""
    while not os.path.lexists(place):
        above = os.path.dirname(place) or "."
        if above == place:  # a working folder that was removed, or a disk that fails
            break
        place = above
    return place


def _write_fault(place: str) -> str:
    if not os.path.isdir(place):
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
    """Return a folder that no other user can write, or "". Other users may have made folders of its first names."""
    import stat
    import tempfile

    try:
        base = os.path.join(tempfile.gettempdir(), f"lingjing-cache-{os.geteuid()}")
        for folder in (base, *(f"{base}-{number}" for number in range(1, 10))):
            with contextlib.suppress(FileExistsError):
                os.mkdir(folder, 0o700)  # noqa: PTH102
            state = os.lstat(folder)
            is_own = state.st_uid == os.geteuid() and not state.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
            if stat.S_ISDIR(state.st_mode) and is_own and not write_fault(folder):
                return folder
    except OSError:
        pass  # no folder for temporary files, or a full one
    return ""
