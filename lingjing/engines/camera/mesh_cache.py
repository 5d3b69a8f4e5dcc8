"""A disk cache of the meshes of a city's tiles (`$XDG_CACHE_HOME/lingjing/meshes`).

With it a city is meshed once and not by every process. The name of a file is a hash of everything that determines its
content: the city (without its props, which are in no mesh) and the tile; and what `array_cache.cache_key` adds.
`lingjing.kept_files` stores and checks the files. A mesh with invalid indices is made again. If the folder cannot be
written, nothing is kept. All files together take at most `MOST_BYTES`, plus what one process has written since its last
check. With `LINGJING_NO_CACHE` nothing is read or kept.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path

import msgspec
import numpy as np

from lingjing.data import cache_folder, cache_is_off
from lingjing.decoding import from_msgpack
from lingjing.engines.camera.array_cache import FOLDER, LOOK_EVERY, MOST_BYTES, MOST_FILES, cache_key
from lingjing.engines.camera.mesh_rows import VERTEX, MeshPart
from lingjing.engines.camera.tile_mesh import MATERIALS, TileMesh
from lingjing.kept_files import prune, read_kept, write_kept
from lingjing.scene.city import City, content_sha256
from lingjing.scene.tiles import TileKey


class _StoredTile(msgspec.Struct, frozen=True, array_like=True):
    """A `TileMesh` as bytes."""

    parts: dict[str, tuple[bytes, bytes]]
    """Vertices and indices by material."""
    coarse: int
    """The field `coarse` of `TileMesh`."""
    boxes: bytes
    """Boxes of the buildings."""
    corners: bytes
    """Low and high corner of the tile."""


class MeshCache:
    """The cached meshes of one city."""

    def __init__(self, city: City) -> None:
        self._folder = None if cache_is_off() else Path(cache_folder(), FOLDER)
        self._key = "" if self._folder is None else _city_key(city)
        self._written = 0

    def tile(self, key: TileKey, make: Callable[[], TileMesh]) -> TileMesh:
        """Return the mesh of an unchanged tile: the cached one, or that of `make`, which is then cached."""
        if self._folder is None:
            return make()
        file = self._folder / f"{self._key}-{key[0]}_{key[1]}.mesh"
        mesh = _read(file)
        if mesh is None:
            mesh = make()
            self._keep(file, _packed(mesh))
        return mesh

    def _keep(self, file: Path, data: bytes) -> None:
        """Write a file completely or not at all; after a failure no further file is written."""
        try:
            write_kept(str(file), data)
            if self._written % LOOK_EVERY == 0:
                prune(str(file.parent), most_bytes=MOST_BYTES, most_files=MOST_FILES)
            self._written += 1
        except OSError:
            self._folder = None


def _city_key(city: City) -> str:
    return cache_key(_standing_sha256(city))


def _standing_sha256(city: City) -> str:
    """Return a hash of the static city. Floating props of a harbour differ from episode to episode."""
    if city.store:
        return content_sha256(city)
    standing = msgspec.structs.replace(city, id="", props=(), network="", sha256="")
    return hashlib.sha256(msgspec.msgpack.encode(standing)).hexdigest()


def _read(file: Path) -> TileMesh | None:
    try:
        data = read_kept(str(file))
        return None if data is None else _unpacked(data)
    except (OSError, msgspec.DecodeError, ValueError):
        return None


def _packed(mesh: TileMesh) -> bytes:
    parts = {name: (part.vertices.tobytes(), part.index.tobytes()) for name, part in mesh.parts.items()}
    corners = np.concatenate([mesh.low, mesh.high])
    return msgspec.msgpack.encode(_StoredTile(parts, mesh.coarse, mesh.boxes.tobytes(), corners.tobytes()))


def _unpacked(data: memoryview) -> TileMesh | None:
    """Return the mesh, or None if its indices would read out of bounds."""
    stored = from_msgpack(data, _StoredTile)
    parts = {name: MeshPart(np.frombuffer(vertices, VERTEX), np.frombuffer(index, np.uint32))
             for name, (vertices, index) in stored.parts.items()}  # fmt: skip
    corners = np.frombuffer(stored.corners, np.float64)
    if tuple(parts) != MATERIALS or len(corners) != 6 or not all(map(_is_sound, parts.values())):
        return None
    boxes = np.frombuffer(stored.boxes, np.float64).reshape(-1, 6)
    return TileMesh(parts, stored.coarse, boxes, corners[:3], corners[3:])


def _is_sound(part: MeshPart) -> bool:
    return len(part.index) % 3 == 0 and int(part.index.max(initial=0)) < max(len(part.vertices), 1)
