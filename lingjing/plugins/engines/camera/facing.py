"""The order that a tile's walls are drawn in: what the sun reaches first, each near to far.

A wall turned away from the sun needs no look into the shadow map, and a wall behind another that is drawn already costs
next to nothing. Pure functions of the walls, the eye and the sun.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lingjing.plugins.engines.camera.mesh_rows import Index, Part


@dataclass(frozen=True, slots=True)
class Walls:
    """Triangles (n, 3) of a part as indices of its vertices, their corners (n, 3, 3), metres, and normals (n, 3)."""

    triangles: Index
    corners: npt.NDArray[np.float32]
    normals: npt.NDArray[np.float32]

    def ordered(self, eye: tuple[float, float, float], sun: tuple[float, float, float]) -> tuple[Index, int]:
        """(all indices in drawing order, how many of them are of walls that face the sun)."""
        away = self.normals @ np.asarray(sun, np.float32) <= 0.0
        offset = self.corners - np.asarray(eye, np.float32)
        nearest = np.einsum("ijk,ijk->ij", offset, offset).min(axis=1)
        order = np.lexsort((nearest, away))
        return self.triangles[order], 3 * int(len(away) - away.sum())


def walls_of(part: Part) -> Walls:
    """The walls of a part."""
    triangles = part.index.reshape(-1, 3)
    return Walls(triangles, part.vertices["position"][triangles], part.vertices["normal"][triangles[:, 0]])


__all__ = ["Walls", "walls_of"]
