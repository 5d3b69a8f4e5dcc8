"""System libraries that no Python package installs, with a test for each and its Debian package.

`tools/setup.py` imports this module before anything is installed, so it uses the standard library alone.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterable
from dataclasses import dataclass


@dataclass(frozen=True)
class SystemLibrary:
    """A shared library of the system."""

    soname: str
    """The name that the dynamic loader loads."""
    package: str
    """The Debian package."""
    purpose: str
    """The part of the project that needs the library."""


SYSTEM_LIBRARIES = (
    SystemLibrary("libEGL.so.1", "libegl1", "off-screen rendering"),
    SystemLibrary("libGL.so.1", "libgl1", "off-screen rendering"),
    SystemLibrary("libX11.so.6", "libx11-6", "road traffic"),
    SystemLibrary("libXext.so.6", "libxext6", "road traffic"),
    SystemLibrary("libXrender.so.1", "libxrender1", "road traffic"),
    SystemLibrary("libatomic.so.1", "libatomic1", "road traffic"),
    SystemLibrary("libexpat.so.1", "libexpat1", "road traffic"),
)


def missing_libraries() -> tuple[SystemLibrary, ...]:
    """Return the libraries that the dynamic loader cannot load here."""
    return tuple(library for library in SYSTEM_LIBRARIES if not _loads(library.soname))


def apt_line(libraries: Iterable[SystemLibrary]) -> str:
    """Return the command that installs the libraries on Debian and its derivatives."""
    packages = sorted({library.package for library in libraries})
    return f"apt-get install -y {' '.join(packages)}"


def _loads(soname: str) -> bool:
    try:
        ctypes.CDLL(soname)
    except OSError:
        return False
    return True
