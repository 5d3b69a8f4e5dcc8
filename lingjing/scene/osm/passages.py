"""Lanes through buildings: a passage where a street leads through a building, room where it only touches one.

Maps draw a street through a gatehouse, and lanes of the usual width graze the walls of an old town. A building over a
lane is divided at the height of the passage: its upper part stays whole, its lower part leaves the lane free. A
building that is too low for a passage, or that a lane only touches, loses the ground of the lane at full height.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import msgspec

from lingjing.scene.city import Building, Road
from lingjing.scene.cutting import polygons, rings

CLEAR_M = 4.5
"""Clear height of a passage, metres (chosen: vehicles in most countries are at most 4.0 to 4.2 m high)."""

STOREY_M = 2.5
"""Least height of the part above a passage, metres (chosen)."""

CROSSED_M = 4.0
"""Length of a lane in a building from which it leads through it, metres (chosen)."""

SIDE_M = 0.3
"""Room between a lane and a wall, metres (chosen)."""

LEFT = 0.35
"""Share of a footprint that must remain beside the lanes (chosen); with less, the building is left out."""

SMALLEST_M2 = 4.0
"""Smallest remaining piece of a footprint, square metres (chosen)."""

_LANES = ("car", "bus", "closed")


def with_passages(built: Sequence[Building], roads: Iterable[Road]) -> tuple[Building, ...]:
    """Return the buildings, changed where a lane for vehicles at their height crosses or touches them."""
    lanes = _Lanes(roads)
    return tuple(piece for building in built for piece in _freed(building, lanes))


# -- private


class _Lanes:
    """The lanes for vehicles in the open, in a tree."""

    def __init__(self, roads: Iterable[Road]) -> None:
        import shapely

        shown = [lane for road in roads if not road.tunnel for lane in road.lanes if lane.kind in _LANES]
        self._lanes = [lane for lane in shown if len(lane.shape) > 1]
        self._lines = [shapely.LineString([point[:2] for point in lane.shape]) for lane in self._lanes]
        self._strips = [
            line.buffer(lane.width_m / 2.0 + SIDE_M, quad_segs=2)
            for line, lane in zip(self._lines, self._lanes, strict=True)
        ]
        self._tree = shapely.STRtree(self._strips)

    def through(self, shape: Any, base_m: float, top_m: float) -> tuple[list[Any], float, float]:
        """The strips of the lanes in a prism, the elevation of the highest, and the longest way through it, metres."""
        strips, highest, longest = [], 0.0, 0.0
        for k in sorted(int(k) for k in self._tree.query(shape, predicate="intersects")):
            elevation = _elevation(self._lanes[k].shape, shape)
            if elevation + CLEAR_M > base_m and elevation < top_m and shape.intersection(self._strips[k]).area > 0.05:
                strips.append(self._strips[k])
                highest = max(highest, elevation)
                longest = max(longest, float(self._lines[k].intersection(shape).length))
        return strips, highest, longest


def _elevation(path: Sequence[tuple[float, float, float]], shape: Any) -> float:
    """Elevation of a path at its point nearest to a shape, metres."""
    import shapely

    if path[0][2] == path[-1][2] == max(point[2] for point in path):
        return path[0][2]
    middle = shape.representative_point()
    return min(path, key=lambda point: middle.distance(shapely.Point(point[:2])))[2]


def _freed(building: Building, lanes: _Lanes) -> Iterator[Building]:
    import shapely

    shape = shapely.make_valid(shapely.Polygon(building.polygon, building.holes))
    strips, elevation, longest = lanes.through(shape, building.base_m, building.top_m)
    if not strips:
        yield building
        return
    beside = shapely.difference(shape, shapely.union_all(strips))
    floor_m = round(elevation + CLEAR_M, 2)
    walls_m = building.top_m - building.roof_m
    if longest >= CROSSED_M and walls_m >= floor_m + STOREY_M:
        share = (walls_m - floor_m) / (walls_m - building.base_m)
        upper_levels = max(1, round(building.levels * share))
        yield msgspec.structs.replace(building, base_m=max(floor_m, building.base_m), levels=upper_levels)
        lower = msgspec.structs.replace(
            building, top_m=floor_m, roof="bare", roof_m=0.0, levels=max(1, building.levels - upper_levels)
        )
        if building.base_m < floor_m - 0.5:
            yield from _pieces(lower, beside, "under")
    elif beside.area >= LEFT * shape.area:
        yield from _pieces(building, beside, "")


def _pieces(model: Building, shape: Any, suffix: str) -> Iterator[Building]:
    """Yield the model for each polygon of a shape. The first keeps the id if there is no suffix."""
    parts = sorted(polygons(shape.buffer(0.0)), key=lambda part: (-part.area, part.bounds))
    for number, part in enumerate(part for part in parts if part.area >= SMALLEST_M2):
        for outline, *holes in filter(None, (rings(part.simplify(0.05)),)):
            name = "-".join(filter(None, (model.id, suffix or ("cut" if number else ""), str(number or ""))))
            yield msgspec.structs.replace(model, id=name, polygon=outline, holes=(*holes,))
