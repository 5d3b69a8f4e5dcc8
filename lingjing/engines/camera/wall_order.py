"""The order of walls: those that face the eye, first those that the sun reaches, each near to far.

The GPU would cull back faces only after their vertices were transformed, which is half of the work on distant blocks. A
wall turned away from the sun needs no look-up in the shadow map. A wall behind another one costs almost nothing if it
is drawn later. All functions depend only on the walls, the eye and the sun.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lingjing.engines.camera.mesh_rows import MeshPart, VertexIndex

CornerArray = npt.NDArray[np.float32]
Ranges = Sequence[tuple[int, int]]
EDGE_ON_M = 0.02
"""Distance of the eye from a triangle's plane up to which culling is left to the rasteriser, metres (chosen)."""


@dataclass(frozen=True, slots=True)
class Planes:
    """The triangles of a part with their planes."""

    triangles: VertexIndex
    """Indices of vertices, (n, 3)."""
    planes: CornerArray
    """Planes (n, 4): outward unit normal, and the offset that makes its product with (point, 1) the height, metres."""

    def facing(self, eye: tuple[float, float, float]) -> npt.NDArray[np.bool_]:
        """Return which triangles (n,) may show their front to an eye."""
        return np.asarray(self.planes @ (*eye, 1.0) > -EDGE_ON_M)

    def among(self, ranges: Ranges, eye: tuple[float, float, float]) -> VertexIndex:
        """Return the indices, in order, of the triangles in ranges (first index, count) that face an eye."""
        some = np.concatenate([np.arange(first // 3, (first + count) // 3) for first, count in ranges])
        seen: VertexIndex = self.triangles[some[self.planes[some] @ (*eye, 1.0) > -EDGE_ON_M]]
        return seen.ravel()


@dataclass(frozen=True, slots=True)
class Walls:
    """The walls of a part."""

    planes: Planes
    """Triangles and planes."""
    corners: CornerArray
    """Corners, (n, 3, 3) metres."""
    normals: CornerArray
    """Normals of shading, (n, 3)."""

    def ordered(self, eye: tuple[float, float, float], sun: tuple[float, float, float]) -> tuple[VertexIndex, int, int]:
        """Return (indices, lit count, facing count).

        All indices are in drawing order: first the walls that face the eye, then the rest, because all cast shadows.
        The counts are those of indices of walls that face both eye and sun, and of walls that face the eye.
        """
        facing = self.planes.facing(eye)
        away = self.normals @ np.asarray(sun, np.float32) <= 0.0
        offset = self.corners - np.asarray(eye, np.float32)
        nearest = np.einsum("ijk,ijk->ij", offset, offset).min(axis=1)
        order = np.lexsort((nearest, away, ~facing))
        return self.planes.triangles[order].ravel(), 3 * int((facing & ~away).sum()), 3 * int(facing.sum())


def planes_of(part: MeshPart) -> Planes:
    """Return the triangles of a part and their planes, oriented as their normals of shading."""
    triangles = part.index.reshape(-1, 3)
    corners = part.vertices["position"][triangles].astype(np.float64)
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    outward = np.einsum("ij,ij->i", across, part.vertices["normal"][triangles[:, 0]]) >= 0.0
    across *= np.where(outward, 1.0, -1.0)[:, None]
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-12)
    planes = np.column_stack([across, -np.einsum("ij,ij->i", across, corners[:, 0])])
    return Planes(triangles, planes.astype(np.float32))


def walls_of(part: MeshPart) -> Walls:
    """Return the walls of a part."""
    planes = planes_of(part)
    triangles = planes.triangles
    return Walls(planes, part.vertices["position"][triangles], part.vertices["normal"][triangles[:, 0]])


__all__ = ["Planes", "Walls", "planes_of", "walls_of"]
