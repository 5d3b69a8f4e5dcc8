"""`Roofs`: upper bounds of a city's height at very many places at once, for sight and radio lines through it.

A bound is conservative: nothing at the place is higher, but the highest thing may be a few metres aside. It shows where
an exact test (`Terrain.solids_at`) is necessary. Bounds are computed square by square on demand; the latest are cached.
"""

from __future__ import annotations

import math
from functools import lru_cache, partial

import numpy as np
import numpy.typing as npt

from lingjing.scene.terrain import Terrain
from lingjing.scene.tiles import TileKey

CELL_M = 5.0
"""Side of a cell, metres (chosen)."""
_KEPT_SQUARES = 128
"""Cached squares."""

Array = npt.NDArray[np.float64]


class Roofs:
    """The highest top in each cell of 5 m, as elevation in metres; minus infinity in an empty cell."""

    def __init__(self, terrain: Terrain) -> None:
        self._side_m = terrain.tile_m
        self._heights = lru_cache(_KEPT_SQUARES)(partial(_drawn, terrain))

    def bound(self, x: Array, y: Array) -> Array:
        """Return for each place an elevation that nothing above the place exceeds. `x`, `y`: (n,) metres; result:
        (n,)."""
        side = self._side_m
        columns, rows = np.floor(x / side).astype(np.int64), np.floor(y / side).astype(np.int64)
        tops = np.empty(len(x))
        for column in np.unique(columns).tolist():
            strip = columns == column
            for row in np.unique(rows[strip]).tolist():
                here = np.flatnonzero(strip & (rows == row))
                heights = self._heights((column, row))
                most = len(heights) - 1
                east, north = _cell(x[here] - column * side, most), _cell(y[here] - row * side, most)
                tops[here] = heights[east, north]
        return tops


def _drawn(terrain: Terrain, key: TileKey) -> Array:
    """The tops of a square's blocks, drawn into the cells that their bounding boxes touch."""
    side_m = terrain.tile_m
    many = math.ceil(side_m / CELL_M)
    heights = np.full((many, many), -np.inf)
    west, south = key[0] * side_m, key[1] * side_m
    for block in terrain.square(key).blocks:
        area = block.area
        if area.east < west or area.north < south or area.west > west + side_m or area.south > south + side_m:
            continue
        bounds = np.array([area.west - west, area.east - west, area.south - south, area.north - south])
        first, last, low, high = _cell(bounds, many - 1).tolist()
        part = heights[first : last + 1, low : high + 1]
        np.maximum(part, max(block.top_at(*corner) for corner in area.polygon), out=part)
    return heights


def _cell(metres: Array, most: int) -> npt.NDArray[np.int64]:
    """Indices of cells by distance from the square's corner. Places and bounds are rounded alike, so they agree."""
    return np.clip(np.floor(metres / CELL_M), 0, most).astype(np.int64)
