"""The line to follow within a long region: the middles of its cross-sections, from the end where one stands."""

from __future__ import annotations

import math

import numpy as np

from lingjing.plugins.policy import Region
from lingjing_agents.ground_plane import GroundPoint


def longest(regions: tuple[Region, ...]) -> Region | None:
    """The region that is longest for its width: what can be followed."""
    return max((region for region in regions if len(region.polygon) >= 3), key=_slenderness, default=None)


def centreline(polygon: tuple[GroundPoint, ...], start: GroundPoint, step_m: float) -> tuple[GroundPoint, ...]:
    """Points some `step_m` apart along the middle of a polygon, the end nearest to `start` first (east, north; m)."""
    points = np.array(polygon)
    middle = points.mean(axis=0)
    axis = np.linalg.svd(points - middle)[2][0]
    across = np.array((-axis[1], axis[0]))
    along = (points - middle) @ axis
    low, high = float(along.min()), float(along.max())
    count = max(2, math.ceil((high - low) / step_m) + 1)
    line: list[GroundPoint] = []
    for station in np.linspace(low + 1e-3 * (high - low), high - 1e-3 * (high - low), count):
        offset = _middle(points, middle + station * axis, axis, across)
        if offset is not None:
            x, y = middle + station * axis + offset * across
            line.append((float(x), float(y)))
    if line and math.dist(line[-1], start) < math.dist(line[0], start):
        line.reverse()
    return tuple(line)


def _middle(points: np.ndarray, origin: np.ndarray, axis: np.ndarray, across: np.ndarray) -> float | None:
    """Where, across the axis, the middle of the polygon's section through `origin` lies; None if it is missed."""
    crossings = []
    for a, b in zip(points, np.roll(points, -1, axis=0), strict=True):
        da, db = float((a - origin) @ axis), float((b - origin) @ axis)
        if (da < 0.0) != (db < 0.0):
            hit = a + (b - a) * (da / (da - db))
            crossings.append(float((hit - origin) @ across))
    return (min(crossings) + max(crossings)) / 2.0 if crossings else None


def _slenderness(region: Region) -> float:
    points = np.array(region.polygon)
    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return float(spread[0] / max(spread[1], 1e-6))
