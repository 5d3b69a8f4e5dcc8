"""The entry points of installed distributions, read so that the broken metadata of one hides no other.

`importlib.metadata.entry_points` raises for all where the file of a single distribution cannot be parsed. Here each
distribution is read for itself: what cannot be read is named, the rest counts.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from functools import lru_cache
from importlib.metadata import Distribution, EntryPoint, distributions
from importlib.util import find_spec
from pathlib import Path
from typing import NamedTuple

PLUGINS = "lingjing"
"""The group of plug-ins (`lingjing.plugins`)."""

TYPES = "lingjing.std"
"""The group of packages with types of missions: `use NAME.file { … }`."""


_MOVED = {"lingjing.engines.builtin": "lingjing.builtin"}
"""Modules of this project's plug-ins by their earlier places: the metadata of an editable installation keeps the
earlier place until it is installed again."""


class BrokenEntry(NamedTuple):
    """Metadata that names no plug-in although it should: the entry point ("" if none can be read), the distribution
    with its version, and the reason."""

    name: str
    distribution: str
    reason: str


class FoundEntries(NamedTuple):
    """The usable entry points of a group, sorted by name and distribution, and the broken ones."""

    points: tuple[EntryPoint, ...]
    broken: tuple[BrokenEntry, ...]


_held: dict[tuple[str, tuple[str, ...]], FoundEntries] = {}


def hold_entries() -> None:
    """Keep what is installed on Python's path for this process and for those that will be forked from it."""
    for group in (PLUGINS, TYPES):
        _held[group, tuple(sys.path)] = found = _read_entries(group)
        for point in found.points:
            label(point.dist)


def find_entries(group: str) -> FoundEntries:
    """The entry points of a group, as they are or as `hold_entries` found them on the same path. Of two distributions
    with one name the first on Python's path counts."""
    return _held.get((group, tuple(sys.path))) or _read_entries(group)


def _read_entries(group: str) -> FoundEntries:
    points: list[EntryPoint] = []
    broken: list[BrokenEntry] = []
    for found in _distinct():
        try:
            text = found.read_text("entry_points.txt") or ""
            here = [point for point in found.entry_points if point.group == group] if group in text else []
        except Exception as error:  # noqa: BLE001 - a stranger's file; the parser's exceptions are not documented
            if not isinstance(error, UnicodeDecodeError) or group.encode() in error.object:
                reason = f"its entry_points.txt cannot be read ({type(error).__name__})"
                broken.append(BrokenEntry("", label(found), reason))
            continue
        for point in here:
            if EntryPoint.pattern.match(point.value):
                points.append(present_place(point))
            else:
                reason = f"its entry point has the value {point.value!r}, which names no module"
                broken.append(BrokenEntry(point.name, label(found), reason))
    return FoundEntries(tuple(sorted(points, key=lambda point: (point.name, label(point.dist)))), tuple(broken))


def present_place(point: EntryPoint) -> EntryPoint:
    """Return an entry point with the present place of its module."""
    if point.value not in _MOVED:
        return point
    moved = EntryPoint(point.name, _MOVED[point.value], point.group)
    vars(moved).update(dist=point.dist)  # what `importlib.metadata` does with those that it reads
    return moved


@lru_cache(maxsize=256)  # a distribution's metadata is parsed anew at each look
def label(found: Distribution | None) -> str:
    """A distribution's name and version, as far as its metadata has them; without a name, the folder that has it."""
    name = _name(found) if found is not None else ""
    try:
        version = found.version if found is not None else ""
    except Exception:  # noqa: BLE001 - metadata without a version, or none at all
        version = ""
    folder = getattr(getattr(found, "_path", None), "name", "")
    return f"{name or folder or 'an unnamed distribution'} {version or '(no version)'}"


def package_folders(module: str) -> tuple[Path, ...]:
    """The places where a package or module may be, without importing anything of it; none if its top is not there."""
    top, *below = module.split(".")
    try:
        spec = find_spec(top)  # of a package within it, the ones around it would be imported
    except (ImportError, ValueError):
        return ()
    return tuple(Path(folder, *below) for folder in (spec.submodule_search_locations if spec else None) or ())


# -- private


def _name(found: Distribution) -> str:
    try:
        return str(found.metadata["Name"] or "")
    except Exception:  # noqa: BLE001 - a distribution without metadata
        return ""


def _distinct() -> Iterator[Distribution]:
    seen: set[str] = set()
    for found in distributions():
        name = str(getattr(found, "_normalized_name", "")) or _name(found)
        if name not in seen:
            seen.add(name)
            yield found
