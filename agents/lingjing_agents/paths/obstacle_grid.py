"""A walker's map of obstacles that it has met or seen; all other ground counts as free.

Paths are planned over the known obstacles (A* on a grid) and planned again at every step. An unknown building is thus
explored along its sides: each collision closes a few metres, and the path around becomes the shortest.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field

from lingjing_agents.ground_plane import GroundPoint, GroundRectangle, between
from lingjing_agents.paths.grid_search import NEIGHBOURS, GridCell, cheapest_path, straightened

CELL_M = 1.5
"""Side of a grid cell in metres. Chosen."""
SIDES = 5
"""Samples on each side of a collision's wall. Chosen."""
MOST_CELLS = 60_000
"""Expanded cells after which a search ends without a path. Chosen."""
NEAR_COST = 2.0
"""Additional cost of a step beside a closed cell, in cells. Keeps paths off walls where there is room. Chosen."""


@dataclass(slots=True)
class ObstacleGrid:
    """The map of one walker, in square cells of `CELL_M` metres."""

    bounds: GroundRectangle = field(default_factory=GroundRectangle)
    """The area in which paths may lie."""
    closed: set[GridCell] = field(default_factory=set)
    """Cells with an obstacle."""
    trodden: set[GridCell] = field(default_factory=set)
    """Cells in which the walker has stood."""

    def reach(self, place: GroundPoint, margin_m: float) -> None:
        """Extend the bounds to a place with a margin."""
        own = self.bounds
        corners = ((own.west, own.south), (own.east, own.north))
        near = ((place[0] - margin_m, place[1] - margin_m), (place[0] + margin_m, place[1] + margin_m))
        self.bounds = GroundRectangle.around((*corners, *near))

    def tread(self, place: GroundPoint) -> None:
        """Mark the cell of a place in which the walker stands as free."""
        cell = _cell(place)
        self.trodden.add(cell)
        self.closed.discard(cell)

    def close(self, place: GroundPoint) -> None:
        """Close the cell of a place unless the walker has stood in it."""
        cell = _cell(place)
        if cell not in self.trodden:
            self.closed.add(cell)

    def wall(self, a: GroundPoint, b: GroundPoint) -> None:
        """Close the cells between two places unless the walker has stood in them."""
        count = max(1, math.ceil(math.dist(a, b) / (CELL_M / 3)))
        for index in range(count + 1):
            self.close(between(a, b, index / count))

    def bump(self, here: GroundPoint, heading_deg: float, *, half_width_m: float = 2.4) -> None:
        """Close a short wall ahead after a walk along `heading_deg` ended at `here`.

        Cells in which the walker has stood are closed too, since the obstacle may be new. The walker's own cell stays
        free.
        """
        east, north = math.sin(math.radians(heading_deg)), math.cos(math.radians(heading_deg))
        start = _cell(here)
        for ahead in (CELL_M / 2, CELL_M, 1.5 * CELL_M):
            for index in range(-SIDES, SIDES + 1):
                side = half_width_m * index / SIDES
                if ahead < CELL_M and side != 0.0:
                    continue  # the walker stands beside its centre line, so the flanks are free
                cell = _cell((here[0] + ahead * east + side * north, here[1] + ahead * north - side * east))
                if cell != start:
                    self.trodden.discard(cell)
                    self.closed.add(cell)

    def forget(self) -> None:
        """Clear all closed cells: the obstacles may have moved."""
        self.closed.clear()

    def clear(self, here: GroundPoint, there: GroundPoint) -> bool:
        """Return whether a straight walk meets no known obstacle."""
        length = math.dist(here, there)
        count = max(1, math.ceil(length / (CELL_M / 3)))
        start = _cell(here)
        for index in range(count + 1):
            cell = _cell(between(here, there, index / count))
            if cell != start and cell in self.closed:
                return False
        return True

    def route(self, here: GroundPoint, goal: GroundPoint, *, reach_m: float = 0.0) -> tuple[GroundPoint, ...]:
        """Return the corners of the shortest known path to within `reach_m` of `goal`, without the start.

        Empty if there is no path or none is needed.
        """
        if math.dist(here, goal) <= reach_m:
            return ()
        if self.clear(here, goal):
            return (goal,)
        gx, gy = goal[0] / CELL_M - 0.5, goal[1] / CELL_M - 0.5
        reach = max(reach_m, CELL_M) / CELL_M

        def left(cell: GridCell) -> float:
            return math.hypot(cell[0] - gx, cell[1] - gy)

        cells = cheapest_path(_cell(here), self._steps, left, lambda cell: left(cell) <= reach, most_cells=MOST_CELLS)
        places = [_centre(cell) for cell in cells]
        if places and math.dist(places[-1], goal) <= 2 * CELL_M and self.clear(places[-1], goal):
            places.append(goal)
        return tuple(straightened([here, *places], self._roomy))

    def _steps(self, cell: GridCell) -> Iterator[tuple[GridCell, float]]:
        """Yield the open neighbours of a cell. No step passes diagonally between closed cells."""
        for i, j, length in NEIGHBOURS:
            other = cell[0] + i, cell[1] + j
            if other in self.closed or not self.bounds.holds(_centre(other)):
                continue
            if i and j and ((cell[0] + i, cell[1]) in self.closed or (cell[0], cell[1] + j) in self.closed):
                continue
            yield other, length + (NEAR_COST if self._beside(other) else 0.0)

    def _beside(self, cell: GridCell) -> bool:
        i, j = cell
        closed = self.closed
        return bool(closed) and (
            (i + 1, j) in closed or (i - 1, j) in closed or (i, j + 1) in closed or (i, j - 1) in closed
        )

    def _roomy(self, here: GroundPoint, there: GroundPoint) -> bool:
        """Return whether a straight walk has a margin of 0.6 m on both sides."""
        length = math.dist(here, there)
        if length == 0.0:
            return True
        side = (there[1] - here[1]) / length * 0.6, -(there[0] - here[0]) / length * 0.6
        return all(
            self.clear((here[0] + k * side[0], here[1] + k * side[1]), (there[0] + k * side[0], there[1] + k * side[1]))
            for k in (-1.0, 1.0)
        )


def _cell(place: GroundPoint) -> GridCell:
    return math.floor(place[0] / CELL_M), math.floor(place[1] / CELL_M)


def _centre(cell: GridCell) -> GroundPoint:
    return (cell[0] + 0.5) * CELL_M, (cell[1] + 0.5) * CELL_M
