"""Triangle meshes from primitives: (n, 10) float32 rows of position, normal, colour and gloss; three rows a triangle.
A negative gloss is the strength of the surface's own light.

Model frame: x to the right, y ahead (along the heading), z up; metres. Colours are linear RGB, 0..1. Gloss, 0..1, is
the strength of the sun's reflection. All meshes are built once from numbers in this package, without files.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from lingjing.mission.appearance import LEAST_M, LinearRgb
from lingjing.mission.instance import Vector

Mesh = npt.NDArray[np.float32]

STRIDE = 10
"""Floats of a row."""


def merge(*meshes: Mesh) -> Mesh:
    """Return one mesh of several."""
    return np.concatenate(meshes) if meshes else np.zeros((0, STRIDE), np.float32)


def flat(points: npt.ArrayLike, colour: LinearRgb, gloss: float = 0.0) -> Mesh:
    """Return triangles (n, 3, 3) with face normals, without those of zero area."""
    corners = np.asarray(points, np.float64).reshape(-1, 3, 3)
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(normal, axis=1)
    some = length > 1e-9
    normal = normal[some] / length[some, None]
    return _rows(corners[some].reshape(-1, 3), np.repeat(normal, 3, axis=0), colour, gloss)


def box(centre: Vector, size: Vector, colour: LinearRgb, gloss: float = 0.0) -> Mesh:
    """Return an axis-aligned box with full edge lengths `size`."""
    x, y, z = (s / 2.0 for s in size)
    ring = np.array([(-x, -y), (x, -y), (x, y), (-x, y)])
    return move(prism(ring, -z, z, colour, gloss), centre)


def prism(ring: npt.ArrayLike, base: float, top: float, colour: LinearRgb, gloss: float = 0.0) -> Mesh:
    """Return a prism over a convex anticlockwise ring (n, 2)."""
    outline = np.asarray(ring, np.float64)
    following = np.roll(outline, -1, axis=0)
    low, high = np.full((len(outline), 1), base), np.full((len(outline), 1), top)
    a, b = np.hstack([outline, low]), np.hstack([following, low])
    c, d = np.hstack([following, high]), np.hstack([outline, high])
    walls = np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])
    fan = [(d[0], d[k], d[k + 1]) for k in range(1, len(d) - 1)]
    floor = [(a[0], a[k + 1], a[k]) for k in range(1, len(a) - 1)]
    return flat(np.concatenate([walls, np.array(fan), np.array(floor)]), colour, gloss)


def cylinder(
    base: Vector, top: Vector, radii: tuple[float, float], colour: LinearRgb, gloss: float = 0.0, sides: int = 10
) -> Mesh:
    """Return a closed cone frustum between two points."""
    start, end = np.array(base, float), np.array(top, float)
    axis = (end - start) / max(float(np.linalg.norm(end - start)), 1e-9)
    across = np.cross(axis, (1.0, 0.0, 0.0) if abs(axis[0]) < 0.9 else (0.0, 1.0, 0.0))
    across /= np.linalg.norm(across)
    angle = np.linspace(0.0, 2.0 * np.pi, sides, endpoint=False)
    spokes = np.cos(angle)[:, None] * across + np.sin(angle)[:, None] * np.cross(axis, across)
    low, high = start + radii[0] * spokes, end + radii[1] * spokes
    low2, high2, spokes2 = (np.roll(part, -1, axis=0) for part in (low, high, spokes))
    points = np.concatenate([np.stack([low, low2, high2], 1), np.stack([low, high2, high], 1)]).reshape(-1, 3)
    normals = np.concatenate([np.stack([spokes, spokes2, spokes2], 1), np.stack([spokes, spokes2, spokes], 1)])
    caps = [(end, high[k], high2[k]) for k in range(sides)] + [(start, low2[k], low[k]) for k in range(sides)]
    return merge(_rows(points, normals.reshape(-1, 3), colour, gloss), flat(np.array(caps), colour, gloss))


def ellipsoid(
    centre: Vector, radii: Vector, colour: LinearRgb, gloss: float = 0.0, rows: int = 6, sides: int = 10
) -> Mesh:
    """Return an ellipsoid with smooth normals."""
    polar = np.linspace(0.0, np.pi, rows + 1)
    around = np.linspace(0.0, 2.0 * np.pi, sides + 1)
    grid = np.stack(
        [
            np.sin(polar)[:, None] * np.cos(around),
            np.sin(polar)[:, None] * np.sin(around),
            np.repeat(np.cos(polar)[:, None], sides + 1, axis=1),
        ],
        axis=-1,
    )
    a, b, c, d = grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]
    unit = np.concatenate([np.stack([a, b, c], 2), np.stack([a, c, d], 2)]).reshape(-1, 3)
    normals = unit / np.array(radii)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return _rows(unit * np.array(radii) + np.array(centre), normals, colour, gloss)


@cache
def solid(shape: str, length: float, width: float, height: float, colour: LinearRgb) -> Mesh:
    """Return a box, cylinder, sphere or cone (upright) about the origin.

    It fills a box of `length` ahead by `width` to the right by `height` up. Measures below `LEAST_M`, which a parameter
    may give, are drawn as that.
    """
    length, width, height = (max(measure, LEAST_M) for measure in (length, width, height))
    half = np.array([width, length, height]) / 2.0
    if shape == "box":
        return box((0.0, 0.0, 0.0), (width, length, height), colour)
    if shape == "sphere":
        return ellipsoid((0.0, 0.0, 0.0), vector_of(half), colour, rows=12, sides=24)
    top = 0.0 if shape == "cone" else 1.0
    mesh = cylinder((0.0, 0.0, -1.0), (0.0, 0.0, 1.0), (1.0, top), colour, sides=24)
    mesh[:, :3] *= half.astype(np.float32)
    mesh[:, 3:6] /= half.astype(np.float32)
    mesh[:, 3:6] /= np.linalg.norm(mesh[:, 3:6], axis=1, keepdims=True)
    return mesh


def main_colour(mesh: Mesh) -> LinearRgb:
    """Return the colour that covers most of a mesh's surface."""
    corners = mesh[:, :3].astype(np.float64).reshape(-1, 3, 3)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    colours, which = np.unique(mesh[::3, 6:9], axis=0, return_inverse=True)
    return vector_of(colours[np.bincount(which.ravel(), weights=area).argmax()])


