"""Culling: tiles in sight by level of detail, and the window of the shadow map.

All functions depend only on the pose and the tiles' boxes, so a picture does not depend on earlier ones. Tiles are
drawn in full while a metre is at least `METRE_PX` pixels. Beyond that, blocks and the painted map replace them. The
shadow map covers everything in sight within `SHADE_REACH_M`. Its size and place change in steps, so that neighbouring
poses share one map.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import hypot

import numpy as np
import numpy.typing as npt

from lingjing.engines.camera.far_country import HIGH_M
from lingjing.engines.camera.meshes import vector_of
from lingjing.scene.camera_geometry import camera_axes, focal_px
from lingjing.trace.records import CameraPose

Boxes = npt.NDArray[np.float64]
"""Boxes (n, 6): west, south, low, east, north, high; metres."""

FULL_M = (400.0, 900.0)
"""Least and largest distance up to which tiles are drawn in full, metres (chosen)."""
METRE_PX = 2.0
"""Pixels per metre down to which tiles are drawn in full (chosen)."""
SHARP_M, SHARP_FAR_M = 400.0, 1100.0
"""Distances from which tiles show no grain, and far blocks no windows, metres (chosen).

They apply only to pictures that show full tiles beyond the least distance.
"""
GROUND_REACH_M = 20_000.0
"""Distance to which ground or water reaches at least, metres."""

SHADE_REACH_M = 480.0
"""Greatest distance to which the shadow map reaches, metres (chosen)."""
NEAR_SHADE_M, SHADE_RISE = 130.0, 8.0
"""Distance to which it reaches for an eye on the ground (m), and the metres that each metre of height adds (chosen).

A smaller map has finer texels. From the ground, shadows farther away are a few pixels high.
"""

SHADE_SIZES_M = (96.0, 128.0, 192.0, 256.0, 384.0, 512.0, 768.0, 1024.0, 1536.0, 2048.0)
"""Possible sides of the shadow map's window, metres (chosen)."""


@dataclass(frozen=True, slots=True)
class ShadowWindow:
    """A square in the sun's view."""

    right: tuple[float, float, float]
    """Unit vector of its horizontal axis."""
    up: tuple[float, float, float]
    """Unit vector of its vertical axis."""
    sun: tuple[float, float, float]
    """Unit vector towards the sun."""
    corner: tuple[float, float]
    """Lower corner along the two axes, metres."""
    side_m: float
    """Side, metres."""


def full_reach(pose: CameraPose, visibility_m: float) -> float:
    """Return the distance to which tiles are drawn in full, metres."""
    return min(max(focal_px(pose) / METRE_PX, FULL_M[0]), FULL_M[1], 1.3 * visibility_m)


def blunt_from(reach_m: float) -> tuple[float, float]:
    """Return the distances (m) from which full tiles show no grain, and far blocks no windows.

    They are infinite for a picture with a reach up to the least distance.
    """
    return (SHARP_M, SHARP_FAR_M) if reach_m > SHARP_M else (np.inf, np.inf)


def distances(boxes: Boxes, eye: tuple[float, float, float]) -> npt.NDArray[np.float64]:
    """Return the distance of each box from a point, metres; 0 inside."""
    at = np.asarray(eye)
    off = np.maximum(np.maximum(boxes[:, :3] - at, at - boxes[:, 3:]), 0.0)
    return np.asarray(np.linalg.norm(off, axis=1))


def boxes_in_sight(boxes: Boxes, pose: CameraPose) -> npt.NDArray[np.bool_]:
    """Return which boxes touch the camera's frustum, without its far end; a few others may be included."""
    right, down, axis = (np.asarray(a) for a in camera_axes(pose))
    focal = focal_px(pose)
    x, y = pose.width / 2.0 / focal, pose.height / 2.0 / focal
    planes = np.stack([axis * x - right, axis * x + right, axis * y - down, axis * y + down, axis])
    eye = np.asarray(pose.position)
    middle, half = (boxes[:, 3:] + boxes[:, :3]) / 2.0 - eye, (boxes[:, 3:] - boxes[:, :3]) / 2.0
    return np.asarray((middle @ planes.T + half @ np.abs(planes).T >= 0.0).all(axis=1))


def near_plane(pose: CameraPose, closest_m: float) -> float:
    """Return the least depth that a thing `closest_m` away or farther can have in the picture, with a margin."""
    focal = focal_px(pose)
    slant = hypot(1.0, pose.width / 2.0 / focal, pose.height / 2.0 / focal)
    return max(0.8 * closest_m / slant, 0.06)


