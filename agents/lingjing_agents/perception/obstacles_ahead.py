"""Obstacles close ahead in a front picture: walls, tanks or cars that fill a column where ground should be visible.

A dog's camera is so low that the ground beyond a few metres is a narrow strip below the horizon. If a column does not
change from above the horizon down to the row of a near distance, no ground is visible beyond it, so an obstacle stands
there.
"""

from __future__ import annotations

import math

import numpy as np

from lingjing.plugins.geometry import focal_px, pixel_ray
from lingjing.plugins.policy import CameraPose
from lingjing_agents.ground_plane import GroundPoint
from lingjing_agents.perception.images import ByteImage

NEAREST_M, FARTHEST_M = 1.5, 22.0
"""Nearest and farthest distance in metres at which obstacles are detected. Chosen."""
ABOVE_DEG = 1.0
"""Elevation in degrees above the horizon at which the search starts."""
COLUMNS = 24
"""Number of columns that are searched. Chosen."""
JUMP = 9.0
"""Mean change of colour (grey levels) between rows that counts as an edge."""

EYE_M = 0.36
"""Height of the camera above the ground in metres."""


def near_walls(rgb: ByteImage, pose: CameraPose, eye_m: float = EYE_M) -> tuple[GroundPoint, ...]:
    """Return places (east, north) of obstacles nearer than `FARTHEST_M`; those nearer than `NEAREST_M` are placed
    there.

    Two neighbouring columns must agree, since a single one may show a pole or be an error.
    """
    height, width = rgb.shape[:2]
    focal = focal_px(pose)
    obstacles: list[tuple[float, float, float] | None] = []  # east, north, distance (m)
    for index in range(COLUMNS):
        u = (index + 0.5) * width / COLUMNS
        horizon = _horizon_row(pose, u)
        low = horizon + focal * eye_m / NEAREST_M
        top, bottom = int(horizon - focal * math.tan(math.radians(ABOVE_DEG))), int(low)
        obstacles.append(None)
        if top < 4 or bottom > height - 4:
            continue
        half = width // (3 * COLUMNS)
        strip = rgb[top - 4 : bottom + 4, int(u) - half : int(u) + half].astype(np.float32).mean(axis=1)
        change = np.abs(strip[6:] - strip[:-6]).max(axis=1)
        jumps = np.flatnonzero(change > JUMP)
        row = low
        if len(jumps):
            first = int(jumps[0])
            while first + 1 < len(change) and change[first + 1] > change[first]:
                first += 1
            row = first + top - 1.0
        if row < horizon + focal * eye_m / FARTHEST_M:
            continue
        ray = pixel_ray(pose, u, row)
        scale = eye_m / max(-ray[2], 1e-3)
        obstacles[-1] = pose.position[0] + scale * ray[0], pose.position[1] + scale * ray[1], scale
    return tuple((a[0], a[1]) for index, a in enumerate(obstacles) if a is not None and _agrees(a[2], obstacles, index))


def _agrees(distance: float, obstacles: list[tuple[float, float, float] | None], index: int) -> bool:
    near = [other for other in obstacles[max(0, index - 1) : index + 2] if other is not None]
    return sum(abs(other[2] - distance) < 0.3 * distance for other in near) >= 2


def _horizon_row(pose: CameraPose, u: float) -> float:
    """Return the row at which a column's ray is horizontal."""
    low, high = 0.0, float(pose.height)
    for _ in range(24):
        middle = (low + high) / 2.0
        if pixel_ray(pose, u, middle)[2] > 0.0:
            low = middle
        else:
            high = middle
    return (low + high) / 2.0
