"""Plane geometry of engines: bearings, and whether a point lies in a polygon or near its outline.

Points are (east, north) metres, bearings compass degrees in [0, 360). Polygons are without the closing repeat.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from lingjing.mission.geometry2d import Polygon, Vector2, bounds, edge_distance

_ROUNDING = 1e-9


def compass(angle_deg: float) -> float:
    """An angle as a bearing in [0, 360); taken twice, because a tiny negative angle rounds up to 360 the first time."""
    return angle_deg % 360.0 % 360.0


def wrapped(angle_rad: float) -> float:
    """An angle in [-pi, pi), radians."""
    return (angle_rad + math.pi) % (2.0 * math.pi) - math.pi


def inside(polygon: Sequence[Vector2], x: float, y: float) -> bool:
    """Whether a point lies in a polygon (even-odd rule; points on the edge may fall on either side)."""
    found = False
    before_x, before_y = polygon[-1]
    for here_x, here_y in polygon:
        if (here_y > y) != (before_y > y) and x < (before_x - here_x) * (y - here_y) / (before_y - here_y) + here_x:
            found = not found
        before_x, before_y = here_x, here_y
    return found


def within(polygon: Sequence[Vector2], x: float, y: float, margin_m: float = 0.0) -> bool:
    """Whether a point lies in the polygon or within `margin_m` of it; below 0, so far from the edge inside of it."""
    if margin_m < 0.0:
        return inside(polygon, x, y) and edge_distance(polygon, x, y) >= -margin_m
    return inside(polygon, x, y) or edge_distance(polygon, x, y) <= margin_m


def touches(polygon: Sequence[Vector2], x: float, y: float, half_m: float) -> bool:
    """Whether the outline may touch the square of side `2 * half_m` about a point: False is certain, True is not, for
    the outline could pass a corner closely."""
    west, east, south, north = x - half_m, x + half_m, y - half_m, y + half_m
    before_x, before_y = polygon[-1]
    for here_x, here_y in polygon:
        ax, ay, bx, by = before_x, before_y, here_x, here_y
        before_x, before_y = here_x, here_y
        if max(ax, bx) < west or min(ax, bx) > east or max(ay, by) < south or min(ay, by) > north:
            continue
        dx, dy = bx - ax, by - ay
        off, reach = dx * (y - ay) - dy * (x - ax), half_m * (abs(dx) + abs(dy))
        if abs(off) <= reach * (1.0 + _ROUNDING):  # else all four corners lie on one side of the edge
            return True
    return False


@dataclass(frozen=True, slots=True)
class BoundedPolygon:
    """A polygon with its bounding box, so that most points are ruled out by four comparisons."""

    polygon: Polygon
    west: float
    south: float
    east: float
    north: float

    @classmethod
    def of(cls, polygon: Polygon) -> BoundedPolygon:
        """The area of a polygon."""
        return cls(polygon, *bounds(polygon))

    def bounds_hold(self, x: float, y: float, margin_m: float = 0.0) -> bool:
        """Whether the point lies in the bounding box or within `margin_m` of it; if not, the area does not hold it."""
        if not (self.west - margin_m <= x <= self.east + margin_m):
            return False
        return self.south - margin_m <= y <= self.north + margin_m

    def holds(self, x: float, y: float, margin_m: float = 0.0) -> bool:
        """Whether the point lies in the area or within `margin_m` of it."""
        if not self.bounds_hold(x, y, margin_m):
            return False
        return inside(self.polygon, x, y) if margin_m <= 0.0 else within(self.polygon, x, y, margin_m)
