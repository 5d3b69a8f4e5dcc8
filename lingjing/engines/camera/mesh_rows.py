"""The format of meshes of a static city: one vertex layout for all materials, in parts that one program draws.

A vertex has a position, a normal and a colour. `at` is its place on the surface, metres along and across: up a wall,
along a lane. `style` holds four numbers with a meaning that depends on the material. `layer` orders coplanar surfaces:
a higher one is in front. `id` is the drawn id. World coordinates, metres, linear colours.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import mapbox_earcut
import numpy as np
import numpy.typing as npt
import shapely

from lingjing.mission.appearance import LinearRgb

VERTEX = np.dtype(
    [
        ("position", "f4", (3,)),
        ("normal", "f4", (3,)),
        ("colour", "f4", (4,)),
        ("at", "f4", (2,)),
        ("style", "f4", (4,)),
        ("layer", "f4"),
        ("id", "u4"),
    ]
)
"""A vertex."""

LAYOUT = (
    ("3f", "in_position"),
    ("3f", "in_normal"),
    ("4f", "in_colour"),
    ("2f", "in_at"),
    ("4f", "in_style"),
    ("1f", "in_layer"),
    ("1u", "in_id"),
)
"""The vertex as attributes of a program: formats and names."""

Vertices = npt.NDArray[np.void]
VertexIndex = npt.NDArray[np.uint32]
Floats = npt.NDArray[np.float64]
Style = tuple[float, float, float, float]

PLAIN: Style = (0.0, 0.0, 0.0, 0.0)
"""Style of a material that needs none."""

KEPT_MESHES = 512
"""Meshes of one kind of pieces in memory (chosen).

