"""Places along lines: the nearest point of a lane, a deck or a pipe, and points at a given length."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from math import atan2, degrees, hypot

from lingjing.mission.geometry2d import Vector2
from lingjing.mission.instance import Vector


def length(line: Sequence[Vector]) -> float:
    """Metres along a line, in plan."""
    return sum(hypot(bx - ax, by - ay) for (ax, ay, _), (bx, by, _) in pairwise(line))


def distance_to(line: Sequence[Vector2], x: float, y: float) -> float:
    """Metres in plan from a place to a line of points in plan."""
    found = float("inf")
    for (ax, ay), (bx, by) in pairwise(line):
        length2 = (bx - ax) ** 2 + (by - ay) ** 2 or 1.0
        share = min(1.0, max(0.0, ((x - ax) * (bx - ax) + (y - ay) * (by - ay)) / length2))
        found = min(found, hypot(x - ax - share * (bx - ax), y - ay - share * (by - ay)))
    return found


def nearest(line: Sequence[Vector], x: float, y: float) -> tuple[float, float]:
    """Distance in plan from a place to a line, and how far along the line its nearest point lies."""
    best, at, passed = float("inf"), 0.0, 0.0
    for (ax, ay, _), (bx, by, _) in pairwise(line):
        span = hypot(bx - ax, by - ay)
        if span > 0.0:
            share = ((x - ax) * (bx - ax) + (y - ay) * (by - ay)) / (span * span)
            share = min(1.0, max(0.0, share))
            distance = hypot(x - ax - share * (bx - ax), y - ay - share * (by - ay))
            if distance < best - 1e-9:
                best, at = distance, passed + share * span
        passed += span
    return best, at


def point_at(line: Sequence[Vector], at: float) -> tuple[Vector, float]:
    """The point so far along a line, within its ends, and the compass heading of the line there in degrees."""
    passed = 0.0
    found: tuple[Vector, float] | None = None
    for (ax, ay, az), (bx, by, bz) in pairwise(line):
        span = hypot(bx - ax, by - ay)
        if span == 0.0:
            continue
        share = min(1.0, max(0.0, (at - passed) / span))
        heading = degrees(atan2(bx - ax, by - ay)) % 360.0
        found = (ax + share * (bx - ax), ay + share * (by - ay), az + share * (bz - az)), heading
        if at <= passed + span:
            return found
        passed += span
    return found or (line[0], 0.0)
