"""The city around what is played in, for viewers: its shapes on the plan, and as meshes in space.

What lies flat is lifted a little by its layer, so that it does not flicker through what it lies on.
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
"""What is left out first of a city that is too large."""

MESHED: tuple[Layer, ...] = ("water", "land", "area", "slab", "path", "road", "solid", "bridge", "building", "pipe")
"""What becomes meshes: all but trees, which are many and say little."""

MOST_POINTS = 60_000
"""Corners on the plan that a trace holds of a city; beyond that the layers of `EXPENDABLE` are left out."""

AROUND = 0.6
"""The city is shown so far beyond what is played in, as a share of its size."""

AROUND_M = 250.0
"""And at least so far, metres."""

LIFT_M = 0.04
"""Each layer lies so much above the one before."""

KEPT = 8
"""Cities whose meshes are kept for later episodes of this process and of those that are forked from it."""

OVERHEAD_M = 20_000.0
"""What is higher stands over no map: a satellite."""

_WALL = 0.82
"""How bright a wall is beside its roof."""

_LAYERS: tuple[Layer, ...] = get_args(Layer)


def surroundings(city: City, instance: Instance) -> Surroundings:
    """What a trace of this instance shows beside its records."""
    spots: list[Vector2] = [(e.position[0], e.position[1]) for e in instance.entities if e.position[2] < OVERHEAD_M]
    spots += [corner for region in instance.regions for corner in region.polygon]
    return Surroundings(_meshes_around(city, bounds(spots or [(0.0, 0.0)])), mounted_camera_pose)


def shapes_around(city: City, played: Extent, most: int) -> tuple[tuple[PlanShape, ...], list[Layer]]:
    """The shapes in and around the extent that is played in (west, south, east, north; metres), and which layers were
    left out to keep to `most` corners. Raises `UsageError` if the city's folder is gone."""
    shapes = ground_plan(city, _within(_grown(played), city.bounds))
    lacks: list[Layer] = []
    for layer in EXPENDABLE:
        if sum(len(shape.points) for shape in shapes) <= most:
            break
        shapes = tuple(shape for shape in shapes if shape.layer != layer)
        lacks.append(layer)
    return shapes, lacks


def triangulated(rings: Sequence[Sequence[Vector2]]) -> list[int]:
    """A polygon with holes as triangles: indices into the corners of all rings, the outline's first."""
    corners = np.asarray([point for ring in rings for point in ring], np.float64)
    ends = np.cumsum([len(ring) for ring in rings]).astype(np.uint32)
    found: list[int] = mapbox_earcut.triangulate_float64(corners, ends).tolist()
    return found


def city_meshes(shapes: Iterable[PlanShape]) -> tuple[CityMesh, ...]:
    """The shapes in space, those of one layer and colour together, in painting order."""
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
    """`city_meshes` of the shapes in and around an extent; those of the latest cities are kept. Cities that differ in
    what floats share them: of all props a plan shows trees alone."""
    key = _standing(city), _within(_grown(played), city.bounds)
    if key not in _known:
        shapes, _ = shapes_around(city, played, MOST_POINTS)
        _known[key] = city, city_meshes(shapes)  # the city with them, so that nothing else gets its pieces' ids
        while len(_known) > KEPT:
            del _known[next(iter(_known))]
    return _known[key][1]


def _standing(city: City) -> _Standing:
    """What of a city is on its plan: its pieces by identity, its trees by their places."""
    if city.store:
        return (id(city),), ()
    pieces = tuple(id(getattr(city, name)) for name in Pieces.__struct_fields__ if name != "props")
    return pieces, tuple(prop.position for prop in city.props if prop.cls == "tree")


@dataclass(slots=True)
class _Draft:
    """A mesh that is being made."""

    points: list[tuple[float, float, float]] = field(default_factory=list)
    triangles: list[int] = field(default_factory=list)

    def lid(self, rings: Sequence[Sequence[Vector2]], level: float) -> None:
        """The polygon at its height."""
        if len(rings[0]) < 3:
            return
        first = len(self.points)
        self.triangles += [first + one for one in triangulated(rings)]
        self.points += [(x, y, level) for ring in rings for x, y in ring]

    def walls(self, ring: Sequence[Vector2], base: float, top: float) -> None:
        """A quadrangle under each edge; rings are anticlockwise, holes clockwise."""
        first, count = len(self.points), 2 * len(ring)
        for x, y in ring:
            self.points += ((x, y, base), (x, y, top))
        for at in range(0, count, 2):
            a, b = first + at, first + (at + 2) % count
            self.triangles += (a, b, b + 1, a, b + 1, a + 1)

    def ribbon(self, shape: PlanShape, lift: float) -> None:
        """A line as wide as it is, mitred at its bends."""
        first, half = len(self.points), shape.width_m / 2.0
        sides = _sides(shape.points)
        heights = shape.heights_m or (shape.top_m,) * len(shape.points)
        for (x, y), (left_x, left_y), z in zip(shape.points, sides, heights, strict=True):
            across_x, across_y = left_x * half, left_y * half
            self.points += ((x - across_x, y - across_y, z + lift), (x + across_x, y + across_y, z + lift))
        for a in range(first, len(self.points) - 2, 2):
            self.triangles += (a, a + 2, a + 3, a, a + 3, a + 1)


def _sides(points: Sequence[Vector2]) -> list[Vector2]:
    """To the left of a line at each of its points, so long that edges one apart stay one apart; at most twice that."""
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
    """Parts in 0..1, in steps of a fiftieth, so that buildings of about one height share a mesh."""
    if colour is None:
        return None
    parts = colour if isinstance(colour, tuple) else tuple(int(colour[at : at + 2], 16) / 255 for at in (1, 3, 5))
    return round(parts[0] * 50) / 50, round(parts[1] * 50) / 50, round(parts[2] * 50) / 50


def _grown(played: Extent) -> Extent:
    west, south, east, north = played
    margin = max(AROUND_M, AROUND * max(east - west, north - south))
    return west - margin, south - margin, east + margin, north + margin


def _within(box: Extent, bounds: Extent) -> Extent:
    """The part of a box within bounds; the bounds where they do not meet."""
    west, south, east, north = (
        max(box[0], bounds[0]),
        max(box[1], bounds[1]),
        min(box[2], bounds[2]),
        min(box[3], bounds[3]),
    )
    return (west, south, east, north) if west < east and south < north else bounds
