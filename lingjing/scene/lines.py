"""Polylines in plan: the nearest point of a lane, a deck or a pipe to a place, and points at a given length."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import hypot, inf
from typing import Generic, TypeVar

from lingjing.mission.geometry2d import Vector2
from lingjing.mission.instance import Vector
from lingjing.scene.camera_geometry import bearing_deg
from lingjing.sums import total

P = TypeVar("P", Vector2, Vector)


@dataclass(frozen=True, slots=True)
class LinePlace(Generic[P]):
    """The point of a line that is nearest to a place in plan."""

    off_m: float
    """Distance of the place from the line, metres."""
    at_m: float
    """Length of the line from its start to the point, metres."""
    start: P
    """Corner of the line before the point."""
    end: P
    """Corner of the line after the point."""
    share: float
    """Position of the point between the two corners, 0..1."""
    length_m: float
    """Length of the whole line, metres."""

    @property
    def point(self) -> Vector2:
        """The point in plan."""
        (ax, ay, *_), (bx, by, *_) = self.start, self.end
        return ax + self.share * (bx - ax), ay + self.share * (by - ay)

    @property
    def heading_deg(self) -> float:
        """The compass heading of the line there."""
        return bearing_deg(self.start, self.end)


def project(line: Sequence[P], x: float, y: float) -> LinePlace[P]:
    """Return the point of a line that is nearest to a place; the first of several. The line has at least one corner."""
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


def line_length(line: Iterable[Vector]) -> float:
    """Length of a line in plan, metres."""
    return total(hypot(bx - ax, by - ay) for (ax, ay, _), (bx, by, _) in pairwise(line))


def point_at(line: Sequence[Vector], at: float) -> tuple[Vector, float]:
    """Return the point at a length along a line, clamped to its ends, and the compass heading of the line there,
    degrees.

    `at`: metres in plan.
    """
    passed = 0.0
    place: tuple[Vector, float] | None = None
    for a, b in pairwise(line):
        span = hypot(b[0] - a[0], b[1] - a[1])
        if span == 0.0:
            continue
        share = min(1.0, max(0.0, (at - passed) / span))
        place = between(a, b, share), bearing_deg(a, b)
        if at <= passed + span:
            return place
        passed += span
    return place or (line[0], 0.0)


def lengths(line: Sequence[Vector]) -> list[float]:
    """Length in plan from the start of a line to each of its points, metres."""
    passed = [0.0]
    for (ax, ay, _), (bx, by, _) in pairwise(line):
        passed.append(passed[-1] + hypot(bx - ax, by - ay))
    return passed


def section(line: Sequence[Vector], start_m: float, end_m: float) -> tuple[Vector, ...]:
    """Return the part of a line between two lengths, with interpolated end points; empty if they lie outside it."""
    passed = lengths(line)
    start_m, end_m = max(start_m, 0.0), min(end_m, passed[-1])
    if end_m - start_m <= 1e-6:
        return ()
    inner = [point for point, at in zip(line, passed, strict=True) if start_m + 0.01 < at < end_m - 0.01]
    return (_at(line, passed, start_m), *inner, _at(line, passed, end_m))


def between(a: Vector, b: Vector, share: float) -> Vector:
    """The point at a share of the way from one point to another."""
    return a[0] + share * (b[0] - a[0]), a[1] + share * (b[1] - a[1]), a[2] + share * (b[2] - a[2])


def _at(line: Sequence[Vector], passed: Sequence[float], wanted: float) -> Vector:
    """The point at a length; exactly the end points at the ends."""
    if wanted <= 0.0:
        return line[0]
    if wanted >= passed[-1] - 1e-6:
        return line[-1]
    k = next(k for k, at in enumerate(passed) if at >= wanted - 1e-6)
    return between(line[k - 1], line[k], (wanted - passed[k - 1]) / ((passed[k] - passed[k - 1]) or 1.0))
