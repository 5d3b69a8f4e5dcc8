"""`Spacing`: places with a minimum distance, in a spatial index of cells, so that each query takes constant time."""

from __future__ import annotations

import math

_MARGIN = 1.0 + 1e-6
"""Ratio of cell size and distance (chosen): two near places are never two cells apart because of rounding."""

_MAX_CELLS = 1e6
"""Cells along the longer side (chosen): larger cell numbers would not be exact."""


class Spacing:
    """Places pairwise at least `apart` metres from each other; `extent` is the largest coordinate, metres.

    The results equal those of a comparison with every place.
    """

    __slots__ = ("_apart", "_cell", "_cells")

    def __init__(self, apart: float, extent: float) -> None:
        self._apart = apart
        self._cell = max(apart * _MARGIN, extent / _MAX_CELLS)
        self._cells: dict[tuple[int, int], list[tuple[float, float]]] = {}

    def add(self, east: float, north: float) -> None:
        """Add a place."""
        if self._apart > 0:
            self._cells.setdefault(self._at(east, north), []).append((east, north))

    def is_free(self, east: float, north: float) -> bool:
        """True if a point has the minimum distance from all places."""
        if self._apart <= 0:
            return True
        column, row = self._at(east, north)
        return all(
            math.hypot(east - x, north - y) >= self._apart
            for c in (column - 1, column, column + 1)
            for r in (row - 1, row, row + 1)
            for x, y in self._cells.get((c, r), ())
        )

    def _at(self, east: float, north: float) -> tuple[int, int]:
        return math.floor(east / self._cell), math.floor(north / self._cell)
