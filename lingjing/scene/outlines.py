"""Plane geometry for engines: bearings, and tests of points against polygons and their outlines.

Points are (east, north) in metres. Bearings are compass degrees in [0, 360). Polygons do not repeat the first point.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from lingjing.mission.geometry2d import Polygon, Vector2, bounds, edge_distance

_ROUNDING = 1e-9
"""Relative tolerance of floating-point comparisons."""


def compass(angle_deg: float) -> float:
    """An angle as a bearing in [0, 360). The modulo is applied twice: a tiny negative angle gives 360 at first."""
    return angle_deg % 360.0 % 360.0


def wrapped(angle_rad: float) -> float:
    """An angle in [-pi, pi), radians."""
    return (angle_rad + math.pi) % (2.0 * math.pi) - math.pi


def inside(polygon: Sequence[Vector2], x: float, y: float) -> bool:
    """True if a point lies in a polygon (even-odd rule). A point on an edge may give either result."""
    is_inside = False
    before_x, before_y = polygon[-1]
    for here_x, here_y in polygon:
        if (here_y > y) != (before_y > y) and x < (before_x - here_x) * (y - here_y) / (before_y - here_y) + here_x:
            is_inside = not is_inside
        before_x, before_y = here_x, here_y
    return is_inside


def within(polygon: Sequence[Vector2], x: float, y: float, margin_m: float = 0.0) -> bool:
    """True if a point lies in the polygon or within `margin_m` of it. If `margin_m` < 0: at least that far inside of
    it.
    """
    if margin_m < 0.0:
        return inside(polygon, x, y) and edge_distance(polygon, x, y) >= -margin_m
    return inside(polygon, x, y) or edge_distance(polygon, x, y) <= margin_m


def touches(polygon: Sequence[Vector2], x: float, y: float, half_m: float) -> bool:
    """True if the outline may touch the square of side `2 * half_m` about a point.

    False is certain. True is not, because the outline may pass close to a corner.
    """
    west, east, south, north = x - half_m, x + half_m, y - half_m, y + half_m
    before_x, before_y = polygon[-1]
    for here_x, here_y in polygon:
        ax, ay, bx, by = before_x, before_y, here_x, here_y
        before_x, before_y = here_x, here_y
        if max(ax, bx) < west or min(ax, bx) > east or max(ay, by) < south or min(ay, by) > north:
            continue
        dx, dy = bx - ax, by - ay
        off, reach = dx * (y - ay) - dy * (x - ax), half_m * (abs(dx) + abs(dy))
        if abs(off) <= reach * (1.0 + _ROUNDING):  # otherwise all four corners lie on one side of the edge
            return True
    return False


@dataclass(frozen=True, slots=True)
class BoundedPolygon:
    """A polygon with its bounding box, which rules out most points by four comparisons."""

    polygon: Polygon
    """Outline, metres; the four fields below are its bounds."""
    west: float
    south: float
    east: float
    north: float

    @classmethod
    def of(cls, polygon: Polygon) -> BoundedPolygon:
        """Return the polygon with its bounds."""
        return cls(polygon, *bounds(polygon))

    def bounds_hold(self, x: float, y: float, margin_m: float = 0.0) -> bool:
        """True if the point lies in the bounding box or within `margin_m` of it. If False, the polygon does not hold it
        either.
        """
        if not (self.west - margin_m <= x <= self.east + margin_m):
            return False
        return self.south - margin_m <= y <= self.north + margin_m

    def holds(self, x: float, y: float, margin_m: float = 0.0) -> bool:
        """True if the point lies in the polygon or within `margin_m` of it."""
        if not self.bounds_hold(x, y, margin_m):
            return False
        return inside(self.polygon, x, y) if margin_m <= 0.0 else within(self.polygon, x, y, margin_m)
