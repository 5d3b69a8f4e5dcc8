"""Queues of vehicles on the lane of a route.

Only the route's own road is examined: a strip along it is cut out of the picture at a fixed scale. Asphalt is smooth
along a lane, vehicles are not. A station of the strip is therefore occupied if the colour around it varies, except for
leaves of trees. Runs with the length of a vehicle are counted; four or more within a few car lengths are a queue.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from lingjing.plugins.geometry import world_to_pixel
from lingjing.plugins.policy import CameraPose
from lingjing_agents.ground_plane import GroundPoint
from lingjing_agents.perception.images import ByteImage, ImageBox, MaskArray, opencv, runs

STEP_M = 0.2
"""Distance between two stations of a strip in metres. Chosen."""
HALF_LANE_M = 0.8
"""Half the width of a strip in metres."""
OFFSETS_M = (-3.3, -2.2, -1.1, 0.0, 1.1)
"""Offsets in metres from the route's line at which queues are searched for. The line is straight between waypoints,
lanes are not.
"""
CONTRAST = 7.0
"""Standard deviation of the lane's colour (grey levels) from which on a station is occupied."""
WINDOW_M = 2.0
"""Length in metres over which the deviation is computed."""
VEHICLE_M = (3.0, 14.0)
"""Shortest and longest vehicle in metres. Chosen."""
GAP_M = 26.0
"""Largest distance in metres between the fronts of two vehicles of a queue."""
QUEUE_OF = 4
"""Least number of vehicles of a queue. Chosen."""
STRAIGHT = 0.995
"""Cosine of the largest turn that counts as none."""
SPLIT_M = 1.6
"""Largest gap in metres within one vehicle. Chosen."""


@dataclass(frozen=True, slots=True)
class VehicleQueue:
    """A queue of vehicles."""

    box: ImageBox
    """Normalised x0, y0, x1, y1."""
    confidence: float
    """Confidence of the detection, 0 to 1."""
    place: GroundPoint
    """East and north of its centre in metres."""
    vehicles: int
    """Number of vehicles."""


def find_queues(
    rgb: ByteImage, pose: CameraPose, level_m: float, line: tuple[GroundPoint, ...] = ()
) -> tuple[VehicleQueue, ...]:
    """Return the queues in a nadir picture (height, width, 3) along `line` (east, north; m), the longest first."""
    if not rgb.any():
        return ()
    queues = []
    for start, end in pairwise(corners(line)):
        for offset in OFFSETS_M:
            queue = _along(rgb, pose, level_m, moved_leg(start, end, offset))
            if queue is not None:
                queues.append(queue)
    return tuple(sorted(queues, key=lambda queue: (-queue.vehicles, queue.box)))


def corners(line: tuple[GroundPoint, ...]) -> tuple[GroundPoint, ...]:
    """Return the line with a corner at each turn: straight on from the previous point, then perpendicular to the
    next.
    """
    if len(line) < 2:
        return line
    path = [line[0], line[1]]
    ahead = _unit(line[0], line[1])
    for before, after in pairwise(line[1:]):
        run = (after[0] - before[0]) * ahead[0] + (after[1] - before[1]) * ahead[1]
        corner = before[0] + run * ahead[0], before[1] + run * ahead[1]
        if run > 0.0 and 3.0 < math.dist(corner, before) < 60.0 and math.dist(corner, after) > 3.0:
            path.append(corner)
            before = corner
        ahead = _unit(before, after)
        path.append(after)
    return _straightened(path)


def _straightened(path: list[GroundPoint]) -> tuple[GroundPoint, ...]:
    """Return the path without points at which it goes straight on, since a queue may extend over one."""
    kept = path[:1]
    for here, after in pairwise(path[1:]):
        a, b = _unit(kept[-1], here), _unit(here, after)
        if a[0] * b[0] + a[1] * b[1] < STRAIGHT:
            kept.append(here)
    return (*kept, path[-1])


