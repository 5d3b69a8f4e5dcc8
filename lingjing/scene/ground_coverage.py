"""The ground that pictures show: the footprint of a camera on a level plane, exactly, and shares of cells.

A footprint follows from height, tilt, roll and field of view. It is cut where the view becomes too flat to search: at
`LEAST_DEPRESSION_DEG` below the horizon. What stands on the ground hides nothing here, so in a street it is an upper
bound. All areas are planar, in square metres.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

from shapely import from_wkb, to_wkb
from shapely.geometry import Point, Polygon
from shapely.geometry.base import BaseGeometry
from shapely.ops import unary_union

from lingjing.mission.geometry2d import Vector2
from lingjing.scene.camera_geometry import pixel_ray
from lingjing.trace.records import CameraPose

LEAST_DEPRESSION_DEG = 20.0
"""Least angle of a ray below the horizon at which ground counts as seen, degrees. Chosen: what lies there has a
third of the height in the picture that it has from above."""

_ARC = 64
"""Segments of a quarter of the circle at which flat views are cut: its area is 0.01 % too small."""

_HORIZON = 1e-3
"""Fall of a ray per metre along the optical axis below which it counts as level."""


def seen_ground(pose: CameraPose, level_m: float) -> BaseGeometry:
    """Return the part of the plane at elevation `level_m` that a picture shows; empty below the plane."""
    height = pose.position[2] - level_m
    if height <= 0.0:
        return Polygon()
    corners = [(0.0, 0.0), (pose.width, 0.0), (pose.width, pose.height), (0.0, pose.height)]
    rays = [pixel_ray(pose, float(u), float(v)) for u, v in corners]
    below = _below_horizon(rays)
    if len(below) < 3:
        return Polygon()
    east, north = pose.position[:2]
    ground = Polygon([(east + ray[0] * height / -ray[2], north + ray[1] * height / -ray[2]) for ray in below])
    reach = height / math.tan(math.radians(LEAST_DEPRESSION_DEG))
    return ground.intersection(Point(east, north).buffer(reach, quad_segs=_ARC))


def _below_horizon(rays: Sequence[tuple[float, ...]]) -> list[tuple[float, ...]]:
    """Return the corners of the part of the picture below the horizon. Rays are linear in the pixels."""
    kept: list[tuple[float, ...]] = []
    for ray, after in zip(rays, (*rays[1:], rays[0]), strict=True):
        if ray[2] <= -_HORIZON:
            kept.append(ray)
        if (ray[2] <= -_HORIZON) != (after[2] <= -_HORIZON):
            share = (-_HORIZON - ray[2]) / (after[2] - ray[2])
            kept.append(tuple(a + share * (b - a) for a, b in zip(ray, after, strict=True)))
    return kept


def add_ground(
    cells: Mapping[str, Sequence[Vector2]], ground: Mapping[str, bytes], poses: Iterable[CameraPose], level_m: float
) -> tuple[dict[str, bytes], dict[str, float]]:
    """Return the ground of cells that earlier and new pictures showed, as well-known binary, and its shares."""
    shown = unary_union([seen_ground(pose, level_m) for pose in poses])
    added, shares = dict(ground), dict[str, float]()
    for name, corners in cells.items():
        cell = Polygon(corners)
        before = from_wkb(added[name]) if name in added else Polygon()
        if shown.intersects(cell):
            before = before.union(shown.intersection(cell))
            added[name] = to_wkb(before)
        shares[name] = min(1.0, float(before.area / cell.area)) if cell.area > 0.0 else 1.0
    return added, shares


def seen_share(cells: Iterable[Sequence[Vector2]], poses: Iterable[CameraPose], level_m: float) -> float | None:
    """Return the share of the ground of all cells that pictures showed, or None without cells."""
    whole = unary_union([Polygon(cell) for cell in cells])
    if whole.is_empty:
        return None
    shown = unary_union([seen_ground(pose, level_m) for pose in poses])
    return float(shown.intersection(whole).area / whole.area)


__all__ = ["LEAST_DEPRESSION_DEG", "add_ground", "seen_ground", "seen_share"]
