"""Collision shapes of a city for robot dogs: convex bodies in plain values, cut from the city's pieces.

MuJoCo needs convex shapes, so footprints are divided into triangles (ear clipping). Neighbouring triangles are then
merged while the union is convex (Hertel and Mehlhorn 1983: at most four times the least number of parts). Rectangles
become boxes, which are cheaper. All coordinates are world metres.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise

from lingjing.mission.geometry2d import Polygon, Vector2, signed_area, turn
from lingjing.mission.instance import Vector
from lingjing.scene.blocks import PIER_M, pier_places
from lingjing.scene.city import Bridge, Building, Pieces, Pipe, Prop, Slope, Solid
from lingjing.scene.sizes import BOXES, RODS
from lingjing.sums import total

_TINY_M = 1e-4
"""Tolerance of geometry, metres: shorter edges and thinner prisms are dropped."""
_THICK_M = 0.5
"""Radius from which an upright rod becomes a box: the round ends of a capsule would deviate too much (chosen)."""
_ROUND = math.sqrt(math.pi) / 2.0
"""Half side of the square with the area of a circle of radius 1."""
_FOOT_M = 30.0
"""Depth below the datum that the legs of bridge piers reach, metres (chosen)."""


@dataclass(frozen=True, slots=True)
class Hull:
    """The convex hull of `corners`."""

    thing: str
    """Id of the piece that it belongs to."""
    corners: tuple[Vector, ...]
    """Metres."""


@dataclass(frozen=True, slots=True)
class OrientedBox:
    """An upright box."""

    thing: str
    """Id of the piece that it belongs to."""
    centre: Vector
    """Metres."""
    half: Vector
    """Half of each dimension, metres."""
    yaw: float = 0.0
    """Direction of the first axis, radians anticlockwise from east."""


@dataclass(frozen=True, slots=True)
class Capsule:
    """A cylinder with hemispherical ends."""

    thing: str
    start: Vector
    end: Vector
    radius_m: float


Shape = Hull | OrientedBox | Capsule


def shapes_of(pieces: Pieces) -> Iterator[Shape]:
    """Yield the collision shapes of all pieces, in the city's order. Lands are not included; `prisms` makes them."""
    for solid in pieces.solids:
        yield from solid_shapes(solid)
    for building in pieces.buildings:
        yield from solid_shapes(building)
    for slope in pieces.slopes:
        yield slope_shape(slope)
    for bridge in pieces.bridges:
        yield from bridge_shapes(bridge)
    for pipe in pieces.pipes:
        yield from pipe_shapes(pipe)
    for prop in pieces.props:
        yield from prop_shapes(prop)


def solid_shapes(piece: Solid | Building) -> Iterator[Shape]:
    """The prism of a solid or a building."""
    holes = piece.holes if isinstance(piece, Building) else ()
    return prisms(piece.id, piece.polygon, holes, piece.base_m, piece.top_m)


def slope_shape(slope: Slope) -> Hull:
    """The slab under an inclined top."""
    below = tuple((x, y, z - slope.thickness_m) for x, y, z in slope.top)
    return Hull(slope.id, slope.top + below)


def bridge_shapes(bridge: Bridge) -> Iterator[Shape]:
    """Yield one slab for each segment of the deck's centre line, joined at the bends, and the legs of the piers."""
    edges = [_crossing(bridge, number) for number in range(len(bridge.path))]
    for (left, right), (next_left, next_right) in pairwise(edges):
        deck = (left, right, next_right, next_left)
        yield Hull(bridge.id, deck + tuple((x, y, z - bridge.thickness_m) for x, y, z in deck))
    half = 0.5 * PIER_M
    for x, y, z in pier_places(bridge):
        top = z - bridge.thickness_m
        height = 0.5 * (top + _FOOT_M)
        if height > 0.0:
            yield OrientedBox(bridge.id, (x, y, top - height), (half, half, height))


def pipe_shapes(pipe: Pipe) -> Iterator[Capsule]:
    """Yield one capsule for each segment."""
    for start, end in pairwise(pipe.path):
        if math.dist(start, end) > _TINY_M:
            yield Capsule(pipe.id, start, end, pipe.radius_m)


def prop_shapes(prop: Prop) -> Iterator[Shape]:
    """Yield the collision shape of a prop; nothing for decoration."""
    x, y, z = prop.position
    if prop.floating:
        return
    if prop.model in RODS:
        radius, height = (prop.scale * part for part in RODS[prop.model])
        if radius > 0.5 * height or radius > _THICK_M:
            yield OrientedBox(prop.id, (x, y, z + 0.5 * height), (_ROUND * radius, _ROUND * radius, 0.5 * height))
        else:  # the lower hemisphere of the capsule lies below the ground
            yield Capsule(prop.id, (x, y, z), (x, y, z + height - radius), radius)
    elif prop.model in BOXES:
        size = BOXES[prop.model]
        length, width, height = (0.5 * prop.scale * part for part in (size.length_m, size.width_m, size.height_m))
        yield OrientedBox(prop.id, (x, y, z + height), (length, width, height), math.radians(90.0 - prop.heading_deg))


def prisms(thing: str, outline: Polygon, holes: Sequence[Polygon], base_m: float, top_m: float) -> Iterator[Shape]:
    """Yield convex prisms that together fill a polygon between two elevations; nothing if the volume is empty."""
    if top_m - base_m < _TINY_M:
        return
    for part in convex_parts(outline, holes):
        box = _as_box(thing, part, base_m, top_m)
        if box is not None:
            yield box
        else:
            yield Hull(thing, tuple((x, y, z) for z in (base_m, top_m) for x, y in part))


