"""Obstacles of a city: prisms and slabs that a moving body collides with or rests on, made from the city's pieces.

A block is a polygon between two planes. Walls, decks and buildings have level planes; slopes and the decks of bridges
have inclined ones. A pitched roof counts as full up to its ridge.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator
from dataclasses import dataclass

from lingjing.mission.geometry2d import Polygon
from lingjing.mission.instance import Vector
from lingjing.scene.city import Bridge, Building, Pieces, Slope, Solid
from lingjing.scene.outlines import BoundedPolygon, inside
from lingjing.sums import total

PIER_M = 1.8
"""Side of the square leg of a pier, metres (chosen)."""
_TWO_LEGS_M = 11.0
"""Width of a deck from which its piers have two legs, metres (as the camera engine draws them)."""
_CAP_SHARE = 0.62
"""Length of a pier's cap as a share of the deck's width (as drawn)."""
_LEG_SHARE = 0.55
"""Distance between the two legs as a share of the cap's length (as drawn)."""

Plane = tuple[float, float, float]
"""Rise per metre east, rise per metre north, elevation at the frame's origin."""


@dataclass(frozen=True, slots=True)
class Block:
    """A solid polygon between two planes."""

    id: str
    """Id of the piece. Parts of one bridge share it."""
    area: BoundedPolygon
    """Outline with its bounds."""
    base: Plane
    """Plane of the underside."""
    top: Plane
    """Plane of the upper side."""
    holes: tuple[Polygon, ...] = ()
    """Open courtyards."""

    def base_at(self, x: float, y: float) -> float:
        """Elevation of the underside, metres."""
        return self.base[0] * x + self.base[1] * y + self.base[2]

    def top_at(self, x: float, y: float) -> float:
        """Elevation of the upper side, metres."""
        return self.top[0] * x + self.top[1] * y + self.top[2]

    def covers(self, x: float, y: float, margin_m: float = 0.0) -> bool:
        """True if a point in plan is inside the outline or within `margin_m` of it, and in no courtyard."""
        return self.area.holds(x, y, margin_m) and not any(inside(hole, x, y) for hole in self.holes)


def blocks(pieces: Pieces) -> Iterator[Block]:
    """Yield the blocks of solids, buildings, slopes and bridges."""
    for solid in pieces.solids:
        yield _prism(solid)
    for building in pieces.buildings:
        yield _prism(building, building.holes)
    for slope in pieces.slopes:
        yield from _slab(slope)
    for bridge in pieces.bridges:
        yield from _decks(bridge)
        yield from _piers(bridge)


def _prism(piece: Solid | Building, holes: tuple[Polygon, ...] = ()) -> Block:
    return Block(piece.id, BoundedPolygon.of(piece.polygon), (0.0, 0.0, piece.base_m), (0.0, 0.0, piece.top_m), holes)


def _slab(slope: Slope) -> Iterator[Block]:
    top = _plane(slope.top)
    if top is not None:
        outline = tuple((x, y) for x, y, _ in slope.top)
        yield Block(slope.id, BoundedPolygon.of(outline), (top[0], top[1], top[2] - slope.thickness_m), top)


def _plane(points: tuple[Vector, ...]) -> Plane | None:
    """The plane through the first three points that are not in line in plan; None if all are."""
    (x0, y0, z0), *rest = points
    for (x1, y1, z1), (x2, y2, z2) in itertools.combinations(rest, 2):
        area = (x1 - x0) * (y2 - y0) - (x2 - x0) * (y1 - y0)
        if abs(area) > 1e-6:
            east = ((z1 - z0) * (y2 - y0) - (z2 - z0) * (y1 - y0)) / area
            north = ((x1 - x0) * (z2 - z0) - (x2 - x0) * (z1 - z0)) / area
            return east, north, z0 - east * x0 - north * y0
    return None


def _decks(bridge: Bridge) -> Iterator[Block]:
    for start, end in itertools.pairwise(bridge.path):
        length = math.dist(start[:2], end[:2])
        if length < 1e-6:
            continue
        east, north = (end[0] - start[0]) / length, (end[1] - start[1]) / length
        rise = (end[2] - start[2]) / length
        level = start[2] - rise * (east * start[0] + north * start[1])
        top = (rise * east, rise * north, level)
        yield Block(
            bridge.id,
            BoundedPolygon.of(_oblong(start, end, (east, north), bridge.width_m / 2.0)),
            (top[0], top[1], level - bridge.thickness_m),
            top,
        )


def _oblong(start: Vector, end: Vector, along: tuple[float, float], half: float) -> Polygon:
    right = (half * along[1], -half * along[0])
    return (
        (start[0] + right[0], start[1] + right[1]),
        (end[0] + right[0], end[1] + right[1]),
        (end[0] - right[0], end[1] - right[1]),
        (start[0] - right[0], start[1] - right[1]),
    )


def _piers(bridge: Bridge) -> Iterator[Block]:
    half = PIER_M / 2.0
    for x, y, z in pier_places(bridge):
        square = ((x - half, y - half), (x + half, y - half), (x + half, y + half), (x - half, y + half))
        yield Block(bridge.id, BoundedPolygon.of(square), (0.0, 0.0, -math.inf), (0.0, 0.0, z - bridge.thickness_m))


def pier_places(bridge: Bridge) -> Iterator[Vector]:
    """Yield the places of a bridge's pier legs, with the deck's elevation there.

    Piers stand in the middles of equal fields of at most `pier_spacing_m`. A narrow deck has one leg per pier, a wide
    one two.
    """
    whole = total(math.dist(a[:2], b[:2]) for a, b in itertools.pairwise(bridge.path))
    if bridge.pier_spacing_m <= 0.0 or whole < 1.0:
        return
    fields = int(whole // bridge.pier_spacing_m) + 1
    apart = _LEG_SHARE * min(_CAP_SHARE * bridge.width_m, bridge.width_m - 0.6) / 2.0
    legs = (0.0,) if bridge.width_m < _TWO_LEGS_M else (-apart, apart)
    for number in range(fields):
        (x, y, z), (east, north) = _along(bridge.path, (number + 0.5) * whole / fields)
        yield from ((x - leg * north, y + leg * east, z) for leg in legs)


def _along(path: tuple[Vector, ...], distance: float) -> tuple[Vector, tuple[float, float]]:
    """The point of a path at a distance from its start, and the direction there."""
    for start, end in itertools.pairwise(path):
        length = math.dist(start[:2], end[:2])
        if length > 0.0 and distance <= length:
            x, y, z = (a + distance / length * (b - a) for a, b in zip(start, end, strict=True))
            return (x, y, z), ((end[0] - start[0]) / length, (end[1] - start[1]) / length)
        distance -= length
    return path[-1], (1.0, 0.0)
