"""The solid shapes of a city near the dogs, in square cells that are kept for reuse.

A model holds the cells within `LOAD_M` of a dog. A new model is needed when a dog comes within `NEED_M` of a cell that
the model does not hold. This happens at most once in half a minute of walking.
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
"""Side of a cell, metres (chosen)."""

LOAD_M = 60.0
"""Distance from a dog within which a model holds cells, metres (chosen)."""

NEED_M = 15.0
"""Distance from a dog within which a model must hold all cells, metres (chosen)."""

REACH_M = 25.0
"""Height above and below the dogs up to which shapes are held, metres: more than legs can climb before the next
model."""

_KEPT_CELLS = 256
"""Cells in the cache (chosen)."""

_KEPT_TILES = 32
"""Tiles of the city in the cache (chosen)."""

_LEVEL_M = 1e-3
"""Height and area below which a part is left out, metres and square metres (chosen)."""

CellIndex = tuple[int, int]


class CityShapes:
    """The shapes of a city by place, built on first use."""

    def __init__(self, city: City) -> None:
        self.ground_m = city.datum_m
        tiles = Tiles(city)
        cut = lru_cache(_KEPT_TILES)(partial(_tile_shapes, tiles))  # several cells read the same tile
        lands = tuple((land, bounds(land.polygon)) for land in city.lands if land.top_m > city.datum_m + _LEVEL_M)
        self._cell = lru_cache(_KEPT_CELLS)(partial(_cell_shapes, tiles, cut, lands, city.datum_m))
        self._held: frozenset[CellIndex] = frozenset()

    def suffices(self, points: Sequence[Vector2]) -> bool:
        """Return whether the cells that were loaded last suffice for dogs at these points."""
        return all(cell in self._held for point in points for cell in _cells_around(point, NEED_M))

    def load(self, points: Sequence[Vector]) -> tuple[Shape, ...]:
        """Return the shapes around these points without duplicates, in an order that depends only on the points."""
        wanted = sorted({cell for x, y, _ in points for cell in _cells_around((x, y), LOAD_M)})
        self._held = frozenset(wanted)
        low, high = min(point[2] for point in points) - REACH_M, max(point[2] for point in points) + REACH_M
        shapes = dict.fromkeys(shape for cell in wanted for shape in self._cell(cell))
        return tuple(part for shape in shapes if (part := _within(shape, low, high)) is not None)


_BoundedShapes = tuple[tuple[Shape, Extent], ...]


def _tile_shapes(tiles: Tiles, key: TileKey) -> _BoundedShapes:
    """Return a tile's shapes with their bounding rectangles."""
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
    shapes: list[Shape] = []
    for key in tiles.keys_near(*centre, CELL_M * math.sqrt(0.5)):
        shapes += [shape for shape, extent in shapes_in(key) if _meet(extent, square)]
    for number, (land, span) in enumerate(lands):
        if _meet(span, square):
            shapes += _ground(f"land-{number}", land, square, ground_m)
    return tuple(shapes)


def _ground(name: str, land: Land, square: Extent, ground_m: float) -> list[Shape]:
    """Return the part of a raised land inside a cell. Whole lands are kilometres wide, too wide for exact contacts."""
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


def _meet(first: Extent, second: Extent) -> bool:
    return first[0] <= second[2] and second[0] <= first[2] and first[1] <= second[3] and second[1] <= first[3]


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
    """Return the part of a shape between two elevations; None if nothing is left.

    It is exact for prisms, the only tall shapes.
    """
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
