"""The city of an episode as flat shapes with heights, as input for the view of the page."""

from __future__ import annotations

from collections.abc import Iterable

import msgspec

from lingjing.mission.geometry2d import Extent, Vector2
from lingjing.scene.city import City
from lingjing.scene.plan import PlanShape, is_sea
from lingjing.scene.surroundings import shapes_around, triangulate

MOST_POINTS = 300_000
"""Most vertices of all shapes. Beyond it, layers are left out. Chosen."""

STEP_PER_M = 10
"""Units of integer coordinates per metre: coordinates are decimetres."""


class GroundShape(msgspec.Struct, frozen=True, omit_defaults=True):
    """One shape: a polygon, a line or a dot. Lengths and coordinates are decimetres."""

    layer: str
    rings: list[list[int]]
    """Flat lists x, y, x, y, … A polygon has its outline first, then its holes. A line or a dot has one ring."""
    surface: str = ""
    triangles: list[int] = []
    """Indices of the vertices of all rings, three per triangle. Empty for a line or a dot."""
    width: int = 0
    """Width of a line or a dot. 0 for a polygon."""
    base: int = 0
    """Elevation of the bottom of a polygon."""
    top: int = 0
    """Elevation of the top of a polygon."""
    heights: list[int] = []
    """Elevations of the points of a line or a dot."""


class PageGround(msgspec.Struct, frozen=True):
    """The ground of a page."""

    known: bool
    """False if the city cannot be rebuilt and nothing can be drawn."""
    sea: bool = False
    """True if water is under all shapes."""
    shapes: list[GroundShape] = []
    """The shapes in the order of painting."""
    lacks: list[str] = []
    """Layers that were left out because the city is too large."""


def ground_of(city: City | None, played: Extent) -> PageGround:
    """Return the ground in and around the extent of an episode (west, south, east, north; metres)."""
    if city is None:
        return PageGround(known=False)
    shapes, lacks = shapes_around(city, played, MOST_POINTS)
    return PageGround(
        known=True,
        sea=is_sea(shapes),
        shapes=[ground_shape for shape in shapes if (ground_shape := _shape(shape))],
        lacks=[*lacks],
    )


def _shape(shape: PlanShape) -> GroundShape | None:
    """Return a shape of the plan for the page, or None for a polygon without an area."""
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
