"""Places along lines: the nearest point of a lane, a deck or a pipe, and points at a given length."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import atan2, degrees, hypot, inf
from typing import Generic, TypeVar

from lingjing.mission.geometry2d import Vector2
from lingjing.mission.instance import Vector

P = TypeVar("P", Vector2, Vector)


@dataclass(frozen=True, slots=True)
class LinePlace(Generic[P]):
    """The point of a line that is nearest to a place in plan: `share` of the way from corner `start` to corner `end`.

    Metres in plan: how far the place lies `off_m`, how far along the line the point is (`at_m`), the line's length.
    """

    off_m: float
    at_m: float
    start: P
    end: P
    share: float
    length_m: float

    @property
    def point(self) -> Vector2:
        """The point in plan."""
        (ax, ay, *_), (bx, by, *_) = self.start, self.end
        return ax + self.share * (bx - ax), ay + self.share * (by - ay)

    @property
    def heading_deg(self) -> float:
        """The compass heading of the line there."""
        return heading_deg(self.start, self.end)


def project(line: Sequence[P], x: float, y: float) -> LinePlace[P]:
    """The point of a line of one corner or more that is nearest to a place; of several the first."""
    start, end, share = line[0], line[0], 0.0
    off, at, passed = inf, 0.0, 0.0
    for a, b in pairwise(line):
        east, north = b[0] - a[0], b[1] - a[1]
        span = hypot(east, north)
        if span == 0.0:
            continue
        part = min(1.0, max(0.0, ((x - a[0]) * east + (y - a[1]) * north) / (span * span)))
        away = hypot(x - (a[0] + part * east), y - (a[1] + part * north))
        if away < off:
            off, at, start, end, share = away, passed + part * span, a, b, part
        passed += span
    if off == inf:
        off = hypot(x - start[0], y - start[1])
    return LinePlace(off, at, start, end, share, passed)


def heading_deg(start: Sequence[float], end: Sequence[float]) -> float:
    """The compass heading from one point to another, in degrees from 0 to below 360."""
    return degrees(atan2(end[0] - start[0], end[1] - start[1])) % 360.0 % 360.0


def line_length(line: Iterable[Vector]) -> float:
    """Metres along a line, in plan."""
    return sum(hypot(bx - ax, by - ay) for (ax, ay, _), (bx, by, _) in pairwise(line))


def point_at(line: Sequence[Vector], at: float) -> tuple[Vector, float]:
    """The point so far along a line, within its ends, and the compass heading of the line there in degrees."""
    passed = 0.0
    found: tuple[Vector, float] | None = None
    for (ax, ay, az), (bx, by, bz) in pairwise(line):
        span = hypot(bx - ax, by - ay)
        if span == 0.0:
            continue
        share = min(1.0, max(0.0, (at - passed) / span))
        point = ax + share * (bx - ax), ay + share * (by - ay), az + share * (bz - az)
        found = point, heading_deg((ax, ay), (bx, by))
        if at <= passed + span:
            return found
        passed += span
    return found or (line[0], 0.0)
