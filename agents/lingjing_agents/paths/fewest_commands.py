"""The way that takes a walker the fewest commands over ground seen from above.

Each leg costs a turn and a step for every so many metres, so few long legs are better than a short way with many
corners. What stands is known from points of depth pictures: buildings and low things close their ground, crowns of
trees only that around their stems.
"""

from __future__ import annotations

import heapq
import math
from dataclasses import dataclass

import numpy as np

from lingjing.plugins.geometry import bearing_deg, turn_deg
from lingjing_agents.ground_plane import GroundPoint, GroundRectangle
from lingjing_agents.perception.images import ByteImage, FloatArray, MaskArray, opencv

CELL_M = 0.5
STEP_OVER_M, UNDER_M, STOREY_M = 0.35, 2.2, 4.2
"""What is lower is stepped over; what is higher than the second and small may be walked under, but for its stem; what
is higher than the third and large is a building."""

LARGE_M, CROWN_M, BESIDE_M = 5.5, 3.0, 1.0
"""How wide a building is at least, by how much crowns shrink to their stems, and how far the way keeps from things."""

NODES_M, LEG_M = 4.0, 75.0
"""How close the corners to choose from lie, and how long a leg may be."""

METRE = 0.012
"""What a metre costs, in commands: of two ways with as many the shorter is taken."""


@dataclass(frozen=True, slots=True)
class OpenGround:
    """Which cells of `CELL_M` within `bounds` are closed; rows from the south, columns from the west."""

    bounds: GroundRectangle
    closed: MaskArray

    def open_lines(self, here: GroundPoint, ends: FloatArray) -> MaskArray:
        """Whether straight walks from `here` to each of `ends` (n, 2) meet nothing."""
        count = max(2, math.ceil(float(np.hypot(*(ends - here).T).max()) / CELL_M)) if len(ends) else 2
        share = np.linspace(0.0, 1.0, count)[None, :]
        column = ((here[0] + share * (ends[:, :1] - here[0]) - self.bounds.west) / CELL_M).astype(np.int64)
        row = ((here[1] + share * (ends[:, 1:] - here[1]) - self.bounds.south) / CELL_M).astype(np.int64)
        rows, columns = self.closed.shape
        met = self.closed[np.clip(row, 0, rows - 1), np.clip(column, 0, columns - 1)]
        found: MaskArray = np.logical_not(met.any(axis=1))
        return found


def ground_of(points: FloatArray, bounds: GroundRectangle, here: GroundPoint) -> OpenGround:
    """What stands, from points (n, 3; east, north, metres over the ground); the walker's own place is free."""
    cv2 = opencv()
    columns = math.ceil((bounds.east - bounds.west) / CELL_M)
    rows = math.ceil((bounds.north - bounds.south) / CELL_M)
    column = np.clip(((points[:, 0] - bounds.west) / CELL_M).astype(np.int64), 0, columns - 1)
    row = np.clip(((points[:, 1] - bounds.south) / CELL_M).astype(np.int64), 0, rows - 1)
    tops = np.zeros((rows, columns))
    np.maximum.at(tops, (row, column), points[:, 2])
    building = cv2.morphologyEx((tops > STOREY_M).astype(np.uint8), cv2.MORPH_OPEN, _disc(LARGE_M))
    building = cv2.dilate(building, _disc(2.0))
    crowns = ((tops > UNDER_M) & (building == 0)).astype(np.uint8)
    _, _, _, middles = cv2.connectedComponentsWithStats(crowns)
    crowns = cv2.erode(crowns, _disc(CROWN_M))
    stems = np.minimum(np.round(middles[1:]).astype(np.int64), (columns - 1, rows - 1))
    crowns[stems[:, 1], stems[:, 0]] = 1
    low = ((tops > STEP_OVER_M) & (tops <= UNDER_M)).astype(np.uint8)
    standing = cv2.dilate(building | crowns | low, _disc(2.0 * BESIDE_M))
    away = np.hypot(*np.meshgrid(np.arange(columns) - (here[0] - bounds.west) / CELL_M,
                                 np.arange(rows) - (here[1] - bounds.south) / CELL_M))  # fmt: skip
    return OpenGround(bounds, (standing > 0) & (away > 2.5 / CELL_M))


def fewest_commands(
    ground: OpenGround,
    within: GroundRectangle,
    here: GroundPoint,
    heading_deg: float,
    goal: GroundPoint,
    within_m: float,
    longest_m: float,
) -> tuple[GroundPoint, ...]:
    """Corners inside `within` of the way to within `within_m` of `goal`, without the start; empty if none is known or
    needed."""
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
        for other in near[ground.open_lines(at, nodes[near])].tolist():
            bearing = bearing_deg(at, (float(nodes[other, 0]), float(nodes[other, 1])))
            run = float(length[other])
            total = cost + _turns(facing[index], bearing) + math.ceil(run / longest_m) + METRE * run
            if total < best[other]:
                best[other], came[other], facing[other] = total, index, bearing
                heapq.heappush(queue, (total, other))
    return ()


def _turns(heading_deg: float, bearing: float) -> int:
    off = abs(turn_deg(heading_deg, bearing))
    return 0 if off < 5.0 else 1 if off <= 90.0 else 2


def _nodes(ground: OpenGround, within: GroundRectangle, here: GroundPoint) -> FloatArray:
    """The start and all free places of a lattice."""
    bounds = ground.bounds
    east = np.arange(within.west, within.east, NODES_M)
    north = np.arange(within.south, within.north, NODES_M)
    lattice = np.stack(np.meshgrid(east, north), axis=-1).reshape(-1, 2)
    rows, columns = ground.closed.shape
    row = np.minimum(((lattice[:, 1] - bounds.south) / CELL_M).astype(np.int64), rows - 1)
    column = np.minimum(((lattice[:, 0] - bounds.west) / CELL_M).astype(np.int64), columns - 1)
    return np.vstack([np.array([here]), lattice[~ground.closed[row, column]]])


def _traced(nodes: FloatArray, came: dict[int, int], index: int) -> tuple[GroundPoint, ...]:
    way = []
    while index in came:
        way.append((float(nodes[index, 0]), float(nodes[index, 1])))
        index = came[index]
    return tuple(reversed(way))


def _disc(metres: float) -> ByteImage:
    size = max(1, round(metres / CELL_M)) | 1
    found: ByteImage = opencv().getStructuringElement(opencv().MORPH_ELLIPSE, (size, size))
    return found
