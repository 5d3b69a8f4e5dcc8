"""Plane geometry over a `City`: bearings, polygons, where there is water, where there is ground.

Points are (east, north) metres, bearings compass degrees in [0, 360). Polygons are without the closing repeat.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass

from lingjing.scene.city import City, Polygon, Solid

Point = tuple[float, float]

_CELL_M = 50.0
_REACH_M = 1.0


def compass(angle_deg: float) -> float:
    """An angle as a bearing in [0, 360); taken twice, because a tiny negative angle rounds up to 360 the first time."""
    return angle_deg % 360.0 % 360.0


def inside(polygon: Sequence[Point], x: float, y: float) -> bool:
    """Whether a point lies in a polygon (even-odd rule; points on the edge may fall on either side)."""
    found = False
    before_x, before_y = polygon[-1]
    for here_x, here_y in polygon:
        if (here_y > y) != (before_y > y) and x < (before_x - here_x) * (y - here_y) / (before_y - here_y) + here_x:
            found = not found
        before_x, before_y = here_x, here_y
    return found


def edge_distance(polygon: Sequence[Point], x: float, y: float) -> float:
    """Distance from a point to the polygon's outline, metres."""
    nearest = math.inf
    before_x, before_y = polygon[-1]
    for here_x, here_y in polygon:
        along_x, along_y = here_x - before_x, here_y - before_y
        length = along_x * along_x + along_y * along_y
        share = 0.0 if length == 0.0 else ((x - before_x) * along_x + (y - before_y) * along_y) / length
        share = min(max(share, 0.0), 1.0)
        nearest = min(nearest, math.hypot(x - before_x - share * along_x, y - before_y - share * along_y))
        before_x, before_y = here_x, here_y
    return nearest


def within(polygon: Sequence[Point], x: float, y: float, margin_m: float) -> bool:
    """Whether a point lies in the polygon or within `margin_m` of it."""
    return inside(polygon, x, y) or edge_distance(polygon, x, y) <= margin_m


@dataclass(frozen=True, slots=True)
class Area:
    """A polygon with its bounding box, so that most points are ruled out by four comparisons."""

    polygon: Polygon
    west: float
    south: float
    east: float
    north: float

    @classmethod
    def of(cls, polygon: Polygon) -> Area:
        """The area of a polygon."""
        xs, ys = [point[0] for point in polygon], [point[1] for point in polygon]
        return cls(polygon, min(xs), min(ys), max(xs), max(ys))

    def holds(self, x: float, y: float, margin_m: float = 0.0) -> bool:
        """Whether the point lies in the area or within `margin_m` of it."""
        if not (self.west - margin_m <= x <= self.east + margin_m):
            return False
        if not (self.south - margin_m <= y <= self.north + margin_m):
            return False
        return inside(self.polygon, x, y) if margin_m <= 0.0 else within(self.polygon, x, y, margin_m)


class Terrain:
    """What a point of the city's map is: water or land, how high the surface is, which solids stand there."""

    def __init__(self, city: City) -> None:
        self.datum_m = city.datum_m
        self._waters = tuple((Area.of(water.polygon), water.level_m) for water in city.waters)
        self._lands = tuple((Area.of(land.polygon), land.top_m) for land in city.lands)
        self._solids = _indexed(city.solids)
        tops = [city.datum_m, *(top for _, top in self._lands), *(level for _, level in self._waters)]
        self.highest_m = max([*tops, *(solid.top_m for solid in city.solids)])

    def water_level(self, x: float, y: float) -> float | None:
        """Still-water elevation at a point that is afloat, or None on dry land and off every water."""
        level = max((level for area, level in self._waters if area.holds(x, y)), default=None)
        if level is None or any(top > level and area.holds(x, y) for area, top in self._lands):
            return None
        return level

    def surface(self, x: float, y: float) -> float:
        """Elevation of the ground or the still water at a point; the datum where the map holds neither."""
        tops = [top for area, top in self._lands if area.holds(x, y)]
        tops += [level for area, level in self._waters if area.holds(x, y)]
        return max(tops, default=self.datum_m)

    def support(self, x: float, y: float, below_m: float) -> float:
        """Elevation of what something falling from `below_m` comes to rest on: ground, water or a solid's top."""
        tops = [solid.top_m for area, solid in self._near(x, y) if solid.top_m <= below_m and area.holds(x, y)]
        return max([self.surface(x, y), *tops])

    def solids_at(self, x: float, y: float, low_m: float, high_m: float, margin_m: float = 0.0) -> tuple[Solid, ...]:
        """Solids that a body of radius `margin_m` (at most 1 m) between two elevations is in touch with."""
        return tuple(
            solid
            for area, solid in self._near(x, y)
            if solid.base_m < high_m and solid.top_m > low_m and area.holds(x, y, margin_m)
        )

    def _near(self, x: float, y: float) -> tuple[tuple[Area, Solid], ...]:
        return self._solids.get((math.floor(x / _CELL_M), math.floor(y / _CELL_M)), ())


def _indexed(solids: Sequence[Solid]) -> dict[tuple[int, int], tuple[tuple[Area, Solid], ...]]:
    """Solids by the grid cells that they touch, in the city's order, so that a lookup does not grow with the city."""
    cells: dict[tuple[int, int], list[tuple[Area, Solid]]] = {}
    for solid in solids:
        area = Area.of(solid.polygon)
        columns = range(math.floor((area.west - _REACH_M) / _CELL_M), math.floor((area.east + _REACH_M) / _CELL_M) + 1)
        rows = range(math.floor((area.south - _REACH_M) / _CELL_M), math.floor((area.north + _REACH_M) / _CELL_M) + 1)
        for cell in itertools.product(columns, rows):
            cells.setdefault(cell, []).append((area, solid))
    return {cell: tuple(found) for cell, found in cells.items()}
