"""The file that a `use …` names: standard library, shipped missions, the project's own files, and plug-ins.

`use std.NAME` reads `NAME.ljs` of the standard library, and `use scenarios.NAME` a shipped mission, to extend it. Both
are inside the package, or else in the repository's `scenarios/std` and `scenarios`. Any other first word names a
package under the entry-point group `lingjing.std`; the following words name one of its `.ljs` files (`use acme.rotors`
→ entry point `acme`, file `rotors.ljs`).

`use .boats.tug` is `boats/tug.ljs` in the folder of the using file. No word can be `..`, so no path leads out of that
folder; a symbolic link that does counts as missing.
"""

from __future__ import annotations

import os

from lingjing.data import data_folder
from lingjing.errors import PluginError

DEEPEST = 8
"""Most words of a path (chosen)."""
LONGEST = 100
"""Most letters of a word (chosen): file systems permit names of about 250 bytes."""


SHIPPED = ("std", "scenarios")
"""First words of shipped files: the standard library and the missions."""


def shipped_folder(first: str) -> str:
    """The folder of the files with this first word, one of `SHIPPED`."""
    return data_folder(first)


def folder_of(path: str) -> str | None:
    """The folder in which a file's `use .name` is looked up; None for a text without a file."""
    return None if path.startswith("<") else os.path.dirname(os.path.realpath(path))  # noqa: PTH120


def find_file(path: tuple[str, ...], folder: str | None = None) -> str | None:
    """The file of a `use` path, or None. A relative path is looked up in `folder`.

    Words are identifiers, so no path leads out of the library.
    """
    if not (1 if folder else 2) <= len(path) <= DEEPEST or max(map(len, path)) > LONGEST:
        return None
    if folder is not None:
        return _beside(folder, path)
    folder = _folder(path[0])
    if folder is None:
        return None
    file = os.path.join(folder, *path[1:-1], f"{path[-1]}.ljs")  # noqa: PTH118 - pathlib is not imported cold
    return file if os.path.isfile(file) else None  # noqa: PTH113


def known_paths(first: str, beside: str | None = None) -> list[str]:
    """Paths for proposals: `std.air`, `std.sea`, … and the plug-ins' names, or the files in the folder `beside`."""
    if beside is not None:
        return [f".{name}" for name in _files(beside)]
    folder = _folder(first)
    if folder is None:
        shipped = (f"{word}.{name}" for word in SHIPPED for name in _files(shipped_folder(word)))
        return [*shipped, *sorted(name for name, _ in installed_types())]
    return [f"{first}.{name}" for name in _files(folder)]


def installed_types() -> list[tuple[str, str]]:
    """The packages of types of installed plug-ins: the name of each entry point with its module."""
    from lingjing.installed_plugins.entry_points import TYPES, find_entries

    return [(point.name, point.module) for point in find_entries(TYPES).points]


def _folder(first: str) -> str | None:
    return shipped_folder(first) if first in SHIPPED else _plugin_folder(first)


def _beside(folder: str, path: tuple[str, ...]) -> str | None:
    file = os.path.realpath(os.path.join(folder, *path[:-1], f"{path[-1]}.ljs"))  # noqa: PTH118
    inside = file.startswith(folder.rstrip(os.sep) + os.sep)
    return file if inside and os.path.isfile(file) else None  # noqa: PTH113


def _files(folder: str) -> list[str]:
    try:
        return sorted(name[:-4] for name in os.listdir(folder) if name[1:].endswith(".ljs"))  # noqa: PTH208
    except OSError:
        return []


def _plugin_folder(name: str) -> str | None:
    from lingjing.installed_plugins.entry_points import TYPES, find_entries, package_folders

    entries = find_entries(TYPES)
    points = [point for point in entries.points if point.name == name]
    broken = next((entry for entry in entries.broken if entry.name == name), None)
    if broken is not None:
        raise PluginError(f"the types `{name}` of {broken.distribution}: {broken.reason}", hint="reinstall the plug-in")
    if not points:
        return None
    if len({point.value for point in points}) > 1:
        both = " and ".join(f"`{point.value}`" for point in points)
        raise PluginError(f"two packages offer the types `{name}`: {both}", hint="uninstall one of them")
    folder = next((place for place in package_folders(points[0].value) if place.is_dir()), None)
    if folder is None:
        message = f"the types `{name}` name `{points[0].value}`, which is no package"
        raise PluginError(message, hint=f"add the package with its .ljs files, or correct the entry point `{name}`")
    return str(folder)
