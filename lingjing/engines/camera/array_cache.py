"""A disk cache of arrays (`$XDG_CACHE_HOME/lingjing/meshes`): textures, and grids that follow from a city.

The name of a file is a hash of everything that determines its content: what the caller names; the source code of this
package and of scenes; versions and chosen code paths of the numerical libraries. `lingjing.kept_files` stores and
checks the files. If the folder cannot be written, nothing is kept. All files together take at most `MOST_BYTES`, plus
what one process has written since its last check. With `LINGJING_NO_CACHE` nothing is read or kept.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from importlib.metadata import version
from io import BytesIO
from itertools import count
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from lingjing import scene
from lingjing.data import cache_folder, cache_is_off
from lingjing.kept_files import prune, read_kept, write_kept
from lingjing.numerics import runtime_fingerprint

Element = TypeVar("Element", bound=np.generic)

FOLDER = "meshes"
"""The name of the folder of all files of the camera."""

MOST_BYTES = 1 << 30
"""Most bytes of all files together (chosen)."""

MOST_FILES = 1 << 20
"""Most files (chosen)."""

LOOK_EVERY = 32
"""Written files between two checks of the folder's size; the first file is followed by one (chosen)."""

_COMPUTING = ("numpy", "scipy", "shapely", "mapbox-earcut")
"""Packages that compute arrays; their versions are part of a name."""
_CHOSEN = ("libm", "numpy")
"""Entries of `lingjing.numerics.runtime_fingerprint` that an array may depend on."""


_written = count()
"""The number of arrays that this process has written."""


def cached_array(name: str, make: Callable[[], npt.NDArray[Element]]) -> npt.NDArray[Element]:
    """Return an array that depends only on the name, the code and its libraries.

    It is the cached one, or that of `make`, which is then cached if possible.
    """
    if cache_is_off():
        return make()
    file = Path(cache_folder(), FOLDER, f"{cache_key(name)}.array")
    with suppress(OSError, ValueError):
        data = read_kept(str(file))
        if data is not None:
            stored: npt.NDArray[Any] = np.lib.format.read_array(BytesIO(data), allow_pickle=False)
            return stored
    made = make()
    stream = BytesIO()
    np.lib.format.write_array(stream, made, allow_pickle=False)
    with suppress(OSError):
        write_kept(str(file), stream.getvalue())
        if next(_written) % LOOK_EVERY == 0:
            prune(str(file.parent), most_bytes=MOST_BYTES, most_files=MOST_FILES)
    return made


def cache_key(content: str) -> str:
    """Return the hash of content, code and libraries."""
    return hashlib.sha256("\n".join((content, _code_sha256(), *_libraries())).encode()).hexdigest()[:40]


@cache
def _libraries() -> tuple[str, ...]:
    """Return the versions and the chosen code of the libraries. Reading them anew takes 20 ms for each key."""
    fingerprint = runtime_fingerprint()
    return (
        *(f"{name} {version(name)}" for name in _COMPUTING),
        *(f"{name} {fingerprint[name]}" for name in _CHOSEN),
    )


@cache
def _code_sha256() -> str:
    """Return a hash of all source code that may change an array."""
    digest = hashlib.sha256()
    for folder in (Path(__file__).parent, Path(scene.__file__).parent):
        for file in sorted(folder.rglob("*.py")):
            digest.update(f"{file.relative_to(folder)}\0".encode() + hashlib.sha256(file.read_bytes()).digest())
    return digest.hexdigest()


__all__ = ["FOLDER", "LOOK_EVERY", "MOST_BYTES", "MOST_FILES", "cache_key", "cached_array"]