def recoloured(mesh: Mesh, old: LinearRgb, new: LinearRgb) -> Mesh:
    """Return the mesh with one of its colours replaced."""
    made = mesh.copy()
    made[(mesh[:, 6:9] == np.array(old, np.float32)).all(axis=1), 6:9] = new
    return made


@dataclass(frozen=True, slots=True, eq=False)
class SameMesh:
    """Levels of a mesh as an argument of a cached function. All are equal, because a name argument identifies them."""

    levels: tuple[Mesh, ...]

    def __eq__(self, other: object) -> bool:
        return isinstance(other, SameMesh)

    def __hash__(self) -> int:
        return 0


def torus(centre: Vector, radius: float, tube: float, colours: Sequence[LinearRgb], sides: int = 16) -> Mesh:
    """Return a horizontal ring of segments that have the colours in turn."""
    parts = []
    angle = np.linspace(0.0, 2.0 * np.pi, sides + 1)
    spine = np.stack([radius * np.cos(angle), radius * np.sin(angle), np.zeros(sides + 1)], 1) + np.array(centre)
    for k in range(sides):
        start, end = vector_of(spine[k]), vector_of(spine[k + 1])
        parts.append(cylinder(start, end, (tube, tube), colours[k * len(colours) // sides], 0.2, sides=8))
    return merge(*parts)


def loft(sections: Sequence[tuple[float, npt.ArrayLike]], colour: LinearRgb, gloss: float = 0.0) -> Mesh:
    """Return a skin through open cross-sections, from stern to bow.

    A section is (y, points (m, 2) of x and z from left to right).
    """
    rings = [np.insert(np.asarray(ring, np.float64), 1, y, axis=1) for y, ring in sections]
    faces = []
    for near, far in pairwise(rings):
        for k in range(len(near) - 1):
            faces.append((near[k], near[k + 1], far[k + 1]))
            faces.append((near[k], far[k + 1], far[k]))
    return flat(np.array(faces), colour, gloss)


def indexed(mesh: Mesh) -> tuple[Mesh, npt.NDArray[np.uint32]]:
    """Return (vertices without duplicates, three indices a triangle), without triangles of zero area."""
    corners = mesh[:, :3].astype(np.float64).reshape(-1, 3, 3)
    doubled = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    vertices, index = np.unique(mesh[np.repeat(doubled > 1e-9, 3)], axis=0, return_inverse=True)
    return vertices, index.ravel().astype(np.uint32)


def move(mesh: Mesh, offset: Vector) -> Mesh:
    """Return the mesh shifted by metres."""
    moved = mesh.copy()
    moved[:, :3] += np.array(offset, np.float32)
    return moved


def two_sided(mesh: Mesh) -> Mesh:
    """Return the mesh with its back faces as well."""
    back = mesh.reshape(-1, 3, STRIDE)[:, ::-1].reshape(-1, STRIDE).copy()
    back[:, 3:6] *= -1.0
    return merge(mesh, back)


def _rows(points: npt.NDArray[np.float64], normals: npt.NDArray[np.float64], colour: LinearRgb, gloss: float) -> Mesh:
    paint = np.tile(np.array([*colour, gloss]), (len(points), 1))
    return np.hstack([points, normals, paint]).astype(np.float32)


def vector_of(values: npt.NDArray[np.floating]) -> Vector:
    """Return three numbers of an array as plain floats."""
    return float(values[0]), float(values[1]), float(values[2])
