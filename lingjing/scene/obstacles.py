"""Clearance map for legged robots: the distance to the nearest obstacle on a grid of square cells.

It is made from the shapes that the quadruped engine collides with, so a free cell is free in that engine too. It is for
policies that may see the city. Moving bodies are not in it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lingjing.mission.geometry2d import Extent, Vector2, convex_hull
from lingjing.scene.city import City
from lingjing.scene.shapes import Capsule, OrientedBox, Shape, shapes_of
from lingjing.scene.terrain import Terrain
from lingjing.scene.tiles import Tiles

STEP_M = 0.2
"""Greatest height over the ground that a robot steps on, metres (chosen)."""

HEAD_M = 0.8
"""Height over the ground from which a robot walks underneath, metres (chosen)."""


@dataclass(frozen=True, slots=True)
class ObstacleMap:
    """Distance to the nearest obstacle for each cell of a rectangle."""

    west: float
    """West edge, metres."""
    south: float
    """South edge, metres."""
    cell_m: float
    """Side of a cell, metres."""
    far_m: float
    """Largest distance that is stored, metres."""
    clearance_m: npt.NDArray[np.float32]
    """(rows, columns): distance from a cell's centre to the nearest obstacle, metres, 0 inside one. Row 0 is the
    southernmost, column 0 the westernmost."""

    def cell(self, x: float, y: float) -> tuple[int, int]:
        """Row and column of a point. They may be outside the map."""
        return math.floor((y - self.south) / self.cell_m), math.floor((x - self.west) / self.cell_m)

    def middle(self, row: int, column: int) -> Vector2:
        """Centre of a cell, metres."""
        return self.west + (column + 0.5) * self.cell_m, self.south + (row + 0.5) * self.cell_m


def obstacle_map(city: City, bounds: Extent, *, cell_m: float = 0.5, far_m: float = 1.6) -> ObstacleMap:
    """Return the map of a rectangle (west, south, east, north; metres)."""
    west, south, east, north = bounds
    columns, rows = max(1, math.ceil((east - west) / cell_m)), max(1, math.ceil((north - south) / cell_m))
    clearance = np.full((rows, columns), far_m, np.float32)
    drawing = ObstacleMap(west, south, cell_m, far_m, clearance)
    terrain = Terrain(city)
    middle = (west + east) / 2.0, (south + north) / 2.0
    for tile in Tiles(city).near(*middle, math.dist((west, south), (east, north)) / 2.0):
        for shape in shapes_of(tile):
            _draw(drawing, shape, terrain)
    if city.waters:
        _draw_water(drawing, terrain)
    return drawing


def _draw(drawing: ObstacleMap, shape: Shape, terrain: Terrain) -> None:
    outline, radius, low, high = _footprint(shape)
    x, y = (sum(point[axis] for point in outline) / len(outline) for axis in (0, 1))
    ground = terrain.surface(x, y)
    if high <= ground + STEP_M or low >= ground + HEAD_M:
        return
    reach = radius + drawing.far_m
    first = drawing.cell(min(px for px, _ in outline) - reach, min(py for _, py in outline) - reach)
    last = drawing.cell(max(px for px, _ in outline) + reach, max(py for _, py in outline) + reach)
    height, width = drawing.clearance_m.shape
    rows = np.arange(max(first[0], 0), min(last[0] + 1, height))
    columns = np.arange(max(first[1], 0), min(last[1] + 1, width))
    if rows.size == 0 or columns.size == 0:
        return
    ys = drawing.south + (rows + 0.5) * drawing.cell_m
    xs = drawing.west + (columns + 0.5) * drawing.cell_m
    away = np.maximum(_distance(outline, *np.meshgrid(xs, ys)) - radius, 0.0).astype(np.float32)
    part = drawing.clearance_m[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    np.minimum(part, away, out=part)


def _footprint(shape: Shape) -> tuple[Sequence[Vector2], float, float, float]:
    """A convex outline (anticlockwise) or a segment, the radius around it, and the lowest and highest elevation."""
    if isinstance(shape, OrientedBox):
        (x, y, z), (length, width, height) = shape.centre, shape.half
        cosine, sine = math.cos(shape.yaw), math.sin(shape.yaw)
        corners = [(-length, -width), (length, -width), (length, width), (-length, width)]
        return [(x + a * cosine - b * sine, y + a * sine + b * cosine) for a, b in corners], 0.0, z - height, z + height
    if isinstance(shape, Capsule):
        low, high = sorted((shape.start[2], shape.end[2]))
        return [shape.start[:2], shape.end[:2]], shape.radius_m, low - shape.radius_m, high + shape.radius_m
    levels = [corner[2] for corner in shape.corners]
    return convex_hull([corner[:2] for corner in shape.corners]), 0.0, min(levels), max(levels)


def _distance(
    outline: Sequence[Vector2], xs: npt.NDArray[np.float64], ys: npt.NDArray[np.float64]
) -> npt.NDArray[np.float64]:
    """Distance of points to a convex outline, 0 inside it."""
    nearest = np.full(xs.shape, np.inf)
    inside = np.full(xs.shape, len(outline) > 2)
    for (ax, ay), (bx, by) in zip(outline, (*outline[1:], outline[0]), strict=True):
        east, north = bx - ax, by - ay
        length = max(east * east + north * north, 1e-12)
        share = np.clip(((xs - ax) * east + (ys - ay) * north) / length, 0.0, 1.0)
        np.minimum(nearest, np.hypot(xs - ax - share * east, ys - ay - share * north), out=nearest)
        inside &= east * (ys - ay) - north * (xs - ax) >= 0.0
    return np.where(inside, 0.0, nearest)


def _draw_water(drawing: ObstacleMap, terrain: Terrain) -> None:
    rows, columns = drawing.clearance_m.shape
    for row in range(rows):
        for column in range(columns):
            if terrain.water_level(*drawing.middle(row, column)) is not None:
                drawing.clearance_m[row, column] = 0.0


__all__ = ["ObstacleMap", "obstacle_map"]
