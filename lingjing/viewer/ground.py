"""The city of an episode as flat shapes with heights: what the page builds its view from."""

from __future__ import annotations

from collections.abc import Iterable

import msgspec

from lingjing.mission.geometry2d import Extent, Vector2
from lingjing.scene.city import City
from lingjing.scene.plan import PlanShape, is_sea
from lingjing.scene.surroundings import shapes_around, triangulate

MOST_POINTS = 300_000
"""Corners of all shapes together that a page gets; beyond that layers are left out."""

STEP_PER_M = 10
"""Coordinates are whole decimetres."""


class GroundShape(msgspec.Struct, frozen=True, omit_defaults=True):
    """One shape, coordinates in decimetres.

    A polygon has `rings` (each a flat list x, y, x, y, …; the first is its outline, the others holes) and `triangles`,
    indices into the corners of all rings. A line or a dot has one ring and a `width`, and `heights` for its points.
    `base` and `top` are elevations.
    """

    layer: str
    rings: list[list[int]]
    surface: str = ""
    triangles: list[int] = []
    width: int = 0
    base: int = 0
    top: int = 0
    heights: list[int] = []


class PageGround(msgspec.Struct, frozen=True):
    """The shapes in painting order. `sea` says that water is under everything; `lacks` names layers left out, because
    the city is too large, `known` is False where the city is no longer to be had and nothing can be drawn."""

    known: bool
    sea: bool = False
    shapes: list[GroundShape] = []
    lacks: list[str] = []


def ground_of(city: City | None, played: Extent) -> PageGround:
    """The ground in and around the extent that was played in (west, south, east, north; metres)."""
    if city is None:
        return PageGround(known=False)
    shapes, lacks = shapes_around(city, played, MOST_POINTS)
    return PageGround(
        known=True, sea=is_sea(shapes), shapes=[made for one in shapes if (made := _shape(one))], lacks=[*lacks]
    )


def _shape(shape: PlanShape) -> GroundShape | None:
    """None for a polygon without an area."""
    heights = [_steps(height) for height in shape.heights_m]
    if shape.width_m > 0.0:
        return GroundShape(
            layer=shape.layer,
            surface=shape.surface,
            rings=[_ring(shape.points)],
            width=max(1, _steps(shape.width_m)),
            heights=heights,
        )
    rings = [shape.points, *(hole for hole in shape.holes if len(hole) >= 3)]
    triangles = triangulate(rings) if len(shape.points) >= 3 else []
    if not triangles:
        return None
    return GroundShape(
        layer=shape.layer,
        surface=shape.surface,
        rings=[_ring(ring) for ring in rings],
        triangles=triangles,
        base=_steps(shape.base_m),
        top=_steps(shape.top_m),
    )


def _ring(points: Iterable[Vector2]) -> list[int]:
    return [_steps(part) for point in points for part in point]


def _steps(metres: float) -> int:
    return round(metres * STEP_PER_M)