def convex_parts(outline: Polygon, holes: Sequence[Polygon] = ()) -> tuple[tuple[Vector2, ...], ...]:
    """Return convex polygons (anticlockwise) that together are the polygon; none if it has no area."""
    points = _without_straights(outline)
    if len(points) < 3:
        return ()
    if not holes and _is_convex(points):
        return (points,)
    corners, triangles = _triangles(points, holes)
    return tuple(tuple(corners[index] for index in part) for part in _joined(corners, triangles))


def _triangles(outline: Sequence[Vector2], holes: Sequence[Polygon]) -> tuple[list[Vector2], list[tuple[int, ...]]]:
    import mapbox_earcut
    import numpy as np

    rings = [outline, *(hole for hole in holes if len(hole) >= 3)]
    corners = [point for ring in rings for point in ring]
    ends = np.cumsum([len(ring) for ring in rings]).astype(np.uint32)
    indices = mapbox_earcut.triangulate_float64(np.asarray(corners, np.float64), ends).reshape(-1, 3).tolist()
    triangles: list[tuple[int, ...]] = []
    for a, b, c in indices:
        area = turn(corners[a], corners[b], corners[c])
        if abs(area) > _TINY_M * _TINY_M:
            triangles.append((a, b, c) if area > 0.0 else (a, c, b))
    return corners, triangles


def _joined(corners: Sequence[Vector2], triangles: Sequence[tuple[int, ...]]) -> list[tuple[int, ...]]:
    """Merge parts over their common edges, in the order of the edges, while the union is convex."""
    parts: dict[int, tuple[int, ...]] = dict(enumerate(triangles))
    owner = {(a, b): number for number, part in parts.items() for a, b in _edges(part)}
    for a, b in list(owner):
        if (b, a) not in owner or (a, b) not in owner or owner[a, b] == owner[b, a]:
            continue
        kept, merged = owner[a, b], owner[b, a]
        union = _union(parts[kept], parts[merged], a, b)
        if len(set(union)) != len(union) or not _is_convex([corners[index] for index in union]):
            continue
        del parts[merged], owner[a, b], owner[b, a]
        parts[kept] = union
        owner.update(dict.fromkeys(_edges(union), kept))
    return list(parts.values())


def _union(polygon: tuple[int, ...], other: tuple[int, ...], a: int, b: int) -> tuple[int, ...]:
    """The union of two polygons with the common edge a→b (b→a in `other`), without that edge."""
    offset, other_offset = polygon.index(b), other.index(a)
    first = polygon[offset:] + polygon[:offset]  # b … a
    second = other[other_offset:] + other[:other_offset]  # a … b
    return first + second[1:-1]


def _edges(part: Sequence[int]) -> Iterator[tuple[int, int]]:
    return zip(part, (*part[1:], part[0]), strict=True)


def _is_convex(points: Sequence[Vector2]) -> bool:
    count = len(points)
    turns = [turn(points[n - 2], points[n - 1], points[n]) for n in range(count)]
    if min(turns) < -_TINY_M * _TINY_M:
        return False
    # Left turns alone do not prove convexity: a star turns left everywhere too, but goes round twice.
    ways = [math.atan2(points[n][1] - points[n - 1][1], points[n][0] - points[n - 1][0]) for n in range(count)]
    around = total((ways[n] - ways[n - 1] + math.pi) % (2.0 * math.pi) - math.pi for n in range(count))
    return abs(around - 2.0 * math.pi) < 1.0


def _without_straights(outline: Sequence[Vector2]) -> tuple[Vector2, ...]:
    """The outline, anticlockwise, without repeated points and without points on straight edges."""
    points = [point for n, point in enumerate(outline) if math.dist(point, outline[n - 1]) > _TINY_M]
    kept = [
        point
        for n, point in enumerate(points)
        if abs(turn(points[n - 1], point, points[(n + 1) % len(points)])) > _TINY_M * _TINY_M
    ]
    return tuple(kept) if signed_area(kept) > 0.0 else tuple(reversed(kept))


def _as_box(thing: str, part: Sequence[Vector2], base_m: float, top_m: float) -> OrientedBox | None:
    """The part as a box if it is a rectangle within 2 mm, else None."""
    if len(part) != 4:
        return None
    (ax, ay), (bx, by), (cx, cy), (dx, dy) = part
    if math.hypot(ax + cx - bx - dx, ay + cy - by - dy) > 2e-3:
        return None
    if abs(math.dist(part[0], part[2]) - math.dist(part[1], part[3])) > 2e-3:
        return None
    half = (0.5 * math.hypot(bx - ax, by - ay), 0.5 * math.hypot(cx - bx, cy - by), 0.5 * (top_m - base_m))
    centre = ((ax + bx + cx + dx) / 4.0, (ay + by + cy + dy) / 4.0, 0.5 * (base_m + top_m))
    return OrientedBox(thing, centre, half, math.atan2(by - ay, bx - ax))


def _crossing(bridge: Bridge, number: int) -> tuple[Vector, Vector]:
    """The deck's left and right edge at a point of its centre line, perpendicular to the mean direction there."""
    path = bridge.path
    before, after = path[max(number - 1, 0)], path[min(number + 1, len(path) - 1)]
    east, north = after[0] - before[0], after[1] - before[1]
    length = math.hypot(east, north) or 1.0
    half = 0.5 * bridge.width_m / length
    x, y, z = path[number]
    return (x - north * half, y + east * half, z), (x + north * half, y - east * half, z)
