"""Ways for legs: A* over a map of obstacles, and the fewest straight legs that keep clear of them."""

from __future__ import annotations

import heapq
import math
from collections.abc import Sequence

from lingjing.plugins.terrain import ObstacleMap
from lingjing_agents.ground_plane import GroundPoint, between

NARROW_M = 0.45
"""Nothing may come nearer to a dog's middle than this."""

WIDE_M = 1.2
"""Nearer to anything than this a way is dearer."""

_DEAR = 2.5
_ROUND = tuple((r, c, math.hypot(r, c)) for r in (-1, 0, 1) for c in (-1, 0, 1) if r or c)


def find_way(
    ground: ObstacleMap, start: GroundPoint, goal: GroundPoint, within_m: float, shut: Sequence[GroundPoint] = ()
) -> list[GroundPoint]:
    """Points to walk to, one after another, until the goal is `within_m` away; [] if no way leads there.

    `shut` are places that turned out to be blocked: they are kept a metre away from.
    """
    cells = _search(ground, start, goal, within_m, shut)
    return _pulled(ground, [start, *(ground.middle(*cell) for cell in cells[1:])], shut)[1:]


def _search(
    ground: ObstacleMap, start: GroundPoint, goal: GroundPoint, within_m: float, shut: Sequence[GroundPoint]
) -> list[tuple[int, int]]:
    rows, columns = ground.clearance_m.shape
    clearance = ground.clearance_m
    first = ground.cell(*start)
    if not (0 <= first[0] < rows and 0 <= first[1] < columns):
        return []
    closed = {cell for place in shut for cell in _around(ground, place)}
    away = _away(ground, goal, within_m)
    cost = {first: 0.0}
    before: dict[tuple[int, int], tuple[int, int]] = {}
    queue = [(away(first), 0.0, first)]
    while queue:
        _, spent, cell = heapq.heappop(queue)
        if spent > cost[cell]:
            continue
        if away(cell) <= 0.0:
            return _back(before, cell)
        for row, column, length in _ROUND:
            following = cell[0] + row, cell[1] + column
            if not (0 <= following[0] < rows and 0 <= following[1] < columns) or following in closed:
                continue
            clear = float(clearance[following])
            if clear < NARROW_M and math.dist(ground.middle(*following), start) > 1.0:
                continue
            total = spent + length * ground.cell_m * (_DEAR if clear < WIDE_M else 1.0)
            if total < cost.get(following, math.inf):
                cost[following], before[following] = total, cell
                heapq.heappush(queue, (total + away(following), total, following))
    return []


def _away(ground: ObstacleMap, goal: GroundPoint, within_m: float):  # type: ignore[no-untyped-def]
    return lambda cell: max(0.0, math.dist(ground.middle(*cell), goal) - within_m)


def _around(ground: ObstacleMap, place: GroundPoint) -> list[tuple[int, int]]:
    row, column = ground.cell(*place)
    reach = math.ceil(1.0 / ground.cell_m)
    span = range(-reach, reach + 1)
    return [(row + r, column + c) for r in span for c in span if math.hypot(r, c) <= reach]


def _back(before: dict[tuple[int, int], tuple[int, int]], cell: tuple[int, int]) -> list[tuple[int, int]]:
    cells = [cell]
    while cell in before:
        cell = before[cell]
        cells.append(cell)
    return cells[::-1]


def _pulled(ground: ObstacleMap, points: list[GroundPoint], shut: Sequence[GroundPoint]) -> list[GroundPoint]:
    """The same way with as few corners as straight lines allow."""
    kept, at = points[:1], 0
    while at < len(points) - 1:
        far = at + 1
        for candidate in range(len(points) - 1, at + 1, -1):
            if _free(ground, points[at], points[candidate], shut):
                far = candidate
                break
        kept.append(points[far])
        at = far
    return kept


def _free(ground: ObstacleMap, start: GroundPoint, end: GroundPoint, shut: Sequence[GroundPoint]) -> bool:
    length = math.dist(start, end)
    rows, columns = ground.clearance_m.shape
    for number in range(1, math.ceil(length / 0.3) + 1):
        share = min(1.0, 0.3 * number / max(length, 1e-9))
        point = between(start, end, share)
        row, column = ground.cell(*point)
        if not (0 <= row < rows and 0 <= column < columns):
            return False
        # A walk strays from its line by what a turn errs, so long legs keep farther away.
        wanted = NARROW_M + min(0.4, 0.02 * share * length)
        if ground.clearance_m[row, column] < wanted and math.dist(point, start) > 1.0:
            return False
        if any(math.dist(point, place) < 1.0 for place in shut):
            return False
    return True
