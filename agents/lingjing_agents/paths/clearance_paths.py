"""Paths for dogs over a map of the distance to the next obstacle."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from lingjing.plugins.terrain import ObstacleMap
from lingjing_agents.ground_plane import GroundPoint, between
from lingjing_agents.paths.grid_search import NEIGHBOURS, GridCell, cheapest_path, straightened

NARROW_M = 0.45
"""Least distance in metres between an obstacle and a dog's centre. Chosen: half a dog's length with a margin."""

WIDE_M = 1.2
"""Distance in metres to obstacles below which a path is more expensive. Chosen."""

_DEAR = 2.5
"""Cost factor of cells nearer to an obstacle than `WIDE_M`. Chosen."""


def find_path(
    ground: ObstacleMap, start: GroundPoint, goal: GroundPoint, within_m: float, shut: Sequence[GroundPoint] = ()
) -> list[GroundPoint]:
    """Return points to walk to, in order, until the goal is `within_m` metres away; [] if no path leads there.

    `shut` are places that were found to be blocked; the path keeps a metre away from them.
    """
    rows, columns = ground.clearance_m.shape
    closed = {cell for place in shut for cell in _around(ground, place)}

    def holds(cell: GridCell) -> bool:
        return bool(0 <= cell[0] < rows and 0 <= cell[1] < columns)

    def steps(cell: GridCell) -> Iterator[tuple[GridCell, float]]:
        for row, column, length in NEIGHBOURS:
            following = cell[0] + row, cell[1] + column
            if not holds(following) or following in closed:
                continue
            clear = float(ground.clearance_m[following])
            if clear >= NARROW_M or math.dist(ground.middle(*following), start) <= 1.0:
                yield following, length * ground.cell_m * (_DEAR if clear < WIDE_M else 1.0)

    def left(cell: GridCell) -> float:
        return max(0.0, math.dist(ground.middle(*cell), goal) - within_m)

    first = ground.cell(*start)
    cells = cheapest_path(first, steps, left, lambda cell: left(cell) <= 0.0) if holds(first) else []
    path = [start, *(ground.middle(*cell) for cell in cells)]
    return straightened(path, lambda here, there: _free(ground, here, there, shut))


def _around(ground: ObstacleMap, place: GroundPoint) -> list[GridCell]:
    row, column = ground.cell(*place)
    reach = math.ceil(1.0 / ground.cell_m)
    span = range(-reach, reach + 1)
    return [(row + r, column + c) for r in span for c in span if math.hypot(r, c) <= reach]


def _free(ground: ObstacleMap, start: GroundPoint, end: GroundPoint, shut: Sequence[GroundPoint]) -> bool:
    length = math.dist(start, end)
    rows, columns = ground.clearance_m.shape
    for number in range(1, math.ceil(length / 0.3) + 1):
        share = min(1.0, 0.3 * number / max(length, 1e-9))
        point = between(start, end, share)
        row, column = ground.cell(*point)
        if not (0 <= row < rows and 0 <= column < columns):
            return False
        # The error of a turn makes a walk deviate from its line, so long legs keep farther away.
        wanted = NARROW_M + min(0.4, 0.02 * share * length)
        if ground.clearance_m[row, column] < wanted and math.dist(point, start) > 1.0:
            return False
        if any(math.dist(point, place) < 1.0 for place in shut):
            return False
    return True