def _along(
    rgb: ByteImage, pose: CameraPose, level_m: float, leg: tuple[GroundPoint, GroundPoint]
) -> VehicleQueue | None:
    """Return the longest queue on one straight piece of lane, or None."""
    strip = strip_along(rgb, pose, level_m, leg)
    if strip is None:
        return None
    pieces = runs(occupied(strip), round(SPLIT_M / STEP_M))
    vehicles = [run for run in pieces if VEHICLE_M[0] <= (run[1] - run[0]) * STEP_M <= VEHICLE_M[1]]
    best: list[tuple[int, int]] = []
    row: list[tuple[int, int]] = []
    for vehicle in vehicles:
        row = [*row, vehicle] if row and (vehicle[0] - row[-1][0]) * STEP_M <= GAP_M else [vehicle]
        best = max(best, row, key=len)
    if len(best) < QUEUE_OF:
        return None
    ahead = _unit(*leg)
    reach = (best[0][0] * STEP_M, best[-1][1] * STEP_M)
    ends = [(leg[0][0] + at * ahead[0], leg[0][1] + at * ahead[1]) for at in reach]
    pixels = [world_to_pixel(pose, (*end, level_m)) for end in ends]
    us = [pixel[0] / pose.width for pixel in pixels if pixel is not None]
    vs = [pixel[1] / pose.height for pixel in pixels if pixel is not None]
    box = (max(0.0, min(us) - 0.01), max(0.0, min(vs) - 0.015), min(1.0, max(us) + 0.01), min(1.0, max(vs) + 0.015))
    middle = (ends[0][0] + ends[1][0]) / 2, (ends[0][1] + ends[1][1]) / 2
    return VehicleQueue(box, min(1.0, 0.3 + 0.1 * len(best)), middle, len(best))


def strip_along(
    rgb: ByteImage, pose: CameraPose, level_m: float, leg: tuple[GroundPoint, GroundPoint]
) -> ByteImage | None:
    """Return the lane's pixels, (across, along, 3) at `STEP_M`, black outside the picture; None if it is not
    visible.
    """
    cv2 = opencv()
    length = math.dist(*leg)
    ahead = _unit(*leg)
    aside = ahead[1], -ahead[0]
    origin = world_to_pixel(pose, (*leg[0], level_m))
    far = world_to_pixel(pose, (leg[0][0] + ahead[0], leg[0][1] + ahead[1], level_m))
    side = world_to_pixel(pose, (leg[0][0] + aside[0], leg[0][1] + aside[1], level_m))
    if origin is None or far is None or side is None or length < 2 * VEHICLE_M[0]:
        return None
    along = np.arange(0.0, length, STEP_M, dtype=np.float32)
    across = np.arange(-HALF_LANE_M, HALF_LANE_M + 1e-6, STEP_M, dtype=np.float32)
    s, a = np.meshgrid(along, across)
    us = origin[0] + s * (far[0] - origin[0]) + a * (side[0] - origin[0])
    vs = origin[1] + s * (far[1] - origin[1]) + a * (side[1] - origin[1])
    if not ((us >= 0) & (us < pose.width) & (vs >= 0) & (vs < pose.height)).any():
        return None
    columns, rows = us.astype(np.float32) - 0.5, vs.astype(np.float32) - 0.5
    strip: ByteImage = cv2.remap(rgb, columns, rows, cv2.INTER_LINEAR)
    return strip


def occupied(strip: ByteImage) -> MaskArray:
    """Return the mask of stations with an object on the asphalt that is no leaf."""
    cv2 = opencv()
    hsv = cv2.cvtColor(strip, cv2.COLOR_RGB2HSV)
    leaves = (hsv[..., 0] > 35) & (hsv[..., 0] < 85) & (hsv[..., 1] > 80)
    # The median across a lane removes painted lines, which are narrow; a vehicle's roof, glass and bonnet remain.
    colour = np.median(strip.astype(np.float32), axis=0)
    wide = max(1, round(WINDOW_M / STEP_M))
    kernel = np.ones(wide, np.float32) / wide
    mean = np.stack([np.convolve(colour[:, each], kernel, "same") for each in range(3)], axis=1)
    square = np.stack([np.convolve(colour[:, each] ** 2, kernel, "same") for each in range(3)], axis=1)
    spread = np.sqrt(np.maximum(square - mean * mean, 0.0)).max(axis=1)
    occupied: MaskArray = (spread > CONTRAST) & (leaves.mean(axis=0) < 0.25)
    return occupied


def moved_leg(start: GroundPoint, end: GroundPoint, offset_m: float) -> tuple[GroundPoint, GroundPoint]:
    """Return a leg moved to the right of its direction."""
    ahead = _unit(start, end)
    east, north = ahead[1] * offset_m, -ahead[0] * offset_m
    return (start[0] + east, start[1] + north), (end[0] + east, end[1] + north)


def _unit(start: GroundPoint, end: GroundPoint) -> tuple[float, float]:
    run = math.dist(start, end)
    return ((end[0] - start[0]) / run, (end[1] - start[1]) / run) if run else (1.0, 0.0)
