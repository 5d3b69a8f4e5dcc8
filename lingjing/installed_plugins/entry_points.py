"""The entry points of installed distributions. Broken metadata of one distribution does not hide the others.

`importlib.metadata.entry_points` raises if it cannot parse the file of a single distribution. Here each distribution is
read separately: broken ones are reported, the others are returned.
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
"""Earlier modules of this project's plug-ins. The metadata of an editable installation keeps the earlier module until
the next installation."""


class BrokenEntry(NamedTuple):
    """Metadata of a plug-in that cannot be used."""

    name: str
    """The entry point; "" if none can be read."""
    distribution: str
    """The distribution with its version."""
    reason: str
    """The fault in words."""


class FoundEntries(NamedTuple):
    """The entry points of a group."""

    points: tuple[EntryPoint, ...]
    """The usable ones, sorted by name and distribution."""
    broken: tuple[BrokenEntry, ...]
    """The unusable ones."""


_held: dict[tuple[str, tuple[str, ...]], FoundEntries] = {}
"""Entry points that `hold_entries` keeps, by group and Python's path."""


def hold_entries() -> None:
    """Read the entry points on Python's path, and keep them for this process and its forks."""
    for group in (PLUGINS, TYPES):
        _held[group, tuple(sys.path)] = entries = _read_entries(group)
        for point in entries.points:
            label(point.dist)


def find_entries(group: str) -> FoundEntries:
    """Return the entry points of a group, from `hold_entries` if it was called with the same path.

    Of two distributions with one name the first on Python's path counts.
    """
    return _held.get((group, tuple(sys.path))) or _read_entries(group)


def _read_entries(group: str) -> FoundEntries:
    points: list[EntryPoint] = []
    broken: list[BrokenEntry] = []
    for distribution in _distinct():
        try:
            text = distribution.read_text("entry_points.txt") or ""
            here = [point for point in distribution.entry_points if point.group == group] if group in text else []
        except Exception as error:  # noqa: BLE001 - a stranger's file; the parser's exceptions are not documented
            if not isinstance(error, UnicodeDecodeError) or group.encode() in error.object:
                reason = f"its entry_points.txt cannot be read ({type(error).__name__})"
                broken.append(BrokenEntry("", label(distribution), reason))
            continue
        for point in here:
            if EntryPoint.pattern.match(point.value):
                points.append(present_place(point))
            else:
                reason = f"its entry point has the value {point.value!r}, which names no module"
                broken.append(BrokenEntry(point.name, label(distribution), reason))
    return FoundEntries(tuple(sorted(points, key=lambda point: (point.name, label(point.dist)))), tuple(broken))


def present_place(point: EntryPoint) -> EntryPoint:
    """Return the entry point with the present module of a moved plug-in."""
    if point.value not in _MOVED:
        return point
    moved = EntryPoint(point.name, _MOVED[point.value], point.group)
    vars(moved).update(dist=point.dist)  # as `importlib.metadata` does
    return moved


@lru_cache(maxsize=256)  # a distribution's metadata is parsed anew at each look
def label(distribution: Distribution | None) -> str:
    """Return a distribution's name and version for messages; its folder's name without a name."""
    name = _name(distribution) if distribution is not None else ""
    try:
        version = distribution.version if distribution is not None else ""
    except Exception:  # noqa: BLE001 - metadata without a version, or none at all
        version = ""
    folder = getattr(getattr(distribution, "_path", None), "name", "")
    return f"{name or folder or 'an unnamed distribution'} {version or '(no version)'}"


def package_folders(module: str) -> tuple[Path, ...]:
    """Return the possible folders of a package or module, without an import; none if its top package is not
    installed."""
    top, *below = module.split(".")
    try:
        spec = find_spec(top)  # the spec of a subpackage would import its parents
    except (ImportError, ValueError):
        return ()
    return tuple(Path(folder, *below) for folder in (spec.submodule_search_locations if spec else None) or ())


# -- private


def _name(distribution: Distribution) -> str:
    try:
        return str(distribution.metadata["Name"] or "")
    except Exception:  # noqa: BLE001 - a distribution without metadata
        return ""


def _distinct() -> Iterator[Distribution]:
    seen: set[str] = set()
    for distribution in distributions():
        name = str(getattr(distribution, "_normalized_name", "")) or _name(distribution)
        if name not in seen:
            seen.add(name)
            yield distribution
