"""What stands around the dogs: the shapes of a city in square cells, kept near them and let go behind them.

A model holds the cells within `LOAD_M` of a dog. It must be built again when a dog comes within `NEED_M` of a cell
that is not held, which is once in half a minute of walking at most.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import lru_cache, partial

from lingjing.mission.geometry2d import Extent, Vector2, bounds
from lingjing.mission.instance import Vector
from lingjing.scene.city import City, Land
from lingjing.scene.shapes import Capsule, Hull, OrientedBox, Shape, prisms, shapes_of
from lingjing.scene.tiles import TileKey, Tiles

CELL_M = 32.0
LOAD_M = 60.0
NEED_M = 15.0
REACH_M = 25.0
"""How far above and below the dogs shapes are kept: no more than legs can climb before the next model."""

_KEPT_CELLS = 256
_KEPT_TILES = 32
_LEVEL_M = 1e-3

CellIndex = tuple[int, int]


class DogSurroundings:
    """The shapes of a city by place, made when they are first asked for."""

    def __init__(self, city: City) -> None:
        self.ground_m = city.datum_m
        tiles = Tiles(city)
        cut = lru_cache(_KEPT_TILES)(partial(_tile_shapes, tiles))  # once, although several cells look into a tile
        lands = tuple((land, bounds(land.polygon)) for land in city.lands if land.top_m > city.datum_m + _LEVEL_M)
        self._cell = lru_cache(_KEPT_CELLS)(partial(_cell_shapes, tiles, cut, lands, city.datum_m))
        self._held: frozenset[CellIndex] = frozenset()

    def suffices(self, points: Sequence[Vector2]) -> bool:
        """Whether what was loaded last is enough for dogs at these points."""
        return all(cell in self._held for point in points for cell in _cells_around(point, NEED_M))

    def load(self, points: Sequence[Vector]) -> tuple[Shape, ...]:
        """The shapes around these points, each once, in an order that only the points decide."""
        wanted = sorted({cell for x, y, _ in points for cell in _cells_around((x, y), LOAD_M)})
        self._held = frozenset(wanted)
        low, high = min(point[2] for point in points) - REACH_M, max(point[2] for point in points) + REACH_M
        shapes = dict.fromkeys(shape for cell in wanted for shape in self._cell(cell))
        return tuple(part for shape in shapes if (part := _within(shape, low, high)) is not None)


_BoundedShapes = tuple[tuple[Shape, Extent], ...]


def _tile_shapes(tiles: Tiles, key: TileKey) -> _BoundedShapes:
    """A tile's shapes and what they cover."""
    return tuple((shape, _extent(shape)) for shape in shapes_of(tiles.load(key)))


def _cell_shapes(
    tiles: Tiles,
    shapes_in: Callable[[TileKey], _BoundedShapes],
    lands: Sequence[tuple[Land, Extent]],
    ground_m: float,
    cell: CellIndex,
) -> tuple[Shape, ...]:
    square = _square(cell)
    centre = 0.5 * (square[0] + square[2]), 0.5 * (square[1] + square[3])
    found: list[Shape] = []
    for key in tiles.keys_near(*centre, CELL_M * math.sqrt(0.5)):
        found += [shape for shape, extent in shapes_in(key) if _meet(extent, square)]
    for number, (land, span) in enumerate(lands):
        if _meet(span, square):
            found += _ground(f"land-{number}", land, square, ground_m)
    return tuple(found)


def _ground(name: str, land: Land, square: Extent, ground_m: float) -> list[Shape]:
    """The part of a raised land in a cell: whole lands are kilometres wide, too wide for exact contacts."""
    import shapely

    whole = shapely.make_valid(shapely.Polygon(land.polygon))
    shapes: list[Shape] = []
    for part in shapely.get_parts(shapely.intersection(whole, shapely.box(*square))):
        if part.geom_type == "Polygon" and part.area > _LEVEL_M:
            ring = tuple((x, y) for x, y in part.exterior.coords[:-1])
            shapes += prisms(name, ring, (), ground_m - 1.0, land.top_m)
    return shapes


def _cells_around(point: Vector2, radius_m: float) -> list[CellIndex]:
    x, y = point
    columns = range(math.floor((x - radius_m) / CELL_M), math.floor((x + radius_m) / CELL_M) + 1)
    rows = range(math.floor((y - radius_m) / CELL_M), math.floor((y + radius_m) / CELL_M) + 1)
    return [(column, row) for column in columns for row in rows]


def _square(cell: CellIndex) -> Extent:
    column, row = cell
    return column * CELL_M, row * CELL_M, (column + 1) * CELL_M, (row + 1) * CELL_M


def _meet(one: Extent, other: Extent) -> bool:
    return one[0] <= other[2] and other[0] <= one[2] and one[1] <= other[3] and other[1] <= one[3]


def _extent(shape: Shape) -> Extent:
    if isinstance(shape, OrientedBox):
        x, y, _ = shape.centre
        reach = math.hypot(shape.half[0], shape.half[1])
        return x - reach, y - reach, x + reach, y + reach
    if isinstance(shape, Capsule):
        west, south, east, north = bounds([shape.start[:2], shape.end[:2]])
        return west - shape.radius_m, south - shape.radius_m, east + shape.radius_m, north + shape.radius_m
    return bounds([corner[:2] for corner in shape.corners])


def _within(shape: Shape, low: float, high: float) -> Shape | None:
    """The part of a shape between two elevations: exact for prisms, which alone are tall. None if nothing is left."""
    if isinstance(shape, OrientedBox):
        (x, y, z), (length, width, height) = shape.centre, shape.half
        base, top = max(z - height, low), min(z + height, high)
        if top - base < _LEVEL_M:
            return None
        return OrientedBox(shape.thing, (x, y, 0.5 * (base + top)), (length, width, 0.5 * (top - base)), shape.yaw)
    if isinstance(shape, Capsule):
        reachable = low < max(shape.start[2], shape.end[2]) and min(shape.start[2], shape.end[2]) < high
        return shape if reachable else None
    corners = tuple((x, y, min(max(z, low), high)) for x, y, z in shape.corners)
    levels = [corner[2] for corner in corners]
    return Hull(shape.thing, corners) if max(levels) - min(levels) > _LEVEL_M else None
