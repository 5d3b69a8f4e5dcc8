"""Entrances of buildings: those of the map, else one in the wall that faces the nearest way."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from math import atan2, degrees, hypot
from typing import Any

import msgspec

from lingjing.mission.geometry2d import Polygon
from lingjing.scene.city import Building, Road
from lingjing.scene.osm.features import Features
from lingjing.scene.osm.tags import is_below

MAPPED_M = 0.2
"""Greatest distance of a mapped entrance from the outline that it belongs to, metres (chosen)."""

ENTERED = ("residential", "house", "commercial", "office", "school", "public")
"""Uses of buildings that people enter by a door; halls and sheds have gates, which are not modelled."""

SMALLEST_M2 = 20.0
"""Least footprint that gets an entrance if the map has none, square metres (chosen: a garden house has less)."""

WALL_M = 2.6
"""Shortest wall with an entrance, metres: a door with its canopy, as it is drawn."""

FRONT_M = 3.0
"""Free depth in front of an entrance, metres (chosen): a body that delivers stands there."""

SIDE_M = 0.8
"""Half of the free width in front of an entrance, metres (chosen: a little more than a robot dog needs)."""


def with_doors(built: Sequence[Building], features: Features, roads: Iterable[Road], wet: Any) -> tuple[Building, ...]:
    """Return the buildings with their entrances. `wet`: the waters, a shapely geometry."""
    mapped, inferred = _MappedDoors(features), _InferredDoors(built, features, roads, wet)
    return tuple(_with_door(building, mapped, inferred) for building in built)


# -- private


def _with_door(building: Building, mapped: _MappedDoors, inferred: _InferredDoors) -> Building:
    if building.base_m > 0.0:
        return building
    place = mapped.of(building) or inferred.of(building)
    if place is None:
        return building
    return msgspec.structs.replace(building, entrance=(*place, _outward(building.polygon, *place)))


class _MappedDoors:
    """The entrances on the map."""

    def __init__(self, features: Features) -> None:
        import shapely

        self._places = list(features.entrances.items())
        self._tree = shapely.STRtree([shapely.Point(place) for place, _ in self._places])

    def of(self, building: Building) -> tuple[float, float] | None:
        """The place of the entrance on a building's outline; a main one has priority. None without one."""
        import shapely

        if not self._places:
            return None
        outline = shapely.LinearRing(building.polygon)
        near = [self._places[int(k)] for k in self._tree.query(outline, predicate="dwithin", distance=MAPPED_M)]
        return min(near, key=lambda item: (item[1] != "main", item[0]))[0] if near else None


class _InferredDoors:
    """Entrances at the middle of walls with free ground in front, near the way that passes the building."""

    def __init__(self, built: Sequence[Building], features: Features, roads: Iterable[Road], wet: Any) -> None:
        import shapely

        self._shapes = [shapely.Polygon(building.polygon) for building in built]
        self._buildings = shapely.STRtree(self._shapes)
        self._wet = wet
        shapely.prepare(wet)
        self._ways = list(_ways(features, roads))
        self._way_tree = shapely.STRtree(self._ways)

    def of(self, building: Building) -> tuple[float, float] | None:
        """The place of the entrance on a building's outline; None for a use without doors, or if no wall has room."""
        import shapely

        shape = shapely.Polygon(building.polygon)
        if building.use not in ENTERED or shape.area < SMALLEST_M2:
            return None
        way = self._ways[int(self._way_tree.nearest(shape))] if self._ways else None
        outline = (*building.polygon, building.polygon[0])
        walls = [(a, b) for a, b in pairwise(outline) if hypot(b[0] - a[0], b[1] - a[1]) >= WALL_M]
        for a, b in sorted(walls, key=lambda wall: _rank(wall, way)):
            middle = round((a[0] + b[0]) / 2.0, 3), round((a[1] + b[1]) / 2.0, 3)
            if self._is_free(a, b, middle):
                return middle
        return None

    def _is_free(self, a: tuple[float, float], b: tuple[float, float], middle: tuple[float, float]) -> bool:
        """True if the ground in front of a wall's middle is dry and not built on."""
        import shapely

        long = hypot(b[0] - a[0], b[1] - a[1])
        along = (b[0] - a[0]) / long, (b[1] - a[1]) / long
        out = along[1], -along[0]  # the outline is anticlockwise, so its outside is to the right
        (x, y), reach = middle, FRONT_M + SIDE_M
        corners = [(x + s * SIDE_M * along[0] + d * out[0], y + s * SIDE_M * along[1] + d * out[1])
                   for s, d in ((-1, 0.05), (1, 0.05), (1, reach), (-1, reach))]  # fmt: skip
        front = shapely.Polygon(corners)
        return not len(self._buildings.query(front, predicate="intersects")) and not self._wet.intersects(front)


def _ways(features: Features, roads: Iterable[Road]) -> Iterator[Any]:
    """Yield the lines of streets and paths on the ground."""
    import shapely

    for road in roads:
        for lane in road.lanes:
            if len(lane.shape) > 1 and not road.bridge and not road.tunnel:
                yield shapely.LineString([point[:2] for point in lane.shape])
    for line in features.lines:
        if "highway" in line.tags and not is_below(line.tags):
            yield line.shape


def _rank(wall: tuple[tuple[float, float], tuple[float, float]], way: Any) -> tuple[float, float, tuple[float, float]]:
    """Order of walls: near to the way by steps of 2 m, then long ones."""
    import shapely

    (ax, ay), (bx, by) = wall
    away = 0.0 if way is None else float(way.distance(shapely.Point((ax + bx) / 2.0, (ay + by) / 2.0)))
    return away // 2.0, -round(hypot(bx - ax, by - ay), 1), (ax, ay)


def _outward(outline: Polygon, x: float, y: float) -> float:
    """The bearing away from an anticlockwise outline at a point on it, degrees: perpendicular to the nearest wall."""
    import shapely

    walls = zip(outline, (*outline[1:], outline[0]), strict=True)
    spot = shapely.Point(x, y)
    (ax, ay), (bx, by) = min(walls, key=lambda wall: float(shapely.LineString(wall).distance(spot)))
    return round((degrees(atan2(bx - ax, by - ay)) + 90.0) % 360.0, 1)
