"""Which walls are drawn, and in which order: those that face the eye; what the sun reaches first, each near to far.

What faces away would be culled only after its corners had been moved, half of the work on distant blocks. A wall turned
away from the sun needs no look into the shadow map, and a wall behind another that is drawn already costs next to
nothing. Pure functions of the walls, the eye and the sun.
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
"""A triangle whose plane passes the eye as closely as this is left to the rasteriser to judge."""


@dataclass(frozen=True, slots=True)
class Planes:
    """Triangles (n, 3) of a part as indices of its vertices, and their planes (n, 4): outward unit normal, and what is
    added to its product with a point for the point's height over the plane, metres."""

    triangles: VertexIndex
    planes: CornerArray

    def facing(self, eye: tuple[float, float, float]) -> npt.NDArray[np.bool_]:
        """Which triangles (n,) an eye may see the front of."""
        return np.asarray(self.planes @ (*eye, 1.0) > -EDGE_ON_M)

    def among(self, ranges: Ranges, eye: tuple[float, float, float]) -> VertexIndex:
        """The indices, in order, of those triangles in ranges (first index, count) that face an eye."""
        some = np.concatenate([np.arange(first // 3, (first + count) // 3) for first, count in ranges])
        seen: VertexIndex = self.triangles[some[self.planes[some] @ (*eye, 1.0) > -EDGE_ON_M]]
        return seen.ravel()


@dataclass(frozen=True, slots=True)
class Walls:
    """Triangles of a part with their planes, corners (n, 3, 3), metres, and shaded normals (n, 3)."""

    planes: Planes
    corners: CornerArray
    normals: CornerArray

    def ordered(self, eye: tuple[float, float, float], sun: tuple[float, float, float]) -> tuple[VertexIndex, int, int]:
        """(all indices, in drawing order what faces the eye and then the rest; how many are of walls that face both the
        eye and the sun; how many face the eye). Shadows are thrown by all of them."""
        facing = self.planes.facing(eye)
        away = self.normals @ np.asarray(sun, np.float32) <= 0.0
        offset = self.corners - np.asarray(eye, np.float32)
        nearest = np.einsum("ijk,ijk->ij", offset, offset).min(axis=1)
        order = np.lexsort((nearest, away, ~facing))
        return self.planes.triangles[order].ravel(), 3 * int((facing & ~away).sum()), 3 * int(facing.sum())


def planes_of(part: MeshPart) -> Planes:
    """The triangles of a part and their planes, turned to the side that their normals are shaded for."""
    triangles = part.index.reshape(-1, 3)
    corners = part.vertices["position"][triangles].astype(np.float64)
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    outward = np.einsum("ij,ij->i", across, part.vertices["normal"][triangles[:, 0]]) >= 0.0
    across *= np.where(outward, 1.0, -1.0)[:, None]
    across /= np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-12)
    planes = np.column_stack([across, -np.einsum("ij,ij->i", across, corners[:, 0])])
    return Planes(triangles, planes.astype(np.float32))


def walls_of(part: MeshPart) -> Walls:
    """The walls of a part."""
    planes = planes_of(part)
    triangles = planes.triangles
    return Walls(planes, part.vertices["position"][triangles], part.vertices["normal"][triangles[:, 0]])


__all__ = ["Planes", "Walls", "planes_of", "walls_of"]
