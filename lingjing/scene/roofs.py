"""`Roofs`: how high a city can be at very many places at once, for what looks along lines through it.

An answer is a bound: nothing there is higher, and what is as high may stand a few metres aside. It tells where looking
closely (`Terrain.solids_at`) is worth while. Made square by square where somebody asks; the latest are held.
"""

from __future__ import annotations

import math
from functools import lru_cache, partial

import numpy as np
import numpy.typing as npt

from lingjing.scene.terrain import Terrain
from lingjing.scene.tiles import TileKey

CELL_M = 5.0
_KEPT_SQUARES = 128

Array = npt.NDArray[np.float64]


class Roofs:
    """The highest top in each cell of 5 m, elevations in metres, minus infinity where nothing stands."""

    def __init__(self, terrain: Terrain) -> None:
        self._side_m = terrain.tile_m
        self._heights = lru_cache(_KEPT_SQUARES)(partial(_drawn, terrain))

    def bound(self, x: Array, y: Array) -> Array:
        """For each place an elevation over which nothing that covers it reaches."""
        side = self._side_m
        columns, rows = np.floor(x / side).astype(np.int64), np.floor(y / side).astype(np.int64)
        found = np.empty(len(x))
        for column in np.unique(columns).tolist():
            strip = columns == column
            for row in np.unique(rows[strip]).tolist():
                here = np.flatnonzero(strip & (rows == row))
                heights = self._heights((column, row))
                most = len(heights) - 1
                east, north = _cell(x[here] - column * side, most), _cell(y[here] - row * side, most)
                found[here] = heights[east, north]
        return found


def _drawn(terrain: Terrain, key: TileKey) -> Array:
    """The tops of a square's blocks over the cells that their bounds touch."""
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
    """The cells of some distances from a square's corner; places and bounds go the same way, so rounding parts none."""
    return np.clip(np.floor(metres / CELL_M), 0, most).astype(np.int64)
