"""Free ground in a city: elevation of the ground, obstacles at a place, and the nearest free place.

It reads a city through its tiles, so it works for large cities too. Elevations are in metres.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterator, Sequence
from math import cos, hypot, pi, sin

from lingjing.mission.geometry2d import Extent, Polygon, bounds, contains, edge_distance
from lingjing.scene.city import Building, City, Tile
from lingjing.scene.lines import project
from lingjing.scene.tiles import TileKey, Tiles

STEP_M = 0.5
"""Greatest height over the ground that a person steps on, metres (chosen). Higher things are obstacles."""

BODIES_M: dict[str, float] = {
    "parked_truck": 4.8, "parked_car": 2.6, "container": 6.3, "crates": 1.2, "bench": 1.0, "rock": 1.5,
    "tree": 0.35, "lamp": 0.2,
}  # fmt: skip
"""Radius of the circle around a blocking object, metres, by class (as drawn)."""

HEAD_M = 2.0
"""Height over the ground from which a person passes underneath, metres (chosen)."""

_TURNS = tuple(turn * pi / 4.0 for turn in range(8))
"""Bearings of the points around a place, radians."""

RING_M = 1.0
"""Distance between the rings of a search, metres (chosen)."""

_ROUNDING_M = 1e-6
"""A distance to a line differs by less from the exact one, metres. Chosen; maps are smaller than 100 km."""


class _Obstacles:
    """The obstacles of one tile with their bounds: a search compares thousands of places with them."""

    def __init__(self, tile: Tile) -> None:
        self.buildings: tuple[tuple[Building, Extent], ...] = tuple(
            (house, bounds(house.polygon)) for house in tile.buildings if house.polygon
        )
        self.solids: tuple[tuple[Polygon, Extent], ...] = tuple(
            (solid.polygon, bounds(solid.polygon))
            for solid in tile.solids
            if solid.top_m > STEP_M and solid.base_m < HEAD_M and solid.polygon
        )
        self._circles = sorted(
            (prop.position[0], prop.position[1], BODIES_M[prop.cls] * prop.scale)
            for prop in tile.props
            if BODIES_M.get(prop.cls)
        )
        """East, north and radius of blocking objects, metres, from west to east."""
        self._easts = [east for east, _, _ in self._circles]
        self._widest = max((radius for _, _, radius in self._circles), default=0.0)
        self._lanes = tuple(
            (lane.shape, lane.width_m / 2.0, bounds([corner[:2] for corner in lane.shape]))
            for road in tile.roads
            if not road.tunnel
            for lane in road.lanes
            if lane.kind in ("car", "bus", "closed") and lane.shape
        )

    def is_at_object(self, x: float, y: float, margin: float) -> bool:
        """True if a place is in the circle of a blocking object, or nearer to it than `margin`."""
        reach = self._widest + margin + _ROUNDING_M
        first, end = bisect_left(self._easts, x - reach), bisect_right(self._easts, x + reach)
        return any(hypot(east - x, north - y) < radius + margin for east, north, radius in self._circles[first:end])

    def is_on_lane(self, x: float, y: float, margin: float) -> bool:
        """True if a place is on a lane for vehicles, or nearer to one than `margin`."""
        return any(
            _is_near(extent, x, y, half + margin + _ROUNDING_M) and project(shape, x, y).off_m < half + margin
            for shape, half, extent in self._lanes
        )


class Footing:
    """Ground and obstacles of a city."""

    def __init__(self, city: City, tiles: Tiles | None = None) -> None:
        self._city = city
        self._tiles = tiles or Tiles(city)
        self._obstacles: dict[TileKey, _Obstacles] = {}

    def height(self, x: float, y: float) -> float:
        """Elevation of the surface to stand on: the highest land, kerb or step at a place. The bed of waters is
        ignored.
        """
        tops = [land.top_m for land in self._city.lands if contains(land.polygon, x, y)]
        floor = max(tops, default=0.0)
        for tile in self._tiles.near(x, y, 0.0):
            for solid in tile.solids:
                if floor < solid.top_m <= floor + STEP_M and contains(solid.polygon, x, y):
                    floor = solid.top_m
        return floor

    def is_clear(self, x: float, y: float, margin: float, *, off_road: bool = False) -> bool:
        """True if a place is dry and no obstacle is within `margin` metres; with `off_road`, no road either."""
        if self.is_water(x, y):
            return False
        for tile in self._tiles.near(x, y, margin + 7.0):
            if any(True for _ in self._buildings_within(tile, x, y, margin)):
                return False
            obstacles = self._obstacles_of(tile)
            if any(
                _is_near(extent, x, y, margin) and _reaches(polygon, x, y, margin)
                for polygon, extent in obstacles.solids
            ):
                return False
            if obstacles.is_at_object(x, y, margin):
                return False
            if off_road and obstacles.is_on_lane(x, y, margin):
                return False
        return True

    def is_road(self, x: float, y: float) -> bool:
        """True if a place is on a lane for vehicles."""
        return any(self._obstacles_of(tile).is_on_lane(x, y, 0.0) for tile in self._tiles.near(x, y, 7.0))

    def is_water(self, x: float, y: float) -> bool:
        """True if a place is in the water: inside a body of water, and on no land above its surface."""
        levels = (
            water.level_m
            for water in self._city.waters
            if contains(water.polygon, x, y) and not any(contains(hole, x, y) for hole in water.holes)
        )
        level = max(levels, default=None)
        return level is not None and not any(
            land.top_m > level and contains(land.polygon, x, y) for land in self._city.lands
        )

    def is_shore(self, x: float, y: float, margin: float) -> bool:
        """True if there is water within about `margin` metres of a place: at one of eight points around it."""
        around = ((x + margin * sin(turn), y + margin * cos(turn)) for turn in _TURNS)
        return any(self.is_water(*point) for point in around)

    def roof_over(self, x: float, y: float) -> float | None:
        """Elevation of the highest roof at a place; None outside of buildings."""
        tops = [
            building.top_m
            for tile in self._tiles.near(x, y, 0.0)
            for building in self._buildings_within(tile, x, y, 0.0)
        ]
        return max(tops, default=None)

    def _buildings_within(self, tile: Tile, x: float, y: float, margin: float) -> Iterator[Building]:
        """Yield the buildings of a tile that a place is inside of, or nearer to than `margin`."""
        for house, extent in self._obstacles_of(tile).buildings:
            if _is_near(extent, x, y, margin) and _reaches(house.polygon, x, y, margin):
                yield house

    def _obstacles_of(self, tile: Tile) -> _Obstacles:
        obstacles = self._obstacles.get(tile.key)
        if obstacles is None:
            obstacles = self._obstacles[tile.key] = _Obstacles(tile)
        return obstacles

    def nearest_clear(
        self, x: float, y: float, margin: float, reach_m: float, *, off_road: bool = False,
        apart: Sequence[tuple[float, float]] = (), apart_m: float = 0.0, inside: Sequence[tuple[float, float]] = (),
        suits: Callable[[float, float], bool] | None = None,
    ) -> tuple[float, float] | None:  # fmt: skip
        """Return the nearest free place in the city on rings 1 m apart; None if there is none within `reach_m`.

        The place is at least `apart_m` from each place in `apart`, inside the outline `inside` unless that is empty,
        and one for which `suits` is true.
        """
        west, south, east, north = self._city.bounds
        for px, py in rings(x, y, reach_m):
            if not (west <= px <= east and south <= py <= north):
                continue
            if inside and not contains(inside, px, py):
                continue
            if (
                all(hypot(px - ax, py - ay) >= apart_m for ax, ay in apart)
                and self.is_clear(px, py, margin, off_road=off_road)
                and (suits is None or suits(px, py))
            ):
                return px, py
        return None


def rings(x: float, y: float, reach_m: float) -> Iterator[tuple[float, float]]:
    """Yield a place and then points on rings around it; rings are 1 m apart, their points 1.5 m."""
    yield x, y
    for ring in range(1, int(reach_m / RING_M) + 1):
        radius = ring * RING_M
        many = max(8, round(2.0 * pi * radius / 1.5))
        for k in range(many):
            angle = 2.0 * pi * k / many
            yield round(x + radius * sin(angle), 3), round(y + radius * cos(angle), 3)


# -- private


def _is_near(extent: Extent, x: float, y: float, margin: float) -> bool:
    """True if a place is inside bounds, or beside them by at most `margin`."""
    west, south, east, north = extent
    return west <= x + margin and x - margin <= east and south <= y + margin and y - margin <= north


def _reaches(polygon: Polygon, x: float, y: float, margin: float) -> bool:
    """True if a place is inside a polygon or nearer to it than `margin`."""
    return contains(polygon, x, y) or (margin > 0.0 and edge_distance(polygon, x, y) < margin)
