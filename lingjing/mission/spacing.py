"""`Spacing`: places that keep a distance from each other, looked up by cells so that a thousand cost a thousand."""

from __future__ import annotations

import math

MARGIN = 1.0 + 1e-6
"""Cells are wider than the distance by this, so that rounding never puts two near places two cells apart."""

MOST_CELLS = 1e6
"""Cells along the longer side; numbers of cells beyond that would no longer be exact."""


class Spacing:
    """Places pairwise at least `apart` metres from each other; `extent` is how wide they lie, metres.

    The answers are those of comparing with every place one by one.
    """

    __slots__ = ("_apart", "_cell", "_cells")

    def __init__(self, apart: float, extent: float) -> None:
        self._apart = apart
        self._cell = max(apart * MARGIN, extent / MOST_CELLS)
        self._cells: dict[tuple[int, int], list[tuple[float, float]]] = {}

    def add(self, east: float, north: float) -> None:
        """Take a place."""
        if self._apart > 0:
            self._cells.setdefault(self._at(east, north), []).append((east, north))

    def is_free(self, east: float, north: float) -> bool:
        """Whether a place keeps its distance from all that are taken."""
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
