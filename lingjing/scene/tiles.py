"""`Tiles`: the pieces of a city near a place, for a city in memory and for one in a folder alike.

A square of the grid is `(column, row)`, counted from the world's origin in steps of `City.tile_m`. A piece belongs to
the one square that holds its first point, and may project from it. `near` uses the real extents of the tiles, so a
reader misses nothing and needs no margin. `City.waters` and `City.lands` belong to no tile; they stay with the city.

Tiles of a folder (`lingjing.scene.store`) are read on demand, and the latest `keep` of them are cached. All `Tiles` of
one city that exist at a time share one cache, because an episode has a dozen of them.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import lru_cache, partial
from math import floor, hypot
from pathlib import Path
from typing import Protocol, TypeVar
from weakref import WeakValueDictionary

import msgspec

from lingjing.decoding import converted, from_msgpack
from lingjing.errors import UsageError
from lingjing.mission.geometry2d import Extent
from lingjing.scene.city import (
    Bridge,
    Building,
    City,
    Junction,
    PaintedArea,
    Pieces,
    Pipe,
    Prop,
    Road,
    Slope,
    Solid,
    Tile,
)

TileKey = tuple[int, int]
"""Column and row of a square."""

Piece = PaintedArea | Solid | Slope | Building | Road | Junction | Bridge | Pipe | Prop
"""A piece that belongs to a tile."""

KEPT_TILES = 64
"""Tiles cached by default: 64 squares of 250 m are four square kilometres (chosen)."""

TILED = ("areas", "solids", "slopes", "buildings", "roads", "junctions", "bridges", "pipes", "props")
"""The fields of `Pieces` that are divided into tiles."""


_Read = TypeVar("_Read")


class TileIndex(msgspec.Struct, frozen=True, array_like=True):
    """The extents of a store's tiles."""

    keys: tuple[TileKey, ...]
    """Keys in order."""
    extents: tuple[Extent, ...]
    """The square of each key, enlarged by the bounds of its pieces: west, south, east, north; metres."""


class Tiles:
    """The tiles of a city. `keep`: number of tiles from a folder that are cached.

    Raises `UsageError` if the city's folder is missing or damaged.
    """

    def __init__(self, city: City, keep: int = KEPT_TILES) -> None:
        self._tile_m = city.tile_m
        self._source = _source(city, max(1, keep))
        extents = self._source.extents
        self.keys: tuple[TileKey, ...] = tuple(sorted(extents))
        self._overhang_m = max((_overhang(key, extents[key], city.tile_m) for key in self.keys), default=0.0)

    def load(self, key: TileKey) -> Tile:
        """The tile of a key in `keys`. Raises `KeyError` for another key."""
        return self._source.load(key)

    def extent(self, key: TileKey) -> Extent:
        """The extent of a tile, without reading it. Raises `KeyError` for another key."""
        return self._source.extents[key]

    def near(self, x: float, y: float, radius_m: float) -> tuple[Tile, ...]:
        """Return every tile with a piece, or with its square, within `radius_m` of a point, in key order."""
        return tuple(self._source.load(key) for key in self.keys_near(x, y, radius_m))

    def keys_near(self, x: float, y: float, radius_m: float) -> tuple[TileKey, ...]:
        """Return the keys of `near`, without reading tiles."""
        side, reach, extents = self._tile_m, radius_m + self._overhang_m, self._source.extents
        columns = range(floor((x - reach) / side), floor((x + reach) / side) + 1)
        rows = range(floor((y - reach) / side), floor((y + reach) / side) + 1)
        if len(columns) * len(rows) > len(self.keys):
            candidates: Iterable[TileKey] = self.keys
        else:
            candidates = ((column, row) for column in columns for row in rows if (column, row) in extents)
        return tuple(key for key in candidates if _distance(extents[key], x, y) <= radius_m)

    def __iter__(self) -> Iterator[Tile]:
        """Yield every tile in key order, one at a time."""
        return (self._source.load(key) for key in self.keys)


def buildings_within(city: City, bounds: Extent) -> tuple[Building, ...]:
    """Return the buildings that reach into a rectangle (west, south, east, north; metres), of a city in memory or in a
    folder, in the order of their tiles.

    Raises `UsageError` if the city's folder is missing or damaged.
    """
    west, south, east, north = bounds
    radius_m = hypot(east - west, north - south) / 2.0
    near = Tiles(city).near((west + east) / 2.0, (south + north) / 2.0, radius_m)
    return tuple(building for tile in near for building in tile.buildings if _reaches(building, bounds))


def _reaches(building: Building, bounds: Extent) -> bool:
    """Return whether the bounds of a building's outline meet a rectangle."""
    eastings, northings = zip(*building.polygon, strict=True)
    west, south, east, north = bounds
    meets = min(eastings) <= east and max(eastings) >= west and min(northings) <= north and max(northings) >= south
    return bool(meets)


