"""System libraries that no Python package brings: how each is probed and which Debian package has it.

Also read by `tools/setup.py` before anything is installed, so it imports nothing but the standard library.
"""

from __future__ import annotations

import ctypes
from collections.abc import Iterable
from dataclasses import dataclass


@dataclass(frozen=True)
class SystemLibrary:
    """`soname` is what is loaded; `package` the Debian package; `purpose` why it is needed."""

    soname: str
    package: str
    purpose: str


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
    """Those that the dynamic loader cannot load here."""
    return tuple(library for library in SYSTEM_LIBRARIES if not _loads(library.soname))


def apt_line(libraries: Iterable[SystemLibrary]) -> str:
    """The one command that installs them on Debian and its kin."""
    packages = sorted({library.package for library in libraries})
    return f"apt-get install -y {' '.join(packages)}"


def _loads(soname: str) -> bool:
    try:
        ctypes.CDLL(soname)
    except OSError:
        return False
    return True