A tile that a mission changes is built again, and most of its pieces are unchanged. Cached meshes must not be modified.
"""


@dataclass(frozen=True, slots=True)
class MeshPart:
    """An indexed piece of a mesh."""

    vertices: Vertices
    """Vertices, (n,) of `VERTEX`."""
    index: VertexIndex
    """Indices, three for each triangle."""


def empty() -> MeshPart:
    """Return a part without vertices."""
    return MeshPart(np.zeros(0, VERTEX), np.zeros(0, np.uint32))


def joined(parts: Iterable[MeshPart]) -> MeshPart:
    """Return several parts as one, in order."""
    some = [part for part in parts if len(part.index)]
    if not some:
        return empty()
    starts = np.cumsum([0, *(len(part.vertices) for part in some[:-1])])
    index = [part.index + np.uint32(start) for part, start in zip(some, starts, strict=True)]
    return MeshPart(np.concatenate([part.vertices for part in some]), np.concatenate(index))


def rows(
    position: npt.ArrayLike,
    normal: npt.ArrayLike,
    colour: npt.ArrayLike,
    number: int,
    *,
    gloss: float = 0.0,
    at: npt.ArrayLike = 0.0,
    style: npt.ArrayLike = PLAIN,
    layer: float = 0.0,
) -> Vertices:
    """Return vertices from columns; `position` (n, 3) determines their number."""
    place = np.asarray(position, np.float64)
    out = np.zeros(len(place), VERTEX)
    out["position"], out["normal"], out["at"], out["style"] = place, normal, at, style
    out["colour"][:, :3], out["colour"][:, 3] = colour, gloss
    out["layer"], out["id"] = layer, number
    return out


def quads(count: int) -> VertexIndex:
    """Return the indices of `count` quadrilaterals of four vertices each, in order around."""
    base = 4 * np.arange(count, dtype=np.uint32)[:, None]
    return (base + np.array([0, 1, 2, 0, 2, 3], np.uint32)).ravel()


def triangles(rings: Sequence[npt.ArrayLike]) -> tuple[Floats, VertexIndex]:
    """Return (points (n, 2), indices) of a polygon with holes, in anticlockwise triangles; the first ring is the outer
    one."""
    parts = [np.asarray(ring, np.float64).reshape(-1, 2) for ring in rings]
    points = np.concatenate(parts)
    ends = np.cumsum([len(part) for part in parts]).astype(np.uint32)
    if len(parts[0]) < 3:
        return points, np.zeros(0, np.uint32)
    index = mapbox_earcut.triangulate_float64(points, ends).astype(np.uint32)
    a, b, c = (points[index[k::3]] for k in range(3))
    turn = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    corners = index.reshape(-1, 3)
    corners[turn < 0] = corners[turn < 0][:, ::-1]
    return points, corners.ravel()


def sheet(rings: Sequence[npt.ArrayLike], height: float, colour: LinearRgb, number: int, *, style: Style = PLAIN,
          layer: float = 0.0, gloss: float = 0.0, down: bool = False) -> MeshPart:  # fmt: skip
    """Return a horizontal polygon with holes at a height; `at` is east and north."""
    points, index = triangles(rings)
    place = np.column_stack([points, np.full(len(points), height)])
    normal = (0.0, 0.0, -1.0 if down else 1.0)
    vertices = rows(place, normal, colour, number, at=points, style=style, layer=layer, gloss=gloss)
    return MeshPart(vertices, index[::-1].copy() if down else index)


def walls(ring: npt.ArrayLike, base: float, top: float, colour: LinearRgb, number: int, *, style: Style = PLAIN,
          gloss: float = 0.0, inwards: bool = False) -> MeshPart:  # fmt: skip
    """Return the sides of a prism over an anticlockwise ring; `at` is metres along the outline and above the base."""
    outline = oriented(ring, not inwards)
    following = np.roll(outline, -1, axis=0)
    edge = following - outline
    length = np.linalg.norm(edge, axis=1)
    keep = length > 1e-3
    outline, following, edge, length = outline[keep], following[keep], edge[keep], length[keep]
    count = len(outline)
    if not count:
        return empty()
    normal = np.column_stack([edge[:, 1], -edge[:, 0], np.zeros(count)]) / length[:, None]
    start = np.cumsum(length) - length
    low, high = np.full(count, base), np.full(count, top)
    corners = [(outline, low), (following, low), (following, high), (outline, high)]
    place = np.stack([np.column_stack([p, z]) for p, z in corners], axis=1).reshape(-1, 3)
    up = top - base
    along = [(start, 0.0), (start + length, 0.0), (start + length, up), (start, up)]
    at = np.stack([np.column_stack([u, np.full(count, v)]) for u, v in along], axis=1).reshape(-1, 2)
    vertices = rows(place, np.repeat(normal, 4, axis=0), colour, number, at=at, style=style, gloss=gloss)
    return MeshPart(vertices, quads(count))


def prism(
    ring: npt.ArrayLike, base: float, top: float, colour: LinearRgb, number: int, *, gloss: float = 0.0
) -> MeshPart:
    """Return the sides and the top of a prism over a simple ring."""
    sides = walls(ring, base, top, colour, number, gloss=gloss)
    return joined((sides, sheet([ring], top, colour, number, gloss=gloss)))


def faces(corners: npt.ArrayLike, colour: LinearRgb, number: int, *, gloss: float = 0.0) -> MeshPart:
    """Return triangles (n, 3, 3) with face normals."""
    points = np.asarray(corners, np.float64).reshape(-1, 3, 3)
    normal = np.cross(points[:, 1] - points[:, 0], points[:, 2] - points[:, 0])
    length = np.linalg.norm(normal, axis=1)
    some = length > 1e-9
    flat = np.repeat(normal[some] / length[some, None], 3, axis=0)
    vertices = rows(points[some].reshape(-1, 3), flat, colour, number, gloss=gloss)
    return MeshPart(vertices, np.arange(len(vertices), dtype=np.uint32))


def oriented(ring: npt.ArrayLike, anticlockwise: bool = True) -> Floats:
    """Return a ring (n, 2) in the requested direction, without a repeated end point."""
    points = np.asarray(ring, np.float64).reshape(-1, 2)
    if len(points) > 1 and np.array_equal(points[0], points[-1]):
        points = points[:-1]
    following = np.roll(points, -1, axis=0)
    area = float(np.sum(points[:, 0] * following[:, 1] - following[:, 0] * points[:, 1]))
    return points if (area > 0) == anticlockwise else points[::-1]


def polygons(shape: shapely.Geometry) -> tuple[list[Floats], ...]:
    """Return the rings of every polygon of a shape, the outer one first."""
    return tuple(
        [np.asarray(part.exterior.coords)[:-1, :2], *(np.asarray(hole.coords)[:-1, :2] for hole in part.interiors)]
        for part in shapely.get_parts(shape)
        if isinstance(part, shapely.Polygon) and not part.is_empty
    )
