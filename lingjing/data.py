"""Where the files that ship with the package are: the standard library, the missions and the schemas.

A wheel carries them under `lingjing/_data`; an editable installation reads the repository's own folders, so that an
edit there counts at once. What can be made again is kept in the user's cache folder.
"""

from __future__ import annotations

import os
from pathlib import Path

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


def cache_folder() -> str:
    """Where this project keeps what can be made again (XDG base directory specification)."""
    base = os.environ.get("XDG_CACHE_HOME")
    return os.path.join(base or os.path.expanduser("~/.cache"), "lingjing")  # noqa: PTH111, PTH118 - a cold start
