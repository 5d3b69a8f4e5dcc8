"""Where one can stand: the height of the ground at a place, what is in the way there, and the nearest free place.

Reads a city through its tiles, so it works on large ones too. Heights are elevations in metres.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from math import cos, hypot, pi, sin

from lingjing.mission.geometry2d import Polygon, contains, edge_distance
from lingjing.scene.city import City, Road
from lingjing.scene.lines import project
from lingjing.scene.tiles import Tiles

STEP_M = 0.5
"""What is not higher than this over the ground is stepped on, not walked around."""

BODIES_M: dict[str, float] = {
    "parked_truck": 4.8, "parked_car": 2.6, "container": 6.3, "crates": 1.2, "bench": 1.0, "rock": 1.5,
    "tree": 0.35, "lamp": 0.2,
}  # fmt: skip
"""Radius of the circle around things that block the way, by class."""

HEAD_M = 2.0
"""What begins higher than this over the ground is passed under."""

RING_M = 1.0


class Footing:
    """Ground and obstacles of a city."""

    def __init__(self, city: City, tiles: Tiles | None = None) -> None:
        self._city = city
        self._tiles = tiles or Tiles(city)

    def height(self, x: float, y: float) -> float:
        """Elevation of what one stands on: the highest land, kerb or step there; water's bed does not count."""
        tops = [land.top_m for land in self._city.lands if contains(land.polygon, x, y)]
        floor = max(tops, default=0.0)
        for tile in self._tiles.near(x, y, 0.0):
            for solid in tile.solids:
                if floor < solid.top_m <= floor + STEP_M and contains(solid.polygon, x, y):
                    floor = solid.top_m
        return floor

    def is_clear(self, x: float, y: float, margin: float, *, off_road: bool = False) -> bool:
        """Whether nothing stands within `margin` metres of a place on dry ground, and no road if `off_road`."""
        if self.is_water(x, y):
            return False
        for tile in self._tiles.near(x, y, margin + 7.0):
            if any(_within(building.polygon, x, y, margin) for building in tile.buildings):
                return False
            if any(
                solid.top_m > STEP_M and solid.base_m < HEAD_M and _within(solid.polygon, x, y, margin)
                for solid in tile.solids
            ):
                return False
            for prop in tile.props:
                reach = BODIES_M.get(prop.cls)
                if reach and hypot(prop.position[0] - x, prop.position[1] - y) < reach * prop.scale + margin:
                    return False
            if off_road and _on_road(tile.roads, x, y, margin):
                return False
        return True

    def is_water(self, x: float, y: float) -> bool:
        """Whether a place is in the water: in a body of water and on no land above that."""
        levels = (
            water.level_m
            for water in self._city.waters
            if contains(water.polygon, x, y) and not any(contains(hole, x, y) for hole in water.holes)
        )
        level = max(levels, default=None)
        return level is not None and not any(
            land.top_m > level and contains(land.polygon, x, y) for land in self._city.lands
        )

    def roof_over(self, x: float, y: float) -> float | None:
        """The top of the highest building at a place, if there is one."""
        found = [
            building.top_m
            for tile in self._tiles.near(x, y, 0.0)
            for building in tile.buildings
            if _within(building.polygon, x, y, 0.0)
        ]
        return max(found, default=None)

    def nearest_clear(
        self, x: float, y: float, margin: float, reach_m: float, *, off_road: bool = False,
        apart: Sequence[tuple[float, float]] = (), apart_m: float = 0.0, inside: Sequence[tuple[float, float]] = (),
        suits: Callable[[float, float], bool] | None = None,
    ) -> tuple[float, float] | None:  # fmt: skip
        """The nearest free place in the city on rings a metre apart, at least `apart_m` from the places in `apart`,
        within the outline `inside` and one that `suits`, if these are given; None if there is none within `reach_m`."""
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
    """A place and then rings around it, a metre apart and with a point every one and a half metres."""
    yield x, y
    for ring in range(1, int(reach_m / RING_M) + 1):
        radius = ring * RING_M
        many = max(8, round(2.0 * pi * radius / 1.5))
        for k in range(many):
            angle = 2.0 * pi * k / many
            yield round(x + radius * sin(angle), 3), round(y + radius * cos(angle), 3)


# -- private


def _within(polygon: Polygon, x: float, y: float, margin: float) -> bool:
    """Whether a place is in a polygon or nearer to it than `margin`; a look at the bounds saves most of the work."""
    if all(px < x - margin for px, _ in polygon) or all(px > x + margin for px, _ in polygon):
        return False
    if all(py < y - margin for _, py in polygon) or all(py > y + margin for _, py in polygon):
        return False
    return contains(polygon, x, y) or (margin > 0.0 and edge_distance(polygon, x, y) < margin)


def _on_road(roads: Sequence[Road], x: float, y: float, margin: float) -> bool:
    return any(
        project(lane.shape, x, y).off_m < lane.width_m / 2.0 + margin
        for road in roads
        if not road.tunnel
        for lane in road.lanes
        if lane.kind in ("car", "bus", "closed")
    )
