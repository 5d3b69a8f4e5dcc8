"""People in a line, from above: coloured or bright spots at regular distances.

The start of the line is known, so the detector searches for a ray: the bearing with the most spots that follow each
other without a gap. Some clothes are as dark as shadows. The count therefore follows from the distance of the first and
the last spot and the usual distance between two people.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from lingjing.plugins.geometry import world_to_pixel
from lingjing.plugins.policy import CameraPose
from lingjing_agents.ground_plane import GroundPoint
from lingjing_agents.perception.images import ByteImage, ImageBox, opencv

REACH_M = 22.0
"""Longest line in metres. Chosen."""
AROUND_M = 1.9
"""Side in metres of the square with the median colour of the ground around a spot."""
COLOURED, BRIGHT = 9.0, 26.0
"""Least difference of a spot from the ground in chroma or in lightness (of 255); shadows differ in neither."""
SPOT_M2 = (0.02, 0.6)
"""Smallest and largest area of a spot in square metres. Chosen."""
BEGINS_M, ASIDE_M = 2.2, 0.45
"""Largest distance in metres from the start of the line to its first spot, and of a spot from the ray."""
HEAD_M = 0.45
"""Distance in metres from the start of the line within which spots belong to its marker."""
STEP_M, OFF, MOST_STEPS = 0.82, 0.25, 5
"""Distance in metres between two people, tolerated deviation as a share of it, and most steps between two visible
spots.
"""
BEARINGS = 240
"""Number of bearings that are compared. Chosen."""
HALF_WIDTH_M = 0.55
"""Half the width of the line's box in metres."""


@dataclass(frozen=True, slots=True)
class PeopleLine:
    """A line of people."""

    box: ImageBox
    """Normalised x0, y0, x1, y1."""
    people: int
    """The number of people."""
    confidence: float
    """Confidence of the detection, 0 to 1."""


def find_line(rgb: ByteImage, pose: CameraPose, head: GroundPoint, level_m: float) -> PeopleLine | None:
    """Return the line that starts at `head` (east, north; m) on ground at elevation `level_m`, in a nadir picture, or
    None.
    """
    middle = world_to_pixel(pose, (*head, level_m))
    beside = world_to_pixel(pose, (head[0] + 1.0, head[1], level_m))
    ahead = world_to_pixel(pose, (head[0], head[1] + 1.0, level_m))
    if middle is None or beside is None or ahead is None or not rgb.any():
        return None
    east = beside[0] - middle[0], beside[1] - middle[1]
    north = ahead[0] - middle[0], ahead[1] - middle[1]
    scale = math.hypot(*east)
    spots = [
        (dx * east[0] + dy * east[1], dx * north[0] + dy * north[1])
        for u, v in _spots(rgb, middle[:2], scale)
        for dx, dy in [((u - middle[0]) / scale**2, (v - middle[1]) / scale**2)]
    ]
    best = max((_row(spots, 2.0 * math.pi * k / BEARINGS) for k in range(BEARINGS)), key=_worth)
    if not best[1]:
        return None
    bearing, row = best
    people = _count(row)
    ends = [head, (head[0] + row[-1] * math.sin(bearing), head[1] + row[-1] * math.cos(bearing))]
    box = _box(pose, ends, bearing, level_m)
    return PeopleLine(box, people, min(1.0, 0.4 + 0.6 * len(row) / people))


def _spots(rgb: ByteImage, middle: tuple[float, float], scale: float) -> list[tuple[float, float]]:
    """Return centres (u, v) of spots that differ from the ground within reach of a pixel; `scale` is pixels per
    metre.
    """
    cv2 = opencv()
    reach = int(REACH_M * scale)
    left, top = max(0, int(middle[0]) - reach), max(0, int(middle[1]) - reach)
    cut = rgb[top : int(middle[1]) + reach, left : int(middle[0]) + reach]
    if cut.shape[0] < 8 or cut.shape[1] < 8:
        return []
    lab = cv2.cvtColor(cut, cv2.COLOR_RGB2LAB)
    size = min(2 * int(AROUND_M * scale / 2) + 1, 255)
    off = lab.astype(np.float32) - cv2.medianBlur(lab, size).astype(np.float32)
    stands = (np.hypot(off[..., 1], off[..., 2]) > COLOURED) | (off[..., 0] > BRIGHT)
    joined = cv2.morphologyEx(stands.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
    count, _, stats, centres = cv2.connectedComponentsWithStats(joined, connectivity=8)
    low, high = SPOT_M2[0] * scale**2, SPOT_M2[1] * scale**2
    return [
        (float(centres[label][0]) + left, float(centres[label][1]) + top)
        for label in range(1, count)
        if low <= stats[label, cv2.CC_STAT_AREA] <= high
    ]


def _row(spots: list[GroundPoint], bearing: float) -> tuple[float, list[float]]:
    """Return the distances of the spots that follow each other along a bearing (radians).

    After a gap there must be as many spots as are missing in it: a single one is a lamp or a tree.
    """
    ahead = math.sin(bearing), math.cos(bearing)
    along = sorted(x * ahead[0] + y * ahead[1] for x, y in spots if abs(x * ahead[1] - y * ahead[0]) <= ASIDE_M)
    runs: list[list[float]] = []
    for distance in along:
        if not runs:
            if HEAD_M <= distance <= BEGINS_M:
                runs.append([distance])
            continue
        steps = (distance - runs[-1][-1]) / STEP_M
        if steps > MOST_STEPS + OFF:
            break
        if round(steps) >= 1 and abs(steps - round(steps)) <= OFF:
            if round(steps) == 1:
                runs[-1].append(distance)
            else:
                runs.append([distance])
    while len(runs) > 1 and len(runs[-1]) < round((runs[-1][0] - runs[-2][-1]) / STEP_M) - 1:
        runs.pop()
    return bearing, [distance for run in runs for distance in run]


def _worth(candidate: tuple[float, list[float]]) -> tuple[int, float]:
    """Return the sort key of a row: longer rows first, of equal ones the shorter distance."""
    return len(candidate[1]), -candidate[1][-1] if candidate[1] else 0.0


def _count(row: list[float]) -> int:
    """Return the number of people from the first to the last spot, visible or not."""
    return 1 + sum(round((b - a) / STEP_M) for a, b in pairwise(row))


def _box(pose: CameraPose, ends: list[GroundPoint], bearing: float, level_m: float) -> ImageBox:
    """Return the box around a line of people and the barrier at its head."""
    aside = math.cos(bearing) * HALF_WIDTH_M, -math.sin(bearing) * HALF_WIDTH_M
    beyond = math.sin(bearing) * 0.3, math.cos(bearing) * 0.3
    head, last = ends
    corners = [
        world_to_pixel(pose, (x + side * aside[0], y + side * aside[1], level_m))
        for x, y in (head, (last[0] + beyond[0], last[1] + beyond[1]))
        for side in (-1.0, 1.0)
    ]
    us = [min(1.0, max(0.0, corner[0] / pose.width)) for corner in corners if corner is not None]
    vs = [min(1.0, max(0.0, corner[1] / pose.height)) for corner in corners if corner is not None]
    return min(us), min(vs), max(us), max(vs)
