"""Obstacles on the ground in depth pictures from above, as closed cells of a walker's map."""

from __future__ import annotations

import numpy as np

from lingjing.plugins.geometry import camera_axes, focal_px
from lingjing.plugins.policy import CameraPose
from lingjing_agents.ground_plane import GroundPoint
from lingjing_agents.paths.obstacle_grid import CELL_M, ObstacleGrid
from lingjing_agents.perception.images import FloatArray, GreyPlane

HIGH_M = 0.35
"""Height in metres from which on a point is an obstacle: a dog steps over lower ones."""
STRIDE_PX = 6
"""Sampling interval of pixels. Chosen."""
OWN_M = 1.2
"""Radius in metres around the guided body within which points belong to it."""

SHARE = 0.12
"""Least share of high samples for a closed cell. Chosen."""


def heights(depth: GreyPlane, pose: CameraPose, ground_m: float, stride: int = STRIDE_PX) -> FloatArray:
    """Return east, north and height above the ground (n, 3; metres) of every `stride`-th pixel of a depth picture."""
    rows = np.arange(stride // 2, depth.shape[0], stride)
    columns = np.arange(stride // 2, depth.shape[1], stride)
    right, down, forward = (np.array(axis) for axis in camera_axes(pose))
    focal = focal_px(pose) * depth.shape[1] / pose.width
    u, v = np.meshgrid((columns + 0.5 - depth.shape[1] / 2) / focal, (rows + 0.5 - depth.shape[0] / 2) / focal)
    rays = forward + u[..., None] * right + v[..., None] * down
    reach = depth[rows][:, columns].astype(np.float64)[..., None]
    points: FloatArray = (np.array(pose.position) + rays * reach).reshape(-1, 3)
    finite: FloatArray = points[np.isfinite(points).all(axis=1)]
    finite[:, 2] -= ground_m
    return finite


def close_what_stands(known: ObstacleGrid, points: FloatArray, follower: GroundPoint | None = None) -> None:
    """Close the cells with enough high points (n, 3), except those of the guided body."""
    if follower is not None:
        away = np.hypot(points[:, 0] - follower[0], points[:, 1] - follower[1])
        points = points[away > OWN_M]
    cells = np.floor(points[:, :2] / CELL_M).astype(np.int64)
    keys, where, counts = np.unique(cells, axis=0, return_inverse=True, return_counts=True)
    tall = np.bincount(where.reshape(-1), weights=(points[:, 2] > HIGH_M), minlength=len(keys))
    for (i, j), count, high in zip(keys.tolist(), counts.tolist(), tall.tolist(), strict=True):
        if high >= max(1.0, SHARE * count):
            known.close(((i + 0.5) * CELL_M, (j + 0.5) * CELL_M))
