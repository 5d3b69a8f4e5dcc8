"""Plane geometry of a mission's polygons, in pure Python.

A polygon is a tuple of (east, north) in metres without the closing repeat. Missions have polygons of a few vertices;
the maps of a city are larger and are in `lingjing.scene`.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Sequence
from functools import cache
from typing import Any

from lingjing.errors import MissionError
from lingjing.mission.geos import buffer_outline

Vector2 = tuple[float, float]
Polygon = tuple[Vector2, ...]
Extent = tuple[float, float, float, float]
"""(west, south, east, north) in metres."""

_CIRCLE_VERTICES = 64
"""Vertices of a circle (chosen)."""

_SEGMENTS = 8
"""Segments of a quarter of a buffer's round corner (chosen)."""


def signed_area(polygon: Sequence[Vector2]) -> float:
    """Area in square metres, positive if the polygon runs anticlockwise (shoelace, about the first vertex)."""
    if not polygon:
        return 0.0
    x0, y0 = polygon[0]
    twice = 0.0
    ax, ay = 0.0, 0.0
    for bx, by in polygon:
        bx, by = bx - x0, by - y0
        twice += ax * by - bx * ay
        ax, ay = bx, by
    return 0.5 * twice


def edges(polygon: Sequence[Vector2]) -> Iterator[tuple[Vector2, Vector2]]:
    """The edges in order, the closing one last."""
    return zip(polygon, itertools.chain(polygon[1:], polygon[:1]), strict=True)


def bounds(polygon: Sequence[Vector2]) -> Extent:
    """The bounding box."""
    easts, norths = [x for x, _ in polygon], [y for _, y in polygon]
    return min(easts), min(norths), max(easts), max(norths)


def centroid(polygon: Sequence[Vector2]) -> Vector2:
    """The centre of area."""
    x0, y0 = polygon[0]
    east = north = 0.0
    for (ax, ay), (bx, by) in edges(polygon):
        cross = (ax - x0) * (by - y0) - (bx - x0) * (ay - y0)
        east += cross * (ax + bx - 2 * x0)
        north += cross * (ay + by - 2 * y0)
    scale = 6.0 * signed_area(polygon)
    return x0 + east / scale, y0 + north / scale


MOST_CORNERS = 512
"""The largest number of corners of a result of `buffer` and `union` (chosen): nested round corners would multiply."""

_FIRST_TOLERANCE_M = 0.01
"""First tolerance of the simplification of an outline with more corners, metres (chosen); each further pass
doubles it."""

_FEW_SIDES = 64
"""In an outline of up to this many edges, the first crossing in edge order is reported (chosen); in a larger one, the
first that the sweep from the west meets."""


def normalised(polygon: Sequence[Vector2]) -> Polygon:
    """The same outline anticlockwise, without repeated neighbours and without the closing repeat."""
    kept: list[Vector2] = []
    for point in polygon:
        if not kept or point != kept[-1]:
            kept.append(point)
    while len(kept) > 1 and kept[0] == kept[-1]:
        kept.pop()
    return tuple(kept) if signed_area(kept) >= 0 else (kept[0], *reversed(kept[1:]))


def fault(polygon: Sequence[Vector2]) -> str:
    """The reason why the outline is no simple polygon, or "" if it is one."""
    if not all(map(math.isfinite, itertools.chain.from_iterable(polygon))):
        return "has a coordinate that is not a finite number"
    outline = normalised(polygon) if polygon else ()
    if len(outline) < 3:
        return f"has {len(outline)} different corners, 3 or more are needed"
    if abs(signed_area(outline)) < 1e-9:
        return "encloses no area"
    crossing = None if _is_convex(outline) else _crossing(outline)
    if crossing is not None:
        return f"crosses itself: edge {crossing[0] + 1} meets edge {crossing[1] + 1}"
    return ""


def left_of(line: Sequence[Vector2], reach: float) -> Polygon:
    """The area to the left of a line, up to `reach` metres from it. Both ends are extended straight by `reach`
    metres."""
    first, last = _beyond(line[1], line[0], reach), _beyond(line[-2], line[-1], reach)
    dx, dy = last[0] - first[0], last[1] - first[1]
    length = math.hypot(dx, dy)
    left = (-dy / length * reach, dx / length * reach)
    outline = (first, *line, last, (last[0] + left[0], last[1] + left[1]), (first[0] + left[0], first[1] + left[1]))
    return tuple((round(x, 3), round(y, 3)) for x, y in outline)