def sky_bounds(pose: CameraPose, level_m: float) -> tuple[int, int, int, int] | None:
    """Return the part of a picture (left, top, width, height; pixels) that can show the sky; None if no part can.

    Ground or water reach at least `GROUND_REACH_M`, and beyond the sight of an eye high above.
    """
    right, down, axis = camera_axes(pose)
    width, height, focal = pose.width, pose.height, focal_px(pose)
    over = pose.position[2] - level_m
    if over > HIGH_M or over <= 0.0:
        return 0, 0, width, height
    least = -(over + 50.0) / GROUND_REACH_M

    def rise(x: float, y: float) -> float:
        """Return the height of a pixel's ray above the limit."""
        return axis[2] + ((x - width / 2.0) * right[2] + (y - height / 2.0) * down[2]) / focal - least

    ring = [(0.0, 0.0), (float(width), 0.0), (float(width), float(height)), (0.0, float(height))]
    shown = [corner for corner in ring if rise(*corner) >= 0.0]
    for first, second in zip(ring, ring[1:] + ring[:1], strict=True):
        a, b = rise(*first), rise(*second)
        if (a < 0.0) != (b < 0.0):
            part = a / (a - b)
            shown.append((first[0] + part * (second[0] - first[0]), first[1] + part * (second[1] - first[1])))
    if not shown:
        return None
    left, top = (max(int(min(p[k] for p in shown)) - 1, 0) for k in (0, 1))
    end, low = (min(int(max(p[k] for p in shown)) + 2, size) for k, size in ((0, width), (1, height)))
    return left, top, end - left, low - top


def shade_window(pose: CameraPose, sun: tuple[float, float, float]) -> ShadowWindow:
    """Return the window that holds what the picture shows of the ground and of 40 m above it."""
    z = np.asarray(sun)
    flat = hypot(sun[0], sun[1])
    right = np.array([-sun[1], sun[0], 0.0]) / flat if flat > 1e-6 else np.array([1.0, 0.0, 0.0])
    up = np.cross(z, right)
    points = _shown(pose)
    spread = np.column_stack([points @ right, points @ up])
    low, high = spread.min(axis=0), spread.max(axis=0)
    need = float((high - low).max()) * 8.0 / 7.0
    side = next((s for s in SHADE_SIZES_M if s >= need), SHADE_SIZES_M[-1])
    step = side / 8.0
    corner = np.floor(((low + high - side) / 2.0) / step + 0.5) * step
    return ShadowWindow(vector_of(right), vector_of(up), sun, (float(corner[0]), float(corner[1])), side)


def _shown(pose: CameraPose) -> npt.NDArray[np.float64]:
    """Return points on the ground and 40 m above it around everything in sight, up to `SHADE_REACH_M`."""
    right, down, axis = (np.asarray(a) for a in camera_axes(pose))
    focal, eye = focal_px(pose), np.asarray(pose.position)
    low = min(NEAR_SHADE_M + SHADE_RISE * max(float(eye[2]), 0.0), SHADE_REACH_M)
    reach = max(SHADE_REACH_M, 1.6 * eye[2]) if pose.tilt_deg > 30.0 else low
    points = []
    for u in (-1.0, 0.0, 1.0):
        for v in (-1.0, 0.0, 1.0):
            ray = axis + right * (u * pose.width / 2.0 / focal) + down * (v * pose.height / 2.0 / focal)
            ray = ray / np.linalg.norm(ray)
            for level in (0.0, min(40.0, max(eye[2] - 3.0, 0.0))):
                t = (level - eye[2]) / ray[2] if ray[2] < -1e-3 else reach
                points.append(eye + ray * min(max(t, 0.0), reach))
    return np.array(points)


def casters(boxes: Boxes, window: ShadowWindow) -> npt.NDArray[np.bool_]:
    """Return which boxes may cast a shadow into the window: those inside it along the sun's rays."""
    keep = np.ones(len(boxes), bool)
    for axis, start in ((window.right, window.corner[0]), (window.up, window.corner[1])):
        a = np.asarray(axis)
        low = np.where(a > 0.0, boxes[:, :3], boxes[:, 3:]) @ a
        high = np.where(a > 0.0, boxes[:, 3:], boxes[:, :3]) @ a
        keep &= (high >= start) & (low <= start + window.side_m)
    return keep


def light_matrix(window: ShadowWindow, boxes: Boxes) -> npt.NDArray[np.float64]:
    """Return the (4, 4) matrix from world to clip space of the shadow map, deep enough for all boxes."""
    z = np.asarray(window.sun)
    corner = np.asarray(window.corner) + window.side_m / 2.0
    far = np.where(z > 0.0, boxes[:, :3], boxes[:, 3:]) @ z
    near = np.where(z > 0.0, boxes[:, 3:], boxes[:, :3]) @ z
    low, high = float(far.min(initial=0.0)) - 5.0, float(near.max(initial=1.0)) + 5.0
    matrix = np.zeros((4, 4))
    matrix[0, :3], matrix[0, 3] = np.asarray(window.right) * 2.0 / window.side_m, -corner[0] * 2.0 / window.side_m
    matrix[1, :3], matrix[1, 3] = np.asarray(window.up) * 2.0 / window.side_m, -corner[1] * 2.0 / window.side_m
    matrix[2, :3], matrix[2, 3] = -z * 2.0 / (high - low), (high + low) / (high - low)
    matrix[3, 3] = 1.0
    return matrix


__all__ = ["ShadowWindow", "blunt_from", "boxes_in_sight", "casters", "distances", "full_reach", "light_matrix",
           "near_plane", "shade_window", "sky_bounds"]  # fmt: skip
