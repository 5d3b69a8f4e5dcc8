"""What a dog can touch: convex bodies in plain values, cut from the pieces of a city.

MuJoCo wants convex shapes, so footprints are divided: triangles (ear clipping), then neighbours joined as long as
they stay convex (Hertel and Mehlhorn 1983: at most four times the fewest parts possible). Rectangles become boxes,
which are cheaper. Everything is in world metres.
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
from lingjing.scene.props import BOXES, RODS

_TINY_M = 1e-4
_THICK_M, _ROUND = 0.5, math.sqrt(math.pi) / 2.0
_FOOT_M = 30.0  # how far below the datum the legs of piers go


@dataclass(frozen=True, slots=True)
class Hull:
    """The convex hull of `corners`; `thing` names what it belongs to."""

    thing: str
    corners: tuple[Vector, ...]


@dataclass(frozen=True, slots=True)
class OrientedBox:
    """An upright box: centre, half sizes, and the direction of its first axis (radians anticlockwise from east)."""

    thing: str
    centre: Vector
    half: Vector
    yaw: float = 0.0


@dataclass(frozen=True, slots=True)
class Capsule:
    """A rod with round ends."""

    thing: str
    start: Vector
    end: Vector
    radius_m: float


Shape = Hull | OrientedBox | Capsule


def shapes_of(pieces: Pieces) -> Iterator[Shape]:
    """Shapes of all pieces that stand in a dog's way, in the city's order. Land is `prisms`' business."""
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
    """The deck, one slab for each stretch of its centre line, joined at the bends; and the piers' legs."""
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
    """A rod for each stretch."""
    for start, end in pairwise(pipe.path):
        if math.dist(start, end) > _TINY_M:
            yield Capsule(pipe.id, start, end, pipe.radius_m)


def prop_shapes(prop: Prop) -> Iterator[Shape]:
    """What a prop is to bump into; nothing where it is decoration."""
    x, y, z = prop.position
    if prop.floating:
        return
    if prop.model in RODS:
        radius, height = (prop.scale * part for part in RODS[prop.model])
        if radius > 0.5 * height or radius > _THICK_M:
            yield OrientedBox(prop.id, (x, y, z + 0.5 * height), (_ROUND * radius, _ROUND * radius, 0.5 * height))
        else:  # from a little below, so that the round end is in the ground
            yield Capsule(prop.id, (x, y, z), (x, y, z + height - radius), radius)
    elif prop.model in BOXES:
        size = BOXES[prop.model]
        length, width, height = (0.5 * prop.scale * part for part in (size.length_m, size.width_m, size.height_m))
        yield OrientedBox(prop.id, (x, y, z + height), (length, width, height), math.radians(90.0 - prop.heading_deg))


def prisms(thing: str, outline: Polygon, holes: Sequence[Polygon], base_m: float, top_m: float) -> Iterator[Shape]:
    """Convex prisms that together fill a polygon between two elevations; nothing for one without volume."""
    if top_m - base_m < _TINY_M:
        return
    for part in convex_parts(outline, holes):
        box = _as_box(thing, part, base_m, top_m)
        if box is not None:
            yield box
        else:
            yield Hull(thing, tuple((x, y, z) for z in (base_m, top_m) for x, y in part))


def convex_parts(outline: Polygon, holes: Sequence[Polygon] = ()) -> tuple[tuple[Vector2, ...], ...]:
    """Convex polygons (anticlockwise) that together are the polygon; none where it has no area."""
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
    found = mapbox_earcut.triangulate_float64(np.asarray(corners, np.float64), ends).reshape(-1, 3).tolist()
    triangles: list[tuple[int, ...]] = []
    for a, b, c in found:
        area = turn(corners[a], corners[b], corners[c])
        if abs(area) > _TINY_M * _TINY_M:
            triangles.append((a, b, c) if area > 0.0 else (a, c, b))
    return corners, triangles


def _joined(corners: Sequence[Vector2], triangles: Sequence[tuple[int, ...]]) -> list[tuple[int, ...]]:
    """Join parts over their common edges, in the order of the edges, while the union stays convex."""
    parts: dict[int, tuple[int, ...]] = dict(enumerate(triangles))
    owner = {(a, b): number for number, part in parts.items() for a, b in _edges(part)}
    for a, b in list(owner):
        if (b, a) not in owner or (a, b) not in owner or owner[a, b] == owner[b, a]:
            continue
        one, other = owner[a, b], owner[b, a]
        union = _union(parts[one], parts[other], a, b)
        if len(set(union)) != len(union) or not _is_convex([corners[index] for index in union]):
            continue
        del parts[other], owner[a, b], owner[b, a]
        parts[one] = union
        owner.update(dict.fromkeys(_edges(union), one))
    return list(parts.values())


def _union(one: tuple[int, ...], other: tuple[int, ...], a: int, b: int) -> tuple[int, ...]:
    """Both polygons without their common edge a→b (b→a in the other one)."""
    at, there = one.index(b), other.index(a)
    first = one[at:] + one[:at]  # b … a
    second = other[there:] + other[:there]  # a … b
    return first + second[1:-1]


def _edges(part: Sequence[int]) -> Iterator[tuple[int, int]]:
    return zip(part, (*part[1:], part[0]), strict=True)


def _is_convex(points: Sequence[Vector2]) -> bool:
    count = len(points)
    turns = [turn(points[n - 2], points[n - 1], points[n]) for n in range(count)]
    if min(turns) < -_TINY_M * _TINY_M:
        return False
    # Turning left everywhere is not enough: a star does too, but goes round twice.
    ways = [math.atan2(points[n][1] - points[n - 1][1], points[n][0] - points[n - 1][0]) for n in range(count)]
    around = sum((ways[n] - ways[n - 1] + math.pi) % (2.0 * math.pi) - math.pi for n in range(count))
    return abs(around - 2.0 * math.pi) < 1.0


def _without_straights(outline: Sequence[Vector2]) -> tuple[Vector2, ...]:
    """The outline, anticlockwise, without repeated points and points on straight edges."""
    points = [point for n, point in enumerate(outline) if math.dist(point, outline[n - 1]) > _TINY_M]
    kept = [
        point
        for n, point in enumerate(points)
        if abs(turn(points[n - 1], point, points[(n + 1) % len(points)])) > _TINY_M * _TINY_M
    ]
    return tuple(kept) if signed_area(kept) > 0.0 else tuple(reversed(kept))


def _as_box(thing: str, part: Sequence[Vector2], base_m: float, top_m: float) -> OrientedBox | None:
    """The part as a box if it is a rectangle to the millimetre."""
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
    """The deck's left and right edge at a point of its centre line, square to the mean direction there."""
    path = bridge.path
    before, after = path[max(number - 1, 0)], path[min(number + 1, len(path) - 1)]
    east, north = after[0] - before[0], after[1] - before[1]
    length = math.hypot(east, north) or 1.0
    half = 0.5 * bridge.width_m / length
    x, y, z = path[number]
    return (x - north * half, y + east * half, z), (x + north * half, y - east * half, z)