def contains(polygon: Sequence[Vector2], east: float, north: float) -> bool:
    """True if the point lies in the polygon or on its edge (even-odd rule)."""
    inside = False
    for (ax, ay), (bx, by) in edges(polygon):
        side = (bx - ax) * (north - ay) - (by - ay) * (east - ax)
        if side == 0.0 and min(ax, bx) <= east <= max(ax, bx) and min(ay, by) <= north <= max(ay, by):
            return True
        if (ay > north) != (by > north) and (side > 0) == (by > ay):
            inside = not inside
    return inside


def edge_distance(polygon: Sequence[Vector2], x: float, y: float) -> float:
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


def area_distance(polygon: Sequence[Vector2], x: float, y: float) -> float:
    """Distance from a point to the polygon's area, metres; 0 inside."""
    return 0.0 if contains(polygon, x, y) else edge_distance(polygon, x, y)


def convex_hull(points: Sequence[Vector2]) -> Polygon:
    """The convex hull, anticlockwise (Andrew's monotone chain)."""
    ordered = sorted(set(points))
    if len(ordered) < 3:
        return tuple(ordered)
    return (*_chain(ordered)[:-1], *_chain(ordered[::-1])[:-1])


def turn(a: Vector2, b: Vector2, c: Vector2) -> float:
    """Twice the area of a triangle; positive anticlockwise."""
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def clipped(polygon: Sequence[Vector2], box: Extent) -> Polygon:
    """The part of the polygon in the box (Sutherland and Hodgman), empty if they do not overlap.

    The pieces of a concave polygon that the box separates stay joined by edges along the box's border.
    """
    west, south, east, north = box
    outline = list(polygon)
    for axis, limit, sign in ((0, west, 1.0), (0, east, -1.0), (1, south, 1.0), (1, north, -1.0)):
        outline = _half_plane(outline, axis, limit, sign)
    kept = normalised(outline) if outline else ()
    return kept if len(kept) >= 3 and signed_area(kept) > 0 else ()


def circle(centre: Vector2, radius: float, vertices: int = _CIRCLE_VERTICES) -> Polygon:
    """A regular polygon with the circle's area, anticlockwise from east."""
    step = 2.0 * math.pi / vertices
    reach = radius * math.sqrt(step / math.sin(step))
    return tuple((centre[0] + reach * east, centre[1] + reach * north) for east, north in _directions(vertices))


@cache
def _directions(count: int) -> Polygon:
    """Points of the unit circle, anticlockwise from east."""
    step = 2.0 * math.pi / count
    return tuple((math.cos(k * step), math.sin(k * step)) for k in range(count))


def rectangle(corner: Vector2, opposite: Vector2) -> Polygon:
    """The rectangle between two opposite corners, anticlockwise from its south-west."""
    west, south, east, north = bounds((corner, opposite))
    return (west, south), (east, south), (east, north), (west, north)


def buffered(points: Sequence[Vector2], distance: float, *, closed: bool) -> Polygon:
    """The outline of the area within `distance` metres of a line, or of a polygon if `closed` (negative: shrunk).

    Round corners have 8 segments a quarter; coordinates are rounded to millimetres. Raises `MissionError` if nothing or
    several pieces are left. shapely is imported here, because few missions need it.
    """
    outline = buffer_outline(points, distance, closed=closed, segments=_SEGMENTS)
    if outline is not None and len(outline) <= MOST_CORNERS:
        return _rounded(outline)
    import shapely

    shape = shapely.Polygon(points) if closed else shapely.LineString(points)
    cap = "round" if closed else "flat"
    return _outline(shape.buffer(distance, quad_segs=_SEGMENTS, cap_style=cap), "buffer")


def united(polygons: Sequence[Sequence[Vector2]]) -> Polygon:
    """The outline around adjacent polygons. Raises `MissionError` if they are not adjacent or leave a hole between
    them."""
    import shapely

    return _outline(shapely.union_all([shapely.Polygon(polygon) for polygon in polygons]), "union")


def _outline(shape: Any, what: str) -> Polygon:
    if shape.geom_type != "Polygon" or shape.is_empty:
        raise MissionError(f"the {what} is not one area", hint="a region is one outline: join parts that meet")
    if shape.interiors:
        raise MissionError(f"the {what} has a hole", hint="a region has one outline and no holes")
    tolerance = _FIRST_TOLERANCE_M
    while len(shape.exterior.coords) > MOST_CORNERS:
        shape, tolerance = shape.simplify(tolerance), 2 * tolerance
    return _rounded(shape.exterior.coords)


