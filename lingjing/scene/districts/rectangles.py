"""`Rect`: an axis-parallel rectangle in metres, from which blocks, lots and most buildings are made."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from lingjing.mission import geometry2d
from lingjing.mission.geometry2d import Polygon


class Rect(NamedTuple):
    """An axis-parallel rectangle; edges in metres."""

    west: float
    south: float
    east: float
    north: float

    @property
    def width(self) -> float:
        """Size from west to east, metres."""
        return self.east - self.west

    @property
    def depth(self) -> float:
        """Size from south to north, metres."""
        return self.north - self.south

    @property
    def centre(self) -> tuple[float, float]:
        """The centre of the rectangle, metres."""
        return (self.west + self.east) / 2.0, (self.south + self.north) / 2.0

    @property
    def polygon(self) -> Polygon:
        """The corners, anticlockwise from the south-west, to the millimetre."""
        w, s, e, n = (round(value, 3) for value in self)
        return (w, s), (e, s), (e, n), (w, n)

    def inset(self, margin: float) -> Rect:
        """Return the rectangle, smaller by `margin` on every side (negative: larger)."""
        return Rect(self.west + margin, self.south + margin, self.east - margin, self.north - margin)

    def chamfered(self, corner: float) -> Polygon:
        """The outline with chamfered corners, `corner` metres along both sides."""
        w, s, e, n, c = (*(round(value, 3) for value in self), corner)
        return (w + c, s), (e - c, s), (e, s + c), (e, n - c), (e - c, n), (w + c, n), (w, n - c), (w, s + c)

    def cells(self, columns: int, rows: int, gap: float) -> Iterator[Rect]:
        """Yield equal parts with a gap between them, row by row from the south-west."""
        width = (self.width - gap * (columns - 1)) / columns
        depth = (self.depth - gap * (rows - 1)) / rows
        for row in range(rows):
            for column in range(columns):
                west, south = self.west + column * (width + gap), self.south + row * (depth + gap)
                yield Rect(west, south, west + width, south + depth)

    def meets(self, other: Rect) -> bool:
        """True if the two overlap."""
        apart = self.west >= other.east or other.west >= self.east
        return not (apart or self.south >= other.north or other.south >= self.north)

    def holds(self, x: float, y: float) -> bool:
        """True if the point lies in the box or on its edge."""
        return self.west <= x <= self.east and self.south <= y <= self.north

    def without(self, other: Rect, least: float) -> tuple[Rect, ...]:
        """The parts outside of `other`: up to four boxes, without those that have a side below `least`."""
        if not self.meets(other):
            return (self,)
        low, high = max(self.south, other.south), min(self.north, other.north)
        parts = (
            Rect(self.west, self.south, self.east, low),
            Rect(self.west, high, self.east, self.north),
            Rect(self.west, low, max(self.west, other.west), high),
            Rect(min(self.east, other.east), low, self.east, high),
        )
        return tuple(part for part in parts if part.width >= least and part.depth >= least)


def around(x: float, y: float, width: float, depth: float) -> Rect:
    """The box of that size about a centre."""
    return Rect(x - width / 2.0, y - depth / 2.0, x + width / 2.0, y + depth / 2.0)


def bounds(points: Polygon) -> Rect:
    """The bounding box."""
    return Rect(*geometry2d.bounds(points))
