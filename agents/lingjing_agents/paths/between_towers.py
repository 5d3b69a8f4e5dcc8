"""Flights at one height between buildings that rise above it: straight where no wall is near, else around them.

Obstacles are the outlines of buildings with a margin. A path is planned on a grid of square cells (A*) and reduced to
its corners. A place inside a building or too close to it is replaced by the nearest free one.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING

from lingjing_agents.ground_plane import GroundPoint
from lingjing_agents.paths.grid_search import NEIGHBOURS, GridCell, cheapest_path, straightened

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray
    from shapely.geometry.base import BaseGeometry

MARGIN_M = 12.0
"""Least horizontal distance in metres between a flight and a wall. Chosen: a second of flight at cruise speed."""
OVER_M = 5.0
"""Height in metres above a roof from which a flight may cross the building. Chosen."""
CELL_M = 6.0
"""Side of a grid cell in metres. Chosen: half the margin."""
AROUND_M = 300.0
"""Distance in metres by which a detour may leave the rectangle of its ends. Chosen: the front of a city block."""
_BESIDE_M = 6.0
"""Depth in metres within the margin at which a flight may begin. Chosen: half the margin."""
_OUTSIDE_M = 0.5
"""Distance in metres by which a free place lies beyond the margin. Chosen: larger than rounding errors."""


class TowerPaths:
    """The flights between some buildings, for a few heights.

    `buildings` holds the outline (east, north; metres) and the elevation of the top in metres of each.
    """

    def __init__(self, buildings: Iterable[tuple[Sequence[GroundPoint], float]]) -> None:
        import shapely

        self._tops = tuple((shapely.Polygon(outline), top_m) for outline, top_m in buildings)
        self._walls: dict[int, BaseGeometry] = {}

    def highest_m(self, start: GroundPoint, end: GroundPoint, within_m: float) -> float:
        """Return the elevation of the highest roof within a distance of a straight line; -inf without a building."""
        import shapely

        line = shapely.LineString([start, end])
        near = (top_m for outline, top_m in self._tops if line.dwithin(outline, within_m))
        return max(near, default=-math.inf)

    def free(self, place: GroundPoint, z_m: float) -> GroundPoint:
        """Return a place, or the nearest one that no building with its margin covers at an elevation."""
        import shapely

        walls = self._around(z_m)
        point = shapely.Point(place)
        if not walls.intersects(point):
            return place
        edge = shapely.get_point(shapely.shortest_line(walls.boundary, point), 0)
        length = math.dist(place, (edge.x, edge.y))
        share = (length + _OUTSIDE_M) / length if length > 0.0 else 1.0
        return place[0] + share * (edge.x - place[0]), place[1] + share * (edge.y - place[1])

    def next_place(self, here: GroundPoint, goal: GroundPoint, z_m: float) -> GroundPoint:
        """Return the next corner of the shortest flight to a free place at an elevation.

        It is the goal itself where a straight flight is free, or where no path leads there. A flight that begins
        beside a wall leaves it first.
        """
        walls = self._around(z_m)
        start = self.free(here, z_m)
        if math.dist(start, here) > _BESIDE_M:
            return start
        if _is_clear(walls, start, goal):
            return goal
        path = _path(walls, start, goal)
        return path[0] if path else goal

    def _around(self, z_m: float) -> BaseGeometry:
        """Return the outlines, with their margin, of the buildings that a flight at an elevation cannot cross."""
        import shapely

        level = math.floor(z_m)
        if level not in self._walls:
            tall = [outline.buffer(MARGIN_M) for outline, top_m in self._tops if top_m > level - OVER_M]
            self._walls[level] = shapely.union_all(tall)
            shapely.prepare(self._walls[level])
        return self._walls[level]


def _is_clear(walls: BaseGeometry, start: GroundPoint, end: GroundPoint) -> bool:
    import shapely

    return not walls.intersects(shapely.LineString([start, end]))


def _path(walls: BaseGeometry, here: GroundPoint, goal: GroundPoint) -> list[GroundPoint]:
    """Return the corners from here to the goal, without the start; empty without a path."""
    import numpy as np
    import shapely

    west, east = min(here[0], goal[0]) - AROUND_M, max(here[0], goal[0]) + AROUND_M
    south, north = min(here[1], goal[1]) - AROUND_M, max(here[1], goal[1]) + AROUND_M
    columns, rows = math.ceil((east - west) / CELL_M), math.ceil((north - south) / CELL_M)
    xs, ys = west + (np.arange(columns) + 0.5) * CELL_M, south + (np.arange(rows) + 0.5) * CELL_M
    closed = shapely.intersects_xy(walls, *np.meshgrid(xs, ys))

    def centre(cell: GridCell) -> GroundPoint:
        return float(xs[cell[1]]), float(ys[cell[0]])

    def cell_of(place: GroundPoint) -> GridCell:
        return math.floor((place[1] - south) / CELL_M), math.floor((place[0] - west) / CELL_M)

    def left(cell: GridCell) -> float:
        return math.dist(centre(cell), goal)

    row, column = cell_of(goal)
    ends = [(row + i, column + j) for i in (-1, 0, 1) for j in (-1, 0, 1) if left((row + i, column + j)) <= CELL_M]
    if not _connects(closed, cell_of(here), ends):
        return []

    def steps(cell: GridCell) -> Iterator[tuple[GridCell, float]]:
        for row, column, length in NEIGHBOURS:
            other = cell[0] + row, cell[1] + column
            if not (0 <= other[0] < rows and 0 <= other[1] < columns):
                continue
            if not closed[other]:
                yield other, length * CELL_M

    cells = cheapest_path(cell_of(here), steps, left, lambda cell: left(cell) <= CELL_M)
    if not cells:
        return []
    return straightened([here, *map(centre, cells), goal], lambda start, end: _is_clear(walls, start, end))


def _connects(closed: NDArray[np.bool_], start: GridCell, ends: Sequence[GridCell]) -> bool:
    """Return whether open cells lead from a cell, open or not, to an open one of others.

    Both sides grow in turn, the one with fewer cells at its rim first. Without this check, the search for the cheapest
    path visits every cell around a walled court before it returns without one: 21 s for a court 2.8 km away.
    """
    import numpy as np

    width = closed.shape[1] + 2
    marks = np.pad(closed, 1, constant_values=True).astype(np.int8).ravel()  # 0 open, 1 closed, 2 and 3 reached
    offsets = np.array([row * width + column for row, column, _ in NEIGHBOURS])
    first, *last = ((row + 1) * width + column + 1 for row, column in (start, *ends))
    rims = {2: np.array([first]), 3: np.array([end for end in last if not marks[end]], dtype=int)}
    for side, rim in rims.items():
        marks[rim] = side
    while all(rim.size for rim in rims.values()):
        side = min(rims, key=lambda side: rims[side].size)
        beside = np.unique(rims[side][:, None] + offsets)
        if (marks[beside] == 5 - side).any():
            return True
        rims[side] = beside[marks[beside] == 0]
        marks[rims[side]] = side
    return False
