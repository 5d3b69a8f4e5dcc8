"""Cheap meshes that stand in for trees where they are small in the picture, and in the shadow map."""

from __future__ import annotations

from functools import cache

import numpy as np

from lingjing.plugins.engines.camera.instances import Batch
from lingjing.plugins.engines.camera.meshes import Array, cylinder, ellipsoid, merge

PLANTS = ("tree", "pine", "palm", "bush", "hedge")
FULL_PX = 38.0
"""Radius in the picture from which a plant shows all its leaves."""


TINY_PX = 12.0
"""Radius in the picture under which a plant is a bare lump."""


def standin(batch: Batch, tiny: bool = False) -> Array | None:
    """A few triangles (if `tiny`, as few as it takes) in the shape and the colours of a plant; None for what has no
    stand-in."""
    if not batch.key.startswith(PLANTS) or len(batch.mesh) < 240:
        return None
    return _made(batch.key, tiny, _Key(batch.mesh))


class _Key:
    """A mesh as an argument of a cached function: equal to every other, for the name says which it is."""

    def __init__(self, mesh: Array) -> None:
        self.mesh = mesh

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Key)

    def __hash__(self) -> int:
        return 0


@cache
def _made(name: str, tiny: bool, key: _Key) -> Array:
    points, colours = key.mesh[:, :3].astype(np.float64), key.mesh[:, 6:9].astype(np.float64)
    top = points[:, 2].max()
    crown = (colours[:, 1] > 1.15 * colours[:, 0]) if (colours[:, 1] > 1.15 * colours[:, 0]).any() else points[:, 2] > 0
    low, high = points[crown].min(axis=0), points[crown].max(axis=0)
    paint = colours[crown].mean(axis=0)
    colour = float(paint[0]), float(paint[1]), float(paint[2])
    centre, radii = (low + high) / 2.0, (high - low) / 2.0
    if name.startswith("pine"):
        shape = cylinder((0.0, 0.0, float(low[2])), (0.0, 0.0, float(top)), (float(radii[0]), 0.05), colour,
                         sides=4 if tiny else 6)  # fmt: skip
    else:
        size = radii * (0.94, 0.94, 1.0)
        shape = ellipsoid(_point(centre), _point(size), colour, rows=3 if tiny else 4, sides=4 if tiny else 7)
        shape[:, 6:9] *= (0.80 + 0.35 * (shape[:, 2:3] - low[2]) / max(high[2] - low[2], 0.1)).astype(np.float32)
    if tiny:
        return shape
    trunk = cylinder((0.0, 0.0, 0.0), (0.0, 0.0, float(low[2]) + 0.3), (0.18, 0.14), (0.16, 0.11, 0.07), sides=4)
    return merge(shape, trunk)


def _point(values: np.ndarray) -> tuple[float, float, float]:
    return float(values[0]), float(values[1]), float(values[2])
