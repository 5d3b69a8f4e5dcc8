"""A walker's map: where it has bumped into something or seen a wall; everything else counts as free until proven not.

Routes are planned over what is known (A* on a grid) and planned anew at every step, so an unknown building is felt out
side by side: each bump closes a few metres, and the way around becomes the shortest.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field

from lingjing_agents.ground_plane import GroundPoint, GroundRectangle, between
from lingjing_agents.paths.grid_search import NEIGHBOURS, GridCell, cheapest_path, straightened

CELL_M = 1.5
SIDES = 5
MOST_CELLS = 60_000
"""So many cells are looked at before there is no path."""
NEAR_COST = 2.0
"""What a step beside something closed costs more, in cells: keeps the way off walls where there is room."""


@dataclass(slots=True)
class ObstacleGrid:
    """What one walker knows of the ground. Cells are squares of `CELL_M` metres."""

    bounds: GroundRectangle = field(default_factory=GroundRectangle)
    closed: set[GridCell] = field(default_factory=set)
    trodden: set[GridCell] = field(default_factory=set)

    def reach(self, place: GroundPoint, margin_m: float) -> None:
        """Routes may go as far as a place and so much beyond."""
        own = self.bounds
        corners = ((own.west, own.south), (own.east, own.north))
        near = ((place[0] - margin_m, place[1] - margin_m), (place[0] + margin_m, place[1] + margin_m))
        self.bounds = GroundRectangle.around((*corners, *near))

    def tread(self, place: GroundPoint) -> None:
        """Somebody stands here, so it is free."""
        cell = _cell(place)
        self.trodden.add(cell)
        self.closed.discard(cell)

    def close(self, place: GroundPoint) -> None:
        """Something is in the way here; where somebody has walked stays free."""
        cell = _cell(place)
        if cell not in self.trodden:
            self.closed.add(cell)

    def wall(self, a: GroundPoint, b: GroundPoint) -> None:
        """Something long is in the way from one place to another; where somebody has walked stays free."""
        count = max(1, math.ceil(math.dist(a, b) / (CELL_M / 3)))
        for index in range(count + 1):
            self.close(between(a, b, index / count))

    def bump(self, here: GroundPoint, heading_deg: float, *, half_width_m: float = 2.4) -> None:
        """A walk along `heading_deg` ended here against something: close a short wall ahead, even where somebody has
        walked (whatever it is may have come since), but not the cell one stands in."""
        east, north = math.sin(math.radians(heading_deg)), math.cos(math.radians(heading_deg))
        start = _cell(here)
        for ahead in (CELL_M / 2, CELL_M, 1.5 * CELL_M):
            for index in range(-SIDES, SIDES + 1):
                side = half_width_m * index / SIDES
                if ahead < CELL_M and side != 0.0:
                    continue  # the flanks are free: it stands there
                cell = _cell((here[0] + ahead * east + side * north, here[1] + ahead * north - side * east))
                if cell != start:
                    self.trodden.discard(cell)
                    self.closed.add(cell)

    def forget(self) -> None:
        """All that is closed may be open again: what stood there may have gone."""
        self.closed.clear()

    def clear(self, here: GroundPoint, there: GroundPoint) -> bool:
        """Whether nothing known is in the way of a straight walk."""
        length = math.dist(here, there)
        count = max(1, math.ceil(length / (CELL_M / 3)))
        start = _cell(here)
        for index in range(count + 1):
            cell = _cell(between(here, there, index / count))
            if cell != start and cell in self.closed:
                return False
        return True

    def route(self, here: GroundPoint, goal: GroundPoint, *, reach_m: float = 0.0) -> tuple[GroundPoint, ...]:
        """Corners of the shortest known way to within `reach_m` of `goal`, without the start; empty if there is
        none or none is needed."""
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
        """The open neighbours of a cell; nothing goes between two closed ones."""
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
        """A straight walk with half a metre to spare on both sides."""
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
