"""`SightLines`: tests of straight lines through a city against its ground, buildings, bridges, slopes and solids.

A line is blocked if any part of it lies inside one of these. Trees, other bodies, smoke and weather block nothing.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from functools import cached_property
from itertools import pairwise

from lingjing.mission.geometry2d import Polygon
from lingjing.mission.instance import Vector
from lingjing.scene.blocks import Block
from lingjing.scene.city import City
from lingjing.scene.outlines import BoundedPolygon
from lingjing.scene.terrain import REACH_M, Terrain

_TOUCH_M = 1e-6
"""Depth up to which a line may enter a solid unblocked, metres: far above rounding errors (chosen)."""


class SightLines:
    """The free lines of a city, which is requested with the first line."""

    def __init__(self, city: Callable[[], City | None]) -> None:
        self._city = city

    @cached_property
    def _solids(self) -> tuple[Terrain, tuple[Block, ...]] | None:
        """The terrain, and each land as a block from below; None without a city."""
        city = self._city()
        if city is None:
            return None
        deep = (0.0, 0.0, -math.inf)
        lands = (Block("ground", BoundedPolygon.of(land.polygon), deep, (0.0, 0.0, land.top_m)) for land in city.lands)
        return Terrain(city), tuple(lands)

    def is_free(self, first: Vector, second: Vector) -> bool | None:
        """True if nothing of the city stands between two points (east, north, elevation in metres). None if the city
        is not known."""
        if self._solids is None:
            return None
        terrain, lands = self._solids
        near = (*lands, *_along(terrain, first, second))
        return not any(_cuts(block, first, second) for block in near)


def _along(terrain: Terrain, first: Vector, second: Vector) -> Iterator[Block]:
    """The blocks near a line, each once.

    The steps are at most `REACH_M` long, and the terrain lists for a point all blocks within `REACH_M` of its cell, so
    that no block is skipped.
    """
    steps = max(1, math.ceil(math.dist(first[:2], second[:2]) / REACH_M))
    fall = abs(second[2] - first[2]) / steps
    reached: set[int] = set()
    for step in range(steps + 1):
        x, y, z = _at(first, second, step / steps)
        if z - fall > terrain.ceiling_m(x, y):
            continue
        for block in terrain.blocks_near(x, y):
            if id(block) not in reached:
                reached.add(id(block))
                yield block


def _at(first: Vector, second: Vector, share: float) -> Vector:
    x, y, z = (a + share * (b - a) for a, b in zip(first, second, strict=True))
    return x, y, z


def _cuts(block: Block, first: Vector, second: Vector) -> bool:
    """True if a part of the line is inside the block. The planes are level or inclined, so that the line is above or
    below them throughout a part if it is at both ends of it."""
    area = block.area
    if max(first[0], second[0]) < area.west or min(first[0], second[0]) > area.east:
        return False
    if max(first[1], second[1]) < area.south or min(first[1], second[1]) > area.north:
        return False
    outlines = (area.polygon, *block.holes)
    shares = sorted({0.0, 1.0, *(share for outline in outlines for share in _crossings(outline, first, second))})
    for begin, end in pairwise(shares):
        x, y, _ = _at(first, second, (begin + end) / 2.0)
        if block.covers(x, y) and _is_between(block, _at(first, second, begin), _at(first, second, end)):
            return True
    return False


def _is_between(block: Block, begin: Vector, end: Vector) -> bool:
    above = all(z >= block.top_at(x, y) - _TOUCH_M for x, y, z in (begin, end))
    below = all(z <= block.base_at(x, y) + _TOUCH_M for x, y, z in (begin, end))
    return not above and not below


def _crossings(outline: Polygon, first: Vector, second: Vector) -> Iterator[float]:
    """The shares of the line, 0..1, at which it crosses an outline in plan."""
    east, north = second[0] - first[0], second[1] - first[1]
    corners: Sequence[tuple[float, float]] = outline
    ax, ay = corners[-1]
    for bx, by in corners:
        across, up = bx - ax, by - ay
        turn = east * up - north * across
        if turn != 0.0:
            share = ((ax - first[0]) * up - (ay - first[1]) * across) / turn
            along = ((ax - first[0]) * north - (ay - first[1]) * east) / turn
            if 0.0 < share < 1.0 and 0.0 <= along <= 1.0:
                yield share
        ax, ay = bx, by
