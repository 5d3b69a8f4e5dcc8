"""The path with the fewest commands for a walker over ground seen from above.

Each leg costs a turn and a step per so many metres, so a few long legs are better than a short path with many corners.
Obstacles are known from points of depth pictures: buildings and low objects block their ground, crowns of trees only
the area around their trunks. The ground below the rest of a crown is hidden, and a car may stand there, so a leg across
it costs more. What stands on a place is read in the picture from nearest above it. Pictures from aside show leaning
walls and hide ground, and where a request describes them as rectangles, a tree beside a house becomes a part of it.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lingjing.plugins.geometry import bearing_deg, turn_deg
from lingjing_agents.ground_plane import GroundPoint, GroundRectangle
from lingjing_agents.perception.images import ByteImage, FloatArray, MaskArray, opencv

CELL_M = 0.5
"""Side of a grid cell in metres. Chosen."""
STEP_OVER_M, UNDER_M, STOREY_M = 0.35, 2.2, 4.2
"""Height limits in metres. A walker steps over lower objects than the first. Small objects above the second can be
walked under, except at their trunk. Large objects above the third are buildings. Chosen.
"""

LARGE_M, CROWN_M, BESIDE_M = 5.5, 3.0, 1.0
"""Least width of a building, shrinkage of crowns to their trunks, and distance of the path from obstacles, in metres.
Chosen.
"""

NODES_M, LEG_M = 4.0, 75.0
"""Spacing of possible corners and longest leg, in metres. Chosen."""

METRE = 0.012
"""Cost of a metre in commands, so that the shorter of two paths with equal commands is preferred. Chosen."""


HIDDEN = 2.5
"""Cost of a leg across hidden ground in commands. Chosen: a collision costs about five, and every second crown beside a
street hides a car."""


@dataclass(frozen=True, slots=True)
class OpenGround:
    """A grid of closed cells."""

    bounds: GroundRectangle
    """The area of the grid."""
    closed: MaskArray
    """(rows, columns), True for closed cells; rows from the south, columns from the west."""
    hidden: MaskArray | None = None
    """(rows, columns), True for cells below crowns; None if crowns are unknown."""

    def open_lines(self, here: GroundPoint, ends: FloatArray) -> MaskArray:
        """Return for each of `ends` (n, 2) whether the straight line from `here` is free, as (n,)."""
        is_open: MaskArray = np.logical_not(self._met(self.closed, here, ends))
        return is_open

    def hidden_lines(self, here: GroundPoint, ends: FloatArray) -> MaskArray:
        """Return for each of `ends` (n, 2) whether the straight line from `here` crosses hidden ground, as (n,)."""
        return np.zeros(len(ends), bool) if self.hidden is None else self._met(self.hidden, here, ends)

    def _met(self, cells: MaskArray, here: GroundPoint, ends: FloatArray) -> MaskArray:
        count = max(2, math.ceil(float(np.hypot(*(ends - here).T).max()) / CELL_M)) if len(ends) else 2
        share = np.linspace(0.0, 1.0, count)[None, :]
        column = ((here[0] + share * (ends[:, :1] - here[0]) - self.bounds.west) / CELL_M).astype(np.int64)
        row = ((here[1] + share * (ends[:, 1:] - here[1]) - self.bounds.south) / CELL_M).astype(np.int64)
        rows, columns = cells.shape
        crossed: MaskArray = cells[np.clip(row, 0, rows - 1), np.clip(column, 0, columns - 1)]
        return np.asarray(crossed.any(axis=1))


@dataclass(frozen=True, slots=True)
class PointsFromAbove:
    """The points of one picture from above."""

    over: GroundPoint
    """The place below the camera."""
    points: FloatArray
    """(n, 3): east, north, metres above the ground."""


def ground_of(views: Sequence[PointsFromAbove], bounds: GroundRectangle, here: GroundPoint) -> OpenGround:
    """Return the grid of obstacles in pictures from above. The walker's own place is free."""
    cv2 = opencv()
    tops = _tops(views, bounds)
    rows, columns = tops.shape
    building = cv2.morphologyEx((tops > STOREY_M).astype(np.uint8), cv2.MORPH_OPEN, _disc(LARGE_M))
    building = cv2.dilate(building, _disc(2.0))
    crowns = ((tops > UNDER_M) & (building == 0)).astype(np.uint8)
    _, labels, measures, middles = cv2.connectedComponentsWithStats(crowns)
    hidden = cv2.dilate(crowns, _disc(2.0 * BESIDE_M)) > 0
    crowns = cv2.erode(crowns, _disc(CROWN_M)) | _long_and_narrow(measures)[labels].astype(np.uint8)
    stems = np.minimum(np.round(middles[1:]).astype(np.int64), (columns - 1, rows - 1))
    crowns[stems[:, 1], stems[:, 0]] = 1
    low = ((tops > STEP_OVER_M) & (tops <= UNDER_M)).astype(np.uint8)
    standing = cv2.dilate(building | crowns | low, _disc(2.0 * BESIDE_M))
    away = np.hypot(*np.meshgrid(np.arange(columns) - (here[0] - bounds.west) / CELL_M,
                                 np.arange(rows) - (here[1] - bounds.south) / CELL_M))  # fmt: skip
    return OpenGround(bounds, (standing > 0) & (away > 2.5 / CELL_M), hidden)


def _long_and_narrow(measures: np.ndarray) -> MaskArray:
    """Return for each component of OpenCV's measures whether it is longer than a building is wide, and on average
    narrower than a crown: a high fence, or parked cars under a lamp."""
    cv2 = opencv()
    sides_m = measures[:, [cv2.CC_STAT_WIDTH, cv2.CC_STAT_HEIGHT]].max(axis=1) * CELL_M
    narrow: MaskArray = measures[:, cv2.CC_STAT_AREA] * CELL_M**2 < CROWN_M * sides_m
    is_fence: MaskArray = narrow & (sides_m > LARGE_M) & (np.arange(len(measures)) > 0)  # 0 is the ground
    return is_fence


