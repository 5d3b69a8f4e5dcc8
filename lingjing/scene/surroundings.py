"""The city around a mission, for viewers: its shapes on the plan, and meshes in space.

Flat shapes are raised a little by their layer. Otherwise they would flicker with the surface below (z-fighting).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import get_args

import mapbox_earcut
import numpy as np

from lingjing.mission.geometry2d import Extent, Vector2, bounds
from lingjing.mission.instance import Instance, Vector
from lingjing.scene.camera_geometry import mounted_camera_pose
from lingjing.scene.city import City, Pieces
from lingjing.scene.plan import PLAN, Layer, PlanShape, ground_plan
from lingjing.trace.surroundings import CityMesh, Surroundings

EXPENDABLE: tuple[Layer, ...] = ("tree", "pipe", "path", "slab", "area")
"""The layers that are dropped from a city that is too large, first to last."""

MESHED: tuple[Layer, ...] = ("water", "land", "area", "slab", "path", "road", "solid", "bridge", "building", "pipe")
"""The layers that become meshes. Trees are left out, because they are many and show little."""

MOST_POINTS = 60_000
"""Most corners on the plan that a trace stores of a city. Above it, layers of `EXPENDABLE` are dropped (chosen)."""

AROUND = 0.6
"""Margin around the mission's area in which the city is shown, as a share of that area's longer side (chosen)."""

AROUND_M = 250.0
"""Least margin, metres (chosen)."""

LIFT_M = 0.04
"""Distance between layers, metres (chosen)."""

KEPT = 8
"""Number of cities with meshes in the cache, which later episodes of this process and of its forks use (chosen)."""

OVERHEAD_M = 20_000.0
"""Elevation above which an entity (a satellite) does not enlarge the shown area, metres."""

_WALL = 0.82
"""Brightness of a wall relative to its roof (chosen)."""

_LAYERS: tuple[Layer, ...] = get_args(Layer)


def surroundings(city: City, instance: Instance) -> Surroundings:
    """The surroundings that a trace of this instance stores beside its records."""
    spots: list[Vector2] = [(e.position[0], e.position[1]) for e in instance.entities if e.position[2] < OVERHEAD_M]
    spots += [corner for region in instance.regions for corner in region.polygon]
    return Surroundings(_meshes_around(city, bounds(spots or [(0.0, 0.0)])), mounted_camera_pose)


def shapes_around(city: City, played: Extent, most: int) -> tuple[tuple[PlanShape, ...], list[Layer]]:
    """The shapes in and around an area (west, south, east, north; metres), and the layers dropped to keep `most`
    corners.

    Raises `UsageError` if the city's folder no longer exists.
    """
    shapes = ground_plan(city, _within(_grown(played), city.bounds))
    lacks: list[Layer] = []
    for layer in EXPENDABLE:
        if sum(len(shape.points) for shape in shapes) <= most:
            break
        shapes = tuple(shape for shape in shapes if shape.layer != layer)
        lacks.append(layer)
    return shapes, lacks


def triangulate(rings: Sequence[Sequence[Vector2]]) -> list[int]:
    """Triangulate a polygon with holes: indices into the corners of all rings, outline first, three a triangle."""
    corners = np.asarray([point for ring in rings for point in ring], np.float64)
    ends = np.cumsum([len(ring) for ring in rings]).astype(np.uint32)
    indices: list[int] = mapbox_earcut.triangulate_float64(corners, ends).tolist()
    return indices


def city_meshes(shapes: Iterable[PlanShape]) -> tuple[CityMesh, ...]:
    """The shapes as meshes in space, in painting order; shapes of one layer and colour share a mesh."""
    drafts: dict[tuple[Layer, tuple[float, float, float]], _Draft] = {}
    for shape in shapes:
        colour = _rgb(PLAN.colour(shape)) if shape.layer in MESHED else None
        if colour is None or len(shape.points) < 2:
            continue
        top = drafts.setdefault((shape.layer, colour), _Draft())
        if shape.width_m > 0.0:
            top.ribbon(shape, _lift(shape.layer))
            continue
        rings = [shape.points, *(hole for hole in shape.holes if len(hole) >= 3)]
        stands = shape.layer in ("building", "solid")
        top.lid(rings, shape.top_m + (0.0 if stands else _lift(shape.layer)))
        if stands:
            darker = (_WALL * colour[0], _WALL * colour[1], _WALL * colour[2])
            wall = drafts.setdefault((shape.layer, darker), _Draft())
            for ring in rings:
                wall.walls(ring, shape.base_m, shape.top_m)
    return tuple(
        CityMesh(layer, np.array(draft.points), np.array(draft.triangles, np.uint32).reshape(-1, 3), colour)
        for (layer, colour), draft in drafts.items()
        if draft.triangles
    )


# -- private

_Standing = tuple[tuple[int, ...], tuple[Vector, ...]]

_known: dict[tuple[_Standing, Extent], tuple[City, tuple[CityMesh, ...]]] = {}


def _meshes_around(city: City, played: Extent) -> tuple[CityMesh, ...]:
    """Return `city_meshes` of the shapes in and around an area, cached for the latest cities.

    Cities that differ only in floating objects share an entry, because a plan shows only trees of all props.
    """
    key = _standing(city), _within(_grown(played), city.bounds)
    if key not in _known:
        shapes, _ = shapes_around(city, played, MOST_POINTS)
        _known[key] = city, city_meshes(shapes)  # the city is held so that no new object gets the ids of its pieces
        while len(_known) > KEPT:
            del _known[next(iter(_known))]
    return _known[key][1]


def _standing(city: City) -> _Standing:
    """Key of a city's plan: the identities of its pieces and the places of its trees."""
    if city.store:
        return (id(city),), ()
    pieces = tuple(id(getattr(city, name)) for name in Pieces.__struct_fields__ if name != "props")
    return pieces, tuple(prop.position for prop in city.props if prop.cls == "tree")


