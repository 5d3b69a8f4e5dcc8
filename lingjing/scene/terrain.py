"""`Terrain`: water, ground and obstacles at a place, with their elevations, for bodies that move there.

The ground and the waters of a city are a few large polygons. The obstacles (`blocks`) are read through the city's tiles
on demand, square by square, and the latest squares are cached. So the cost of a lookup and the memory do not grow with
the city.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence
from functools import lru_cache, partial
from typing import NamedTuple

from lingjing.scene.blocks import Block, blocks
from lingjing.scene.city import City, Water
from lingjing.scene.outlines import BoundedPolygon, inside, touches
from lingjing.scene.tiles import TileKey, Tiles

REACH_M = 8.0
"""Greatest `margin_m` that a query supports, metres: half the span of a light aircraft, with a reserve (chosen)."""

_CELL_M = 50.0
"""Side of the cells by which a square's blocks are indexed, metres (chosen)."""
_KEPT_SQUARES = 128
"""Cached squares."""

_EVEN_CELL_M = 16.0
"""Side of the cells for which ground and still water are cached, metres (chosen)."""
_KEPT_EVEN_CELLS = 4096
"""Cached cells."""
_CLEAR_M = 0.01
"""Least distance of an outline from a cell of uniform ground, metres: more than any rounding error."""


class Terrain:
    """A city as terrain for moving bodies. Points are world metres; elevations are over the datum's zero."""

    def __init__(self, city: City) -> None:
        self.datum_m = city.datum_m
        self._bounds = city.bounds
        self._waters = tuple((BoundedPolygon.of(water.polygon), water) for water in city.waters)
        self._lands = tuple((BoundedPolygon.of(land.polygon), land.top_m) for land in city.lands)
        levels = [city.datum_m, *(top for _, top in self._lands), *(water.level_m for water in city.waters)]
        self._highest_ground_m = max(levels)
        self.tile_m = city.tile_m
        self.square = lru_cache(_KEPT_SQUARES)(partial(_read_square, Tiles(city), city.tile_m))
        """The square of a column and a row of `tile_m` side."""
        self._cell = lru_cache(_KEPT_EVEN_CELLS)(partial(_read_cell, self._waters, self._lands, city.datum_m))

    def holds(self, x: float, y: float) -> bool:
        """True if a point is within the city's bounds."""
        west, south, east, north = self._bounds
        return west <= x <= east and south <= y <= north

    def water_level(self, x: float, y: float) -> float | None:
        """Elevation of the still water at a point; None on land and outside all waters."""
        cell = self._cell(math.floor(x / _EVEN_CELL_M), math.floor(y / _EVEN_CELL_M))
        return _water_level(self._waters, self._lands, x, y) if cell is None else cell.water_m

    def surface(self, x: float, y: float) -> float:
        """Elevation of the ground or the still water at a point; the datum where the map has neither."""
        cell = self._cell(math.floor(x / _EVEN_CELL_M), math.floor(y / _EVEN_CELL_M))
        return _surface(self._waters, self._lands, self.datum_m, x, y) if cell is None else cell.surface_m

    def support(self, x: float, y: float, below_m: float, margin_m: float = 0.0) -> float:
        """Elevation at which a body of radius `margin_m` (at most `REACH_M`) that falls from `below_m` comes to rest.

        It may rest on ground, water, a roof, a deck or a slope.
        """
        tops = [block.top_at(x, y) for block in self.blocks_near(x, y) if block.covers(x, y, margin_m)]
        return max([self.surface(x, y), *(top for top in tops if top <= below_m)])

    def solids_at(self, x: float, y: float, low_m: float, high_m: float, margin_m: float = 0.0) -> tuple[Block, ...]:
        """Return the blocks that touch a body of radius `margin_m` (at most `REACH_M`) between two elevations."""
        return tuple(
            block
            for block in self.blocks_near(x, y)
            if block.area.bounds_hold(x, y, margin_m)  # a cheap test that rules out most blocks
            and block.base_at(x, y) < high_m
            and block.top_at(x, y) > low_m
            and block.covers(x, y, margin_m)
        )

    def ceiling_m(self, x: float, y: float) -> float:
        """An elevation above which nothing is near a point: a quick answer for bodies that fly high."""
        return max(self._highest_ground_m, self._square(x, y).highest_m)

    def blocks_near(self, x: float, y: float) -> tuple[Block, ...]:
        """The blocks within `REACH_M` of a point, and others of its neighbourhood."""
        return self._square(x, y).near(x, y)

    def _square(self, x: float, y: float) -> Square:
        return self.square((math.floor(x / self.tile_m), math.floor(y / self.tile_m)))


