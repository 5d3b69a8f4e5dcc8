"""Which water has been looked at: sample points over the search cells, marked by the footprints of real pictures."""

from __future__ import annotations

import numpy as np

from lingjing.plugins.policy import Cell
from lingjing_agents.ground_plane import GroundPoint
from lingjing_agents.perception.images import FloatArray, MaskArray

SPACING_M = 12.0


class CoverageMap:
    """Counts how often each sample point of the cells' bounding box has been in a picture."""

    def __init__(self, cells: tuple[Cell, ...]) -> None:
        corners = np.array([corner for cell in cells for corner in cell.polygon] or [(0.0, 0.0)])
        (west, south), (east, north) = corners.min(axis=0), corners.max(axis=0)
        xs = np.arange(west + SPACING_M / 2, east, SPACING_M)
        ys = np.arange(south + SPACING_M / 2, north, SPACING_M)
        self._points: FloatArray = np.stack(np.meshgrid(xs, ys), axis=-1).reshape(-1, 2)
        self._views = np.zeros(len(self._points), np.int64)

    def mark(self, polygon: tuple[GroundPoint, ...]) -> None:
        """Count one look at everything inside a convex polygon, clockwise or anticlockwise (east, north; m)."""
        self._views[self._inside(np.array(polygon))] += 1

    def gain(self, x: float, y: float, size: tuple[float, float], looks: int) -> float:
        """Share (0..1) of a rectangle of `size` (east, north; m) that has been looked at fewer than `looks` times."""
        near = np.abs(self._points - (x, y)) <= np.array(size) / 2
        inside = near[:, 0] & near[:, 1]
        total = int(inside.sum())
        return float((self._views[inside] < looks).sum()) / total if total else 0.0

    def _inside(self, polygon: FloatArray) -> MaskArray:
        edges = np.roll(polygon, -1, axis=0) - polygon
        offsets = self._points[:, None, :] - polygon[None, :, :]
        cross = edges[None, :, 0] * offsets[..., 1] - edges[None, :, 1] * offsets[..., 0]
        inside: MaskArray = np.all(cross >= 0, axis=1) | np.all(cross <= 0, axis=1)
        return inside