@dataclass(slots=True)
class _Draft:
    """A mesh under construction."""

    points: list[tuple[float, float, float]] = field(default_factory=list)
    triangles: list[int] = field(default_factory=list)

    def lid(self, rings: Sequence[Sequence[Vector2]], level: float) -> None:
        """Add a polygon with holes at an elevation."""
        if len(rings[0]) < 3:
            return
        first = len(self.points)
        self.triangles += [first + index for index in triangulate(rings)]
        self.points += [(x, y, level) for ring in rings for x, y in ring]

    def walls(self, ring: Sequence[Vector2], base: float, top: float) -> None:
        """Add a quadrangle below each edge of a ring. Outlines are anticlockwise, holes clockwise."""
        first, count = len(self.points), 2 * len(ring)
        for x, y in ring:
            self.points += ((x, y, base), (x, y, top))
        for at in range(0, count, 2):
            a, b = first + at, first + (at + 2) % count
            self.triangles += (a, b, b + 1, a, b + 1, a + 1)

    def ribbon(self, shape: PlanShape, lift: float) -> None:
        """Add a line as a strip of its width, mitred at its bends."""
        first, half = len(self.points), shape.width_m / 2.0
        sides = _sides(shape.points)
        heights = shape.heights_m or (shape.top_m,) * len(shape.points)
        for (x, y), (left_x, left_y), z in zip(shape.points, sides, heights, strict=True):
            across_x, across_y = left_x * half, left_y * half
            self.points += ((x - across_x, y - across_y, z + lift), (x + across_x, y + across_y, z + lift))
        for a in range(first, len(self.points) - 2, 2):
            self.triangles += (a, a + 2, a + 3, a, a + 3, a + 1)


def _sides(points: Sequence[Vector2]) -> list[Vector2]:
    """Offset vectors to the left of a line at each point, for edges at distance 1. Mitres are at most 2 long."""
    lefts: list[Vector2] = []
    for (x0, y0), (x1, y1) in pairwise(points):
        length = math.hypot(x1 - x0, y1 - y0)
        lefts.append(((y0 - y1) / length, (x1 - x0) / length) if length > 0.0 else (lefts[-1] if lefts else (0.0, 1.0)))
    sides = [lefts[0]]
    for (ax, ay), (bx, by) in pairwise(lefts):
        x, y = ax + bx, ay + by
        scale = 2.0 / max(x * x + y * y, 1.0)
        sides.append((x * scale, y * scale))
    return [*sides, lefts[-1]]


def _lift(layer: Layer) -> float:
    return LIFT_M * _LAYERS.index(layer)


def _rgb(colour: str | tuple[float, float, float] | None) -> tuple[float, float, float] | None:
    """Components in 0..1 in steps of 1/50, so that buildings of about one height share a mesh."""
    if colour is None:
        return None
    parts = colour if isinstance(colour, tuple) else tuple(int(colour[at : at + 2], 16) / 255 for at in (1, 3, 5))
    return round(parts[0] * 50) / 50, round(parts[1] * 50) / 50, round(parts[2] * 50) / 50


def _grown(played: Extent) -> Extent:
    west, south, east, north = played
    margin = max(AROUND_M, AROUND * max(east - west, north - south))
    return west - margin, south - margin, east + margin, north + margin


def _within(box: Extent, bounds: Extent) -> Extent:
    """The part of a box within bounds; the bounds if the two are disjoint."""
    west, south, east, north = (
        max(box[0], bounds[0]),
        max(box[1], bounds[1]),
        min(box[2], bounds[2]),
        min(box[3], bounds[3]),
    )
    return (west, south, east, north) if west < east and south < north else bounds