class Square:
    """The `blocks` that a body in one square can touch, indexed by cells of 50 m."""

    def __init__(self, bounds: tuple[float, float, float, float], candidates: Iterable[Block]) -> None:
        self.highest_m = -math.inf
        """Elevation of the highest top, metres; minus infinity without blocks."""
        self._cells: dict[TileKey, tuple[Block, ...]] = {}
        limits = _cells(*bounds)
        reaching: list[Block] = []
        for block in candidates:
            area = block.area
            reached = _cells(area.west - REACH_M, area.south - REACH_M, area.east + REACH_M, area.north + REACH_M)
            columns, rows = _common(reached[0], limits[0]), _common(reached[1], limits[1])
            if not columns or not rows:
                continue
            reaching.append(block)
            self.highest_m = max(self.highest_m, *(block.top_at(x, y) for x, y in area.polygon))
            for cell in itertools.product(columns, rows):
                self._cells[cell] = (*self._cells.get(cell, ()), block)
        self.blocks = tuple(reaching)

    def near(self, x: float, y: float) -> tuple[Block, ...]:
        """The blocks within reach of a point of this square."""
        return self._cells.get((math.floor(x / _CELL_M), math.floor(y / _CELL_M)), ())


def _read_square(tiles: Tiles, side: float, key: TileKey) -> Square:
    west, south = key[0] * side, key[1] * side
    reach = side * math.sqrt(0.5) + REACH_M  # the corners are that far from the middle
    near = tiles.near(west + side / 2.0, south + side / 2.0, reach)
    return Square((west, south, west + side, south + side), itertools.chain.from_iterable(map(blocks, near)))


_Waters = Sequence[tuple[BoundedPolygon, Water]]
_Lands = Sequence[tuple[BoundedPolygon, float]]


class _EvenCell(NamedTuple):
    """A cell that no shoreline crosses."""

    surface_m: float
    """Elevation of the ground or the still water, metres."""
    water_m: float | None
    """Elevation of the still water, metres; None if bodies do not float there."""


def _read_cell(waters: _Waters, lands: _Lands, datum_m: float, column: int, row: int) -> _EvenCell | None:
    """A cell that is uniform, so that its centre stands for all of it; None if an outline crosses it.

    Floating and flying bodies query many times a second, mostly in the same cell.
    """
    half = _EVEN_CELL_M / 2.0
    x, y, reach = column * _EVEN_CELL_M + half, row * _EVEN_CELL_M + half, half + _CLEAR_M
    shores = (area.polygon for area, _ in (*waters, *lands) if area.bounds_hold(x, y, reach))
    holes = (hole for _, water in waters for hole in water.holes)
    if any(touches(outline, x, y, reach) for outline in itertools.chain(shores, holes)):
        return None
    return _EvenCell(_surface(waters, lands, datum_m, x, y), _water_level(waters, lands, x, y))


def _surface(waters: _Waters, lands: _Lands, datum_m: float, x: float, y: float) -> float:
    tops = [top for area, top in lands if area.holds(x, y)]
    tops += [water.level_m for area, water in waters if _wet(area, water.holes, x, y)]
    return max(tops, default=datum_m)


def _water_level(waters: _Waters, lands: _Lands, x: float, y: float) -> float | None:
    level = max((water.level_m for area, water in waters if _wet(area, water.holes, x, y)), default=None)
    if level is None or any(top > level and area.holds(x, y) for area, top in lands):
        return None
    return level


def _cells(west: float, south: float, east: float, north: float) -> tuple[range, range]:
    return _span(west, east), _span(south, north)


def _span(low: float, high: float) -> range:
    return range(math.floor(low / _CELL_M), math.floor(high / _CELL_M) + 1)


def _common(first: range, second: range) -> range:
    return range(max(first.start, second.start), min(first.stop, second.stop))


def _wet(area: BoundedPolygon, holes: Iterable[tuple[tuple[float, float], ...]], x: float, y: float) -> bool:
    return area.holds(x, y) and not any(inside(hole, x, y) for hole in holes)
