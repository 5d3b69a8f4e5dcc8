"""Simple meshes for what is small in a picture: for plants, in the shadow map too, and for other distant props."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np

from lingjing.engines.camera.instances import Batch
from lingjing.engines.camera.meshes import Mesh, SameMesh, cylinder, ellipsoid, merge, vector_of

SLIGHT = ("lamp", "bench")
"""Prefixes of the mesh names of thin props."""

PLANTS = ("tree", "pine", "palm", "bush", "hedge", "street_tree", "poplar", "birch", "conifer")
"""Prefixes of the mesh names of plants."""
FULL_PX = 50.0
"""Radius in the picture from which a plant has leaves, pixels (chosen)."""


TINY_PX, TINY_FAR_PX = 12.0, 17.0
"""Radius in the picture below which a plant is a plain shape, pixels; the second one beyond `FAR_M` (chosen)."""
SPECK_PX = 12.0
"""Radius below which the shape has eight faces, pixels, in pictures that show full tiles beyond the least distance."""
SPECK_WIDER = 1.1
"""Factor of size that makes up for the area between the corners of eight faces (chosen)."""


class _Fineness(NamedTuple):
    """The fineness of a plant's simple mesh."""

    rows: int
    """Rows of the crown."""
    sides: int
    """Sides of the crown."""
    size: float
    """Ratio of its size to the plant's."""
    trunk: bool
    """True if it has a trunk."""


SMALL, TINY, SPECK = (
    _Fineness(4, 7, 0.94, True),
    _Fineness(3, 4, 0.94, False),
    _Fineness(2, 4, 0.94 * SPECK_WIDER, False),
)
"""The simple meshes of a plant, finest first (chosen)."""


def reduced(batch: Batch, fineness: _Fineness = SMALL) -> Mesh | None:
    """Return a few triangles with the shape and colours of a plant; None for other or simple meshes."""
    if not plant(batch) or len(batch.mesh) < 240:
        return None
    return _made(batch.key, fineness, SameMesh((batch.mesh,)))


FAR_M, FAR_PX = 250.0, 9.0
"""Distance (m) from which props below a radius (pixels) are `coarsened` (chosen)."""
LUMP_PX = 5.0
"""Radius below which props are coarsened further, pixels, in pictures that show full tiles beyond the least
distance."""
COARSE_FROM, COARSE_CELLS, LUMP_CELLS = 240, 3.5, 2.5
"""Least vertices of a mesh that is coarsened, and cells along a prop's radius without and with `lump` (chosen)."""


def coarsened(batch: Batch, lump: bool = False) -> Mesh | None:
    """Return the mesh of a prop with close corners merged, more of them if `lump`; None for plants and simple
    meshes."""
    if plant(batch) or len(batch.mesh) < COARSE_FROM:
        return None
    return _coarse(batch.key, LUMP_CELLS if lump else COARSE_CELLS, SameMesh((batch.mesh,)))


def plant(batch: Batch) -> bool:
    """Return whether a prop is a plant, which has no gloss."""
    return batch.key.startswith(PLANTS)


def slight(batch: Batch) -> bool:
    """Return whether a prop is too thin to show at a distance, where a lamp's post is a third of a pixel."""
    return batch.key.startswith(SLIGHT)


@cache
def _made(name: str, fineness: _Fineness, key: SameMesh) -> Mesh:
    points, colours = key.levels[0][:, :3].astype(np.float64), key.levels[0][:, 6:9].astype(np.float64)
    top = points[:, 2].max()
    crown = (colours[:, 1] > 1.15 * colours[:, 0]) if (colours[:, 1] > 1.15 * colours[:, 0]).any() else points[:, 2] > 0
    low, high = points[crown].min(axis=0), points[crown].max(axis=0)
    paint = colours[crown].mean(axis=0)
    colour = float(paint[0]), float(paint[1]), float(paint[2])
    centre, radii = (low + high) / 2.0, (high - low) / 2.0
    if name.startswith(("pine", "conifer")):
        shape = cylinder((0.0, 0.0, float(low[2])), (0.0, 0.0, float(top)), (float(radii[0]), 0.05), colour,
                         sides=6 if fineness.trunk else 4)  # fmt: skip
    else:
        size = radii * (fineness.size, fineness.size, 1.0)
        shape = ellipsoid(vector_of(centre), vector_of(size), colour, rows=fineness.rows, sides=fineness.sides)
        shape[:, 6:9] *= (0.80 + 0.35 * (shape[:, 2:3] - low[2]) / max(high[2] - low[2], 0.1)).astype(np.float32)
    if not fineness.trunk:
        return shape
    trunk = cylinder((0.0, 0.0, 0.0), (0.0, 0.0, float(low[2]) + 0.3), (0.18, 0.14), (0.16, 0.11, 0.07), sides=4)
    return merge(shape, trunk)


@cache
def _coarse(name: str, cells: float, key: SameMesh) -> Mesh:
    """Return the mesh with each corner moved to the mean of its cell; of equal triangles the largest remains."""
    points = key.levels[0][:, :3].astype(np.float64)
    cell = float(np.linalg.norm(points.max(axis=0) - points.min(axis=0))) / 2.0 / cells
    _, group = np.unique(np.floor(points / cell), axis=0, return_inverse=True)
    group = group.ravel()
    count = np.bincount(group)
    means = np.stack([np.bincount(group, points[:, k]) / count for k in range(3)], axis=1)
    corners = points.reshape(-1, 3, 3)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    order = np.argsort(-area, kind="stable")
    triples = np.sort(group.reshape(-1, 3), axis=1)[order]
    _, first = np.unique(triples, axis=0, return_index=True)
    flat = (triples[first, 0] != triples[first, 1]) & (triples[first, 1] != triples[first, 2])
    kept = np.sort(order[first[flat]])
    mesh = key.levels[0].copy()
    mesh[:, :3] = means[group]
    return np.ascontiguousarray(mesh.reshape(-1, 3, mesh.shape[1])[kept].reshape(-1, mesh.shape[1]))