def _rounded(outline: Iterable[Vector2]) -> Polygon:
    """The polygon of an outline, to millimetres."""
    return normalised([(round(x, 3), round(y, 3)) for x, y in outline])


def _chain(points: Sequence[Vector2]) -> list[Vector2]:
    chain: list[Vector2] = []
    for point in points:
        while len(chain) > 1 and turn(chain[-2], chain[-1], point) <= 0.0:
            chain.pop()
        chain.append(point)
    return chain


def _half_plane(outline: Sequence[Vector2], axis: int, limit: float, sign: float) -> list[Vector2]:
    kept: list[Vector2] = []
    for start, end in edges(outline):
        first, second = sign * (start[axis] - limit), sign * (end[axis] - limit)
        if first >= 0:
            kept.append(start)
        if (first > 0 > second) or (first < 0 < second):
            share = first / (first - second)
            cut = [start[0] + share * (end[0] - start[0]), start[1] + share * (end[1] - start[1])]
            cut[axis] = limit
            kept.append((cut[0], cut[1]))
    return kept


def _beyond(before: Vector2, at: Vector2, reach: float) -> Vector2:
    dx, dy = at[0] - before[0], at[1] - before[1]
    length = math.hypot(dx, dy) or 1.0
    return at[0] + dx / length * reach, at[1] + dy / length * reach


def _is_convex(outline: Polygon) -> bool:
    """True if the outline turns left at each corner and goes around once: it is then convex and crosses nothing.

    It goes around once if its course changes between west and east twice only.
    """
    changes, course = 0, 0.0
    for (ax, ay), (bx, by), (cx, cy) in zip(outline, outline[1:] + outline[:1], outline[2:] + outline[:2], strict=True):
        if (bx - ax) * (cy - by) - (by - ay) * (cx - bx) <= 0.0:
            return False
        if bx != ax:
            changes += (bx - ax) * course < 0.0
            course = bx - ax
    return changes <= 2


def _crossing(outline: Polygon) -> tuple[int, int] | None:
    crossings = _crossings(tuple(edges(outline)))
    return min(crossings, default=None) if len(outline) <= _FEW_SIDES else next(crossings, None)


def _crossings(sides: tuple[tuple[Vector2, Vector2], ...]) -> Iterator[tuple[int, int]]:
    """The pairs of edges that meet, from west to east (sweep): only edges that overlap on the west-east axis are
    compared."""
    last = len(sides) - 1
    order = sorted(range(len(sides)), key=lambda k: min(sides[k][0][0], sides[k][1][0]))
    active: list[int] = []
    for j in order:
        c, d = sides[j]
        west, south, north = min(c[0], d[0]), min(c[1], d[1]), max(c[1], d[1])
        active = [i for i in active if max(sides[i][0][0], sides[i][1][0]) >= west]
        for i in active:
            a, b = sides[i]
            if max(a[1], b[1]) < south or min(a[1], b[1]) > north:
                continue
            low, high = min(i, j), max(i, j)
            neighbours = high == low + 1 or (low == 0 and high == last)
            if _folds_back(*sides[low], *sides[high]) if neighbours else _meet(a, b, c, d):
                yield low, high
        active.append(j)


def _within(a: Vector2, b: Vector2, p: Vector2) -> bool:
    return min(a[0], b[0]) <= p[0] <= max(a[0], b[0]) and min(a[1], b[1]) <= p[1] <= max(a[1], b[1])


def _meet(a: Vector2, b: Vector2, c: Vector2, d: Vector2) -> bool:
    sides = turn(a, b, c), turn(a, b, d), turn(c, d, a), turn(c, d, b)
    if sides[0] * sides[1] < 0 and sides[2] * sides[3] < 0:
        return True
    touches = ((sides[0], a, b, c), (sides[1], a, b, d), (sides[2], c, d, a), (sides[3], c, d, b))
    return any(side == 0 and _within(start, end, point) for side, start, end, point in touches)


def _folds_back(a: Vector2, b: Vector2, c: Vector2, d: Vector2) -> bool:
    """True if two neighbouring edges, which share one corner, lie on top of each other."""
    shared, first, second = (b, a, d) if b == c else (a, b, c)
    if turn(shared, first, second) != 0:
        return False
    ahead = (first[0] - shared[0]) * (second[0] - shared[0]) + (first[1] - shared[1]) * (second[1] - shared[1])
    return ahead > 0
