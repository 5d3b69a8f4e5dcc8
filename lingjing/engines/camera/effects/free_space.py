"""Free space near targets: the direction of a queue, and the distance of a fire from the edge of a roof.

A queue faces a direction in which its people stand neither in a wall, nor in a parked car, nor on a road.
"""

from __future__ import annotations

from collections.abc import Iterable
from itertools import pairwise
from math import cos, hypot, radians, sin

from lingjing.engines.camera.models.catalogue import people_in_line, spacing_in_line
from lingjing.mission.geometry2d import Polygon, area_distance, contains
from lingjing.mission.instance import Entity, Vector
from lingjing.scene.city import Pieces
from lingjing.scene.footing import BODIES_M, HEAD_M, STEP_M
from lingjing.scene.lines import project

ELBOW_M = 0.6
"""Space that a person needs on each side, metres (chosen)."""
SHUNNED_M = {"steam_vent": 1.4}
"""Radius around things that block no way but at which no queue stands, by class, metres (chosen)."""
TURN_DEG = 15.0
"""Step of the headings that are tried, degrees (chosen)."""
TURNS_DEG = tuple(sign * TURN_DEG * k for k in range(13) for sign in (1.0, -1.0))
"""Turns from the queue's declared heading to the opposite one, small ones first, degrees."""

ROOF_MARGIN_M = 4.8
"""Distance from the edge of a roof within which a fire's scorch would reach over it, metres."""

_KEPT_FREE_M = {**BODIES_M, **SHUNNED_M}
"""Radius around things in which no person can stand, by class, metres."""

PlanPoint = tuple[float, float]


def free_heading(entity: Entity, near: Iterable[Pieces]) -> float:
    """Return the heading of a queue, degrees.

    It is the declared one if all people have space behind it, else the nearest heading at which they have. If there is
    none, it is the heading at which most have.
    """
    x, y, _ = entity.position
    count = people_in_line(entity.properties.get("people"))
    spacing_m = spacing_in_line(entity.properties.get("spacing_m"))
    obstacles = _Obstacles(near, (x, y), spacing_m * count + ELBOW_M)

    def room(turn: float) -> int:
        h = radians(entity.heading_deg + turn)
        line = ((x - spacing_m * k * sin(h), y - spacing_m * k * cos(h)) for k in range(1, count + 1))
        return sum(obstacles.free(spot) for spot in line)

    best = max(TURNS_DEG, key=lambda turn: (room(turn), -abs(turn)))
    return (entity.heading_deg + best) % 360.0


def roof_shift(position: Vector, near: Iterable[Pieces]) -> PlanPoint:
    """Return the shift (m, east and north) that moves a place on a roof `ROOF_MARGIN_M` from its edges.

    It is (0, 0) if the roof is too narrow or if there is none.
    """
    x, y, z = position
    roofs = (b.polygon for p in near for b in p.buildings if abs(b.top_m - z) < STEP_M and contains(b.polygon, x, y))
    roof = next(roofs, ())
    east = north = 0.0
    for a, b in pairwise((*roof, *roof[:1])):
        edge = project((a, b), x, y)
        if 0.0 < edge.off_m < ROOF_MARGIN_M:
            share = (ROOF_MARGIN_M - edge.off_m) / edge.off_m
            dx, dy = share * (x - edge.point[0]), share * (y - edge.point[1])
            east, north = max(east, dx, key=abs), max(north, dy, key=abs)
    return (east, north) if roof and contains(roof, x + east, y + north) else (0.0, 0.0)


class _Obstacles:
    """The obstacles near a place in which a person cannot stand."""

    def __init__(self, near: Iterable[Pieces], about: PlanPoint, reach_m: float) -> None:
        self._walls: list[Polygon] = []
        self._round: list[tuple[PlanPoint, float]] = []
        self._strips: list[tuple[tuple[PlanPoint, PlanPoint], float]] = []
        for pieces in near:
            self._walls += [b.polygon for b in pieces.buildings if _touches(b.polygon, about, reach_m)]
            blocks = (s.polygon for s in pieces.solids if s.top_m > STEP_M and s.base_m < HEAD_M)
            self._walls += [block for block in blocks if _touches(block, about, reach_m)]
            self._round += [(prop.position[:2], _KEPT_FREE_M[prop.cls] * prop.scale)
                            for prop in pieces.props if prop.cls in _KEPT_FREE_M]  # fmt: skip
            for lane in (lane for road in pieces.roads for lane in road.lanes if lane.kind != "foot"):
                self._strips += [((a[:2], b[:2]), 0.5 * lane.width_m) for a, b in pairwise(lane.shape)]

    def free(self, spot: PlanPoint) -> bool:
        """Return whether a person can stand at a place."""
        x, y = spot
        return (
            not any(area_distance(wall, x, y) < ELBOW_M for wall in self._walls)
            and all(hypot(px - x, py - y) >= reach + ELBOW_M for (px, py), reach in self._round)
            and all(project(strip, x, y).off_m >= half for strip, half in self._strips)
        )


def _touches(polygon: Polygon, about: PlanPoint, reach_m: float) -> bool:
    """Return whether a polygon's bounds come within reach of a place."""
    return all(
        min(values) <= here + reach_m and max(values) >= here - reach_m
        for values, here in zip(zip(*polygon, strict=True), about, strict=True)
    )


__all__ = ["free_heading", "roof_shift"]
