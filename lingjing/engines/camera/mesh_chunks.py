"""Chunks of a tile's part: consecutive triangles with their bounding box, so that those out of sight are not drawn.

A tile holds tens of thousands of small triangles of roofs, doors, signs and balconies. Those of one building follow
each other, so a chunk is compact. All functions depend only on the part and the pose.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lingjing.engines.camera.culling import boxes_in_sight
from lingjing.engines.camera.mesh_rows import MeshPart
from lingjing.trace.records import CameraPose

CHUNK = 96
"""Triangles of a chunk (chosen)."""

Run = tuple[int, int]
"""First index and count of consecutive indices."""


@dataclass(frozen=True, slots=True)
class Chunks:
    """The chunks of a part."""

    boxes: npt.NDArray[np.float64]
    """Their boxes, (n, 6): west, south, low, east, north, high; metres."""
    total: int
    """Number of indices of the part."""

    def in_sight(self, pose: CameraPose, most: int | None = None) -> list[Run]:
        """Return the runs of indices in sight, in order, among the first `most` or all."""
        end = self.total if most is None else most
        shown = np.flatnonzero(boxes_in_sight(self.boxes[: -(-end // (3 * CHUNK))], pose))
        if not len(shown):
            return []
        breaks = np.flatnonzero(np.diff(shown) > 1)
        firsts, lasts = shown[[0, *(breaks + 1)]], shown[[*breaks, -1]]
        starts, stops = 3 * CHUNK * firsts, np.minimum(3 * CHUNK * (lasts + 1), end)
        return list(zip(starts.tolist(), (stops - starts).tolist(), strict=True))


def chunks_of(part: MeshPart) -> Chunks:
    """Return the chunks of a part with at least one triangle."""
    points = part.vertices["position"][part.index].astype(np.float64)
    starts = np.arange(0, len(points), 3 * CHUNK)
    low, high = np.minimum.reduceat(points, starts), np.maximum.reduceat(points, starts)
    return Chunks(np.column_stack([low, high]), len(part.index))


__all__ = ["CHUNK", "Chunks", "chunks_of"]