def partition(pieces: Pieces, tile_m: float) -> dict[TileKey, Tile]:
    """Group the pieces by the square of their first point, in key order. Waters and lands are left out."""
    groups: dict[TileKey, dict[str, list[Piece]]] = {}
    for field in TILED:
        for piece in getattr(pieces, field):
            groups.setdefault(key_of(piece, tile_m), {}).setdefault(field, []).append(piece)
    fields = {key: {field: tuple(items) for field, items in groups[key].items()} for key in sorted(groups)}
    return {key: converted({"key": key, **filled}, Tile) for key, filled in fields.items()}


def key_of(piece: Piece, tile_m: float) -> TileKey:
    """The square of a piece's first point; the one at the origin for a piece without points."""
    points = points_of(piece)
    point = points[0] if points else (0.0, 0.0)
    return floor(point[0] / tile_m), floor(point[1] / tile_m)


def points_of(piece: Piece) -> Sequence[tuple[float, ...]]:
    """The points of a piece, east and north first. The first point decides its tile."""
    if isinstance(piece, Prop):
        return (piece.position,)
    if isinstance(piece, Road):
        return [point for lane in piece.lanes for point in lane.shape]
    if isinstance(piece, Slope):
        return piece.top
    if isinstance(piece, Bridge | Pipe):
        return piece.path
    return piece.polygon


def extent(tile: Tile, tile_m: float) -> Extent:
    """The bounds of a tile's square and of all points of its pieces."""
    column, row = tile.key
    points: list[tuple[float, ...]] = [(column * tile_m, row * tile_m), ((column + 1) * tile_m, (row + 1) * tile_m)]
    for field in TILED:
        for piece in getattr(tile, field):
            points += points_of(piece)
    xs, ys = [point[0] for point in points], [point[1] for point in points]
    return min(xs), min(ys), max(xs), max(ys)


def tile_file(key: TileKey) -> str:
    """Name of a tile's file in a store's folder."""
    return f"tiles/{key[0]}_{key[1]}.msgpack"


INDEX_FILE = "tiles/index.msgpack"
"""Name of the index file in a store's folder."""


# -- private


class _Source(Protocol):
    extents: Mapping[TileKey, Extent]

    def load(self, key: TileKey) -> Tile: ...


class _Memory:
    """The pieces that a city holds itself, divided into tiles once.

    It holds its city, so that the city's `id`, by which it is shared, is not reused.
    """

    def __init__(self, city: City) -> None:
        self._city = city
        self._tiles = partition(city, city.tile_m)
        self.extents: Mapping[TileKey, Extent] = {key: extent(tile, city.tile_m) for key, tile in self._tiles.items()}

    def load(self, key: TileKey) -> Tile:
        return self._tiles[key]


class _Folder:
    """The tiles of a folder, with a cache of the latest."""

    def __init__(self, folder: str, keep: int) -> None:
        index = _decode(folder, INDEX_FILE, TileIndex)
        self.extents: Mapping[TileKey, Extent] = dict(zip(index.keys, index.extents, strict=True))
        self._read = lru_cache(keep)(partial(_read_tile, folder))

    def load(self, key: TileKey) -> Tile:
        if key not in self.extents:
            raise KeyError(key)
        return self._read(key)


_memories: WeakValueDictionary[int, _Memory] = WeakValueDictionary()
_folders: WeakValueDictionary[tuple[str, str, int], _Folder] = WeakValueDictionary()
# Weak references: an entry lives while a `Tiles` uses it, so episodes leave nothing behind.


def _source(city: City, keep: int) -> _Source:
    """The source that other `Tiles` of this city use, or a new one. The result does not depend on earlier use."""
    if city.store:
        content = (city.store, city.sha256, keep)
        folder = _folders.get(content)
        if folder is None:
            folder = _folders[content] = _Folder(city.store, keep)
        return folder
    memory = _memories.get(id(city))
    if memory is None:
        memory = _memories[id(city)] = _Memory(city)
    return memory


def _read_tile(folder: str, key: TileKey) -> Tile:
    return _decode(folder, tile_file(key), Tile)


def _decode(folder: str, name: str, kind: type[_Read]) -> _Read:
    """Decode a file of a store. Raises `UsageError` if it is missing or damaged."""
    path = Path(folder, name)
    hint = "build the city again: lingjing scene build"
    try:
        return from_msgpack(path.read_bytes(), kind)
    except OSError as error:
        raise UsageError(f"the city in `{folder}` has lost `{name}`: {error.strerror}", hint=hint) from None
    except (msgspec.DecodeError, msgspec.ValidationError) as error:
        raise UsageError(f"the city in `{folder}` is damaged: `{name}`: {error}", hint=hint) from None


def _overhang(key: TileKey, bounds: Extent, side: float) -> float:
    column, row = key
    west, south, east, north = bounds
    return max(column * side - west, row * side - south, east - (column + 1) * side, north - (row + 1) * side, 0.0)


def _distance(bounds: Extent, x: float, y: float) -> float:
    west, south, east, north = bounds
    return hypot(max(west - x, x - east, 0.0), max(south - y, y - north, 0.0))