def _tops(views: Sequence[PointsFromAbove], bounds: GroundRectangle) -> FloatArray:
    """Return the height of the top in each cell in metres, by the view from nearest above that has points there; 0
    without one."""
    columns = math.ceil((bounds.east - bounds.west) / CELL_M)
    rows = math.ceil((bounds.north - bounds.south) / CELL_M)
    east, north = np.meshgrid(bounds.west + (np.arange(columns) + 0.5) * CELL_M,
                              bounds.south + (np.arange(rows) + 0.5) * CELL_M)  # fmt: skip
    tops, nearest = np.zeros((rows, columns)), np.full((rows, columns), np.inf)
    for view in views:
        column = np.clip(((view.points[:, 0] - bounds.west) / CELL_M).astype(np.int64), 0, columns - 1)
        row = np.clip(((view.points[:, 1] - bounds.south) / CELL_M).astype(np.int64), 0, rows - 1)
        seen = np.full((rows, columns), -np.inf)
        np.maximum.at(seen, (row, column), view.points[:, 2])
        away = np.hypot(east - view.over[0], north - view.over[1])
        is_nearest = np.isfinite(seen) & (away < nearest)
        tops[is_nearest], nearest[is_nearest] = np.maximum(seen[is_nearest], 0.0), away[is_nearest]
    return tops


def fewest_commands(
    ground: OpenGround,
    within: GroundRectangle,
    here: GroundPoint,
    heading_deg: float,
    goal: GroundPoint,
    within_m: float,
    longest_m: float,
) -> tuple[GroundPoint, ...]:
    """Return the corners inside `within` of the path to within `within_m` of `goal`, without the start.

    Empty if no path is known or none is needed. `longest_m` is the longest step of the walker.
    """
    if math.dist(here, goal) <= within_m:
        return ()
    nodes = _nodes(ground, within, here)
    arrived = np.hypot(nodes[:, 0] - goal[0], nodes[:, 1] - goal[1]) <= within_m
    best = np.full(len(nodes), math.inf)
    best[0] = 0.0
    came: dict[int, int] = {}
    facing = {0: heading_deg}
    queue, done = [(0.0, 0)], np.zeros(len(nodes), bool)
    while queue:
        cost, index = heapq.heappop(queue)
        if done[index]:
            continue
        if arrived[index]:
            return _traced(nodes, came, index)
        done[index] = True
        at = float(nodes[index, 0]), float(nodes[index, 1])
        length = np.hypot(nodes[:, 0] - at[0], nodes[:, 1] - at[1])
        near = np.flatnonzero(~done & (length <= LEG_M) & (cost + 1.0 < best))
        near = near[ground.open_lines(at, nodes[near])]
        for other, is_hidden in zip(near.tolist(), ground.hidden_lines(at, nodes[near]).tolist(), strict=True):
            bearing = bearing_deg(at, (float(nodes[other, 0]), float(nodes[other, 1])))
            run = float(length[other])
            total = (
                cost + _turns(facing[index], bearing) + math.ceil(run / longest_m) + METRE * run + HIDDEN * is_hidden
            )
            if total < best[other]:
                best[other], came[other], facing[other] = total, index, bearing
                heapq.heappush(queue, (total, other))
    return ()


def _turns(heading_deg: float, bearing: float) -> int:
    off = abs(turn_deg(heading_deg, bearing))
    return 0 if off < 5.0 else 1 if off <= 90.0 else 2


def _nodes(ground: OpenGround, within: GroundRectangle, here: GroundPoint) -> FloatArray:
    """Return the start and the possible corners, (n, 2): the points of a lattice. In the square of a closed one, the
    free place farthest from obstacles: else a passage narrower than the lattice would have no corner.
    """
    bounds = ground.bounds
    rows, columns = ground.closed.shape
    clear = opencv().distanceTransform((~ground.closed).astype(np.uint8), opencv().DIST_L2, 5)
    nodes = [here]

    def cell(metres: float, low: float, count: int) -> int:
        return min(max(int((metres - low) / CELL_M), 0), count - 1)

    for north in np.arange(within.south, within.north, NODES_M).tolist():
        for east in np.arange(within.west, within.east, NODES_M).tolist():
            if not ground.closed[cell(north, bounds.south, rows), cell(east, bounds.west, columns)]:
                nodes.append((east, north))
                continue
            low, high = (cell(north + side, bounds.south, rows) for side in (-NODES_M / 2, NODES_M / 2))
            left, right = (cell(east + side, bounds.west, columns) for side in (-NODES_M / 2, NODES_M / 2))
            square = clear[low:high, left:right]
            if square.size and square.max() > 0.0:
                row, column = divmod(int(square.argmax()), square.shape[1])
                place = bounds.west + (left + column + 0.5) * CELL_M, bounds.south + (low + row + 0.5) * CELL_M
                nodes.append(place)
    return np.array(nodes)


def _traced(nodes: FloatArray, came: dict[int, int], index: int) -> tuple[GroundPoint, ...]:
    way = []
    while index in came:
        way.append((float(nodes[index, 0]), float(nodes[index, 1])))
        index = came[index]
    return tuple(reversed(way))


def _disc(metres: float) -> ByteImage:
    size = max(1, round(metres / CELL_M)) | 1
    disc: ByteImage = opencv().getStructuringElement(opencv().MORPH_ELLIPSE, (size, size))
    return disc
