"""Cutting of long pieces at the squares of the grid, so that each tile holds little beyond its own square.

Areas are cut at every square that they enter, which keeps the painting order within a tile. Roads and bridges are cut
along their lines. A cut road keeps its id in every section: readers that need the whole road use the traffic network.
Buildings, solids and junctions are never cut; the extents of the tiles include what projects from them.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import pairwise
from math import ceil, floor
from typing import Any

import msgspec

from lingjing.mission.geometry2d import Polygon, signed_area
from lingjing.mission.instance import Vector
from lingjing.scene.city import Bridge, Lane, PaintedArea, Pieces, Road
from lingjing.scene.lines import lengths, section

STICKS_OUT_M = 100.0
"""A road or bridge is cut if it is longer than a tile's side by more than this, metres (chosen)."""

SLIVER_M2 = 0.05
"""Parts of a cut area that are smaller than this are dropped, square metres (chosen)."""


def cut(pieces: Pieces, tile_m: float) -> Pieces:
    """Return the pieces with long areas, roads and bridges divided."""
    return msgspec.structs.replace(
        pieces,
        areas=tuple(part for area in pieces.areas for part in _areas(area, tile_m)),
        roads=tuple(part for road in pieces.roads for part in _roads(road, tile_m)),
        bridges=tuple(part for bridge in pieces.bridges for part in _bridges(bridge, tile_m)),
    )


# -- areas


def _areas(area: PaintedArea, side: float) -> Iterator[PaintedArea]:
    if _fits(area.polygon, side):
        yield area
        return
    import shapely

    whole = shapely.make_valid(shapely.Polygon(area.polygon, area.holes))
    west, south, east, north = whole.bounds
    for column in range(floor(west / side), ceil(east / side)):
        for row in range(floor(south / side), ceil(north / side)):
            box = shapely.box(column * side, row * side, (column + 1) * side, (row + 1) * side)
            for part in polygons(shapely.intersection(whole, box)):
                for outline, *holes in filter(None, (rings(part),)):
                    first = _from_within(outline, column, row, side)
                    yield msgspec.structs.replace(area, polygon=first, holes=(*holes,))


def _fits(polygon: Polygon, side: float) -> bool:
    """True if a polygon lies in the square of its first point."""
    if not polygon:
        return True
    west, south = (floor(value / side) * side for value in polygon[0])
    return all(west <= x <= west + side and south <= y <= south + side for x, y in polygon)


def polygons(shape: Any) -> Iterator[Any]:
    """Yield the polygons of any shapely geometry, without slivers."""
    import shapely

    for part in shapely.get_parts(shape):
        if part.geom_type == "Polygon":
            if part.area > SLIVER_M2:
                yield part
        elif part.geom_type in ("MultiPolygon", "GeometryCollection"):
            yield from polygons(part)


def rings(polygon: Any) -> tuple[Polygon, ...]:
    """Return the outline of a shapely polygon and then its holes, in the form that cities use.

    Rings are anticlockwise, without a repeated first point, rounded to the millimetre. Empty if the outline vanishes.
    """
    outline, *holes = (_ring(ring.coords) for ring in (polygon.exterior, *polygon.interiors))
    return (outline, *(hole for hole in holes if hole)) if outline else ()


def _ring(coordinates: Iterable[tuple[float, ...]]) -> Polygon:
    points = [(round(point[0], 3), round(point[1], 3)) for point in coordinates]
    kept = tuple(point for before, point in pairwise(points) if point != before)
    if len(kept) < 3:
        return ()
    return kept if signed_area(kept) > 0.0 else kept[::-1]


def _from_within(outline: Polygon, column: int, row: int, side: float) -> Polygon:
    """Rotate the outline to begin at a point of this square. The square's east and north edges belong to its
    neighbours.
    """
    for k, (x, y) in enumerate(outline):
        if floor(x / side) == column and floor(y / side) == row:
            return outline[k:] + outline[:k]
    return outline


# -- lines


def _roads(road: Road, side: float) -> Iterator[Road]:
    shape = road.lanes[0].shape if road.lanes else ()
    shares = _shares(shape, side)
    if len(shares) <= 2:
        yield road
        return
    for start, end in pairwise(shares):
        lanes = tuple(_section(lane, start, end) for lane in road.lanes)
        yield msgspec.structs.replace(road, lanes=lanes)


def _section(lane: Lane, start: float, end: float) -> Lane:
    """The part of a lane between two positions, given as shares of its length."""
    whole = lengths(lane.shape)[-1]
    return msgspec.structs.replace(lane, shape=section(lane.shape, start * whole, end * whole) or lane.shape)


def _bridges(bridge: Bridge, side: float) -> Iterator[Bridge]:
    """Sections of a long bridge, cut at piers, so that the spacing of the piers continues."""
    length = lengths(bridge.path)[-1]
    if length <= side + STICKS_OUT_M:
        yield bridge
        return
    step = bridge.pier_spacing_m or side
    span = max(1, floor(side / step)) * step
    cuts = [0.0]
    while length - cuts[-1] > 1.5 * span:
        cuts.append(cuts[-1] + span)
    cuts.append(length)
    for number, (start, end) in enumerate(pairwise(cuts)):
        path = section(bridge.path, start, end)
        yield msgspec.structs.replace(bridge, id=f"{bridge.id}~{number}" if number else bridge.id, path=path)


def _shares(shape: tuple[Vector, ...], side: float) -> list[float]:
    """Positions at which a line is cut, as shares of its length: sections of about a tile's side; 0 and 1 for a short
    line.
    """
    length = lengths(shape)[-1]
    count = 1 if length <= side + STICKS_OUT_M else ceil(length / side)
    return [k / count for k in range(count + 1)]
