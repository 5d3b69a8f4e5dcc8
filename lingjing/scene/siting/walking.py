"""The ground that a robot dog can walk on around a place, as a grid with path lengths."""

from __future__ import annotations

import heapq
from math import ceil, hypot
from typing import Any

from lingjing.mission.geometry2d import Extent, Vector2
from lingjing.scene.siting.city_view import CityView

CELL_M = 2.0
"""Side of a cell, metres (chosen)."""
SHORE_M = 1.5
"""Clearance from water, metres (chosen)."""

_STEPS = [(i, j, hypot(i, j)) for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j]


class WalkGrid:
    """The free cells in a box."""

    def __init__(self, view: CityView, box: Extent) -> None:
        import numpy as np
        import shapely

        self._west, self._south, east, north = box
        self.columns, self.rows = ceil((east - self._west) / CELL_M), ceil((north - self._south) / CELL_M)
        xs = self._west + (np.arange(self.columns) + 0.5) * CELL_M
        ys = self._south + (np.arange(self.rows) + 0.5) * CELL_M
        grid_x, grid_y = np.meshgrid(xs, ys, indexing="ij")
        blocked = _obstacles(view, shapely.box(*box))
        shapely.prepare(blocked)
        self.free = ~shapely.contains_xy(blocked, grid_x.ravel(), grid_y.ravel()).reshape(grid_x.shape)

    def cell(self, place: Vector2) -> tuple[int, int] | None:
        """The cell of a place; None outside of the box."""
        column, row = int((place[0] - self._west) // CELL_M), int((place[1] - self._south) // CELL_M)
        return (column, row) if 0 <= column < self.columns and 0 <= row < self.rows else None

    def place(self, cell: tuple[int, int]) -> Vector2:
        """The middle of a cell, metres."""
        return (
            round(self._west + (cell[0] + 0.5) * CELL_M, 2),
            round(self._south + (cell[1] + 0.5) * CELL_M, 2),
        )

    def nearest_free(self, place: Vector2, reach_m: float, within: Any = None) -> tuple[int, int] | None:
        """The free cell nearest to a place, among the cells in `within` (a mapping) if given; None if there is none."""
        middle = self.cell(place)
        if middle is None:
            return None
        many = ceil(reach_m / CELL_M)
        near = [
            (hypot(i, j), (middle[0] + i, middle[1] + j))
            for i in range(-many, many + 1)
            for j in range(-many, many + 1)
            if 0 <= middle[0] + i < self.columns and 0 <= middle[1] + j < self.rows
        ]
        candidates = (
            (away, cell)
            for away, cell in near
            if away * CELL_M <= reach_m and self.free[cell] and (within is None or cell in within)
        )
        return min(candidates, default=(0.0, None))[1]

    def lengths_from(self, start: tuple[int, int], most_m: float) -> dict[tuple[int, int], float]:
        """Path length by cell, metres, for all cells that can be reached within `most_m`."""
        lengths = {start: 0.0}
        free = self.free.tolist()  # a cell of a list is read in a third of the time
        waiting = [(0.0, start)]
        while waiting:
            length, cell = heapq.heappop(waiting)
            if length > lengths[cell]:
                continue
            for i, j, step in _STEPS:
                near = cell[0] + i, cell[1] + j
                if not (0 <= near[0] < self.columns and 0 <= near[1] < self.rows) or not free[near[0]][near[1]]:
                    continue
                total = length + step * CELL_M
                if total <= most_m and total < lengths.get(near, float("inf")):
                    lengths[near] = total
                    heapq.heappush(waiting, (total, near))
        return lengths


def _obstacles(view: CityView, box: Any) -> Any:
    import shapely

    wet = view.water.intersection(box.buffer(5.0)).buffer(SHORE_M)
    tree, margins = view.obstacles
    near = sorted(int(k) for k in tree.query(box.buffer(5.0)))
    return shapely.union_all([wet, *(tree.geometries[k].buffer(margins[k], quad_segs=2) for k in near)])
