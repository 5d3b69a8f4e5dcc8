"""Path search over a grid (A*), and the reduction of a path of neighbouring cells to the fewest straight legs."""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable, Iterable, Sequence

from lingjing_agents.ground_plane import GroundPoint

GridCell = tuple[int, int]
"""Two integer indices; their axes depend on the map."""

NEIGHBOURS = tuple((i, j, math.hypot(i, j)) for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j)
"""Steps to the eight neighbours of a cell with their lengths, in cells."""


def cheapest_path(
    start: GridCell,
    steps: Callable[[GridCell], Iterable[tuple[GridCell, float]]],
    left: Callable[[GridCell], float],
    arrived: Callable[[GridCell], bool],
    *,
    most_cells: float = math.inf,
) -> list[GridCell]:
    """Return the cells of the cheapest path from `start` to the first cell with `arrived`, without `start` (A*).

    Empty if no path is found within `most_cells` expanded cells, or none is needed. `steps` yields the neighbours of a
    cell with the cost of each; `left` is a lower bound of the cost from a cell.
    """
    cost, before = {start: 0.0}, dict[GridCell, GridCell]()
    queue, done = [(left(start), start)], set[GridCell]()
    while queue and len(done) < most_cells:
        _, cell = heapq.heappop(queue)
        if cell in done:
            continue
        done.add(cell)
        if arrived(cell):
            return _traced(before, cell)
        for other, step in steps(cell):
            total = cost[cell] + step
            if other not in done and total < cost.get(other, math.inf):
                cost[other], before[other] = total, cell
                heapq.heappush(queue, (total + left(other), other))
    return []


def straightened(points: Sequence[GroundPoint], free: Callable[[GroundPoint, GroundPoint], bool]) -> list[GroundPoint]:
    """Reduce a path to corners with straight legs, each to the farthest point with a `free` line; the first point is
    left out.
    """
    corners, at = list[GroundPoint](), 0
    while at < len(points) - 1:
        ahead = range(len(points) - 1, at + 1, -1)
        at = next((far for far in ahead if free(points[at], points[far])), at + 1)
        corners.append(points[at])
    return corners


def _traced(before: dict[GridCell, GridCell], cell: GridCell) -> list[GridCell]:
    path = [cell]
    while cell in before:
        cell = before[cell]
        path.append(cell)
    return path[-2::-1]
