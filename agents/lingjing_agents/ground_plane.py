"""Points, rectangles and polygons of the ground plane: east and north in metres, without a height."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from lingjing.plugins.policy import Datum

GroundPoint = tuple[float, float]
"""East and north in metres."""


@dataclass(frozen=True, slots=True)
class GroundRectangle:
    """A rectangle with sides along the axes; unbounded by default."""

    west: float = -math.inf
    """Smallest easting in metres."""
    south: float = -math.inf
    """Smallest northing in metres."""
    east: float = math.inf
    """Largest easting in metres."""
    north: float = math.inf
    """Largest northing in metres."""

    @staticmethod
    def around(points: Sequence[GroundPoint], margin_m: float = 0.0) -> GroundRectangle:
        """Return the bounding rectangle of `points` with a margin on each side; unbounded without points."""
        if not points:
            return GroundRectangle()
        xs, ys = [x for x, _ in points], [y for _, y in points]
        return GroundRectangle(min(xs) - margin_m, min(ys) - margin_m, max(xs) + margin_m, max(ys) + margin_m)

    @property
    def area_m2(self) -> float:
        """Area in square metres."""
        return (self.east - self.west) * (self.north - self.south)

    def holds(self, place: GroundPoint) -> bool:
        """Return whether a point lies inside or on the edge."""
        return self.west <= place[0] <= self.east and self.south <= place[1] <= self.north


def inside(polygon: Sequence[GroundPoint], place: GroundPoint) -> bool:
    """Return whether a point lies inside a polygon (even-odd rule)."""
    x, y = place
    odd = False
    for (ax, ay), (bx, by) in zip(polygon, (*polygon[1:], polygon[0]), strict=True):
        if (ay > y) != (by > y) and x < ax + (y - ay) * (bx - ax) / (by - ay):
            odd = not odd
    return odd


def between(start: GroundPoint, end: GroundPoint, share: float) -> GroundPoint:
    """Return the point at a share of the way from `start` (0) to `end` (1); shares outside 0 to 1 extrapolate."""
    return start[0] + share * (end[0] - start[0]), start[1] + share * (end[1] - start[1])


def distance_to_segment_m(point: GroundPoint, start: GroundPoint, end: GroundPoint) -> float:
    """Return the distance in metres from a point to the segment between two others."""
    east, north = end[0] - start[0], end[1] - start[1]
    length2 = east * east + north * north
    along = 0.0 if length2 == 0.0 else ((point[0] - start[0]) * east + (point[1] - start[1]) * north) / length2
    return math.dist(point, between(start, end, min(max(along, 0.0), 1.0)))


def lattice(polygon: Sequence[GroundPoint], spacing_m: float, shift_m: float = 0.0) -> list[GroundPoint]:
    """Return the points inside a polygon of a square lattice over its bounding rectangle, moved north-east by
    `shift_m`.
    """
    if not polygon:
        return []
    own = GroundRectangle.around(polygon)
    first = spacing_m / 2 + shift_m
    columns, rows = int((own.east - own.west) / spacing_m) + 1, int((own.north - own.south) / spacing_m) + 1
    places = [
        (own.west + first + spacing_m * i, own.south + first + spacing_m * j)
        for i in range(columns)
        for j in range(rows)
    ]
    return [place for place in places if inside(polygon, place)]


def position_in(body: Mapping[str, Datum]) -> GroundPoint | None:
    """Return east and north of a message's `position`, or None without a valid one."""
    value = body.get("position")
    if not isinstance(value, (tuple, list)) or len(value) < 2:
        return None
    x, y = value[0], value[1]
    if isinstance(x, str) or isinstance(y, str) or not (math.isfinite(x) and math.isfinite(y)):
        return None
    return float(x), float(y)
