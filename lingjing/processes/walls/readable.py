"""The files of Python that every process behind walls may read: the interpreter and the installed packages.

A folder of Python's path that belongs to no installation, such as a project's checkout, may also hold results. Only the
modules, packages and metadata of such a folder are readable.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path

_LIBRARIES = ("/lib", "/lib64", "/usr/lib", "/usr/lib64", "/etc/ld.so.cache", "/usr/share/zoneinfo")
"""The places of the system's shared libraries and time zones."""

_MODULES = (".py", ".so", ".pyi")
"""The suffixes of modules beside packages."""
_METADATA = (".dist-info", ".egg-info")
"""The suffixes of folders with the metadata of a distribution."""


def installed_files(further: Iterable[str] = ()) -> tuple[str, ...]:
    """Return the files and folders of the interpreter and of every folder on Python's path, and `further` ones."""
    prefixes = {os.path.realpath(prefix) for prefix in (sys.base_prefix, sys.base_exec_prefix)}
    prefixes |= {sys.prefix, sys.base_prefix}
    places = [*_LIBRARIES, *sorted(prefixes - {"/"}), *further]
    for folder in filter(os.path.isabs, sys.path):
        if not any(folder == prefix or folder.startswith(f"{prefix}/") for prefix in prefixes):
            places += modules_of(Path(folder))
    return tuple(dict.fromkeys(places))


def modules_of(folder: Path) -> Iterator[str]:
    """Yield the modules, the packages and the metadata of distributions in a folder; nothing if it is unreadable.

    A link that leads out of the folder is left out: a policy's folder may hold one to a file of the evaluator.
    """
    try:
        entries = sorted(folder.iterdir())
    except OSError:
        return
    for entry in entries:
        if not stays_in(entry, folder):
            continue
        is_package = (entry / "__init__.py").is_file() or (entry.suffix in _METADATA and entry.is_dir())
        if is_package or (entry.suffix in _MODULES and entry.is_file()):
            yield str(entry)


def stays_in(path: Path, folder: Path) -> bool:
    """Return True if a path is in the folder after all links are followed."""
    return Path(os.path.realpath(path)).is_relative_to(os.path.realpath(folder))


__all__ = ["installed_files", "modules_of", "stays_in"]
