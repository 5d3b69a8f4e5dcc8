"""Models that are kept as data: `vehicles.npz`, made by `tools/vehicle_models.py`, at three levels of detail.

A level is an array of vertices (position, normal, material) and one of three indices a triangle. The colours are here:
a material is one of `FIXED`, or `paint` and `cargo`, which each look has its own colour for.
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import numpy.typing as npt

from lingjing.engines.camera.meshes import Mesh
from lingjing.mission.appearance import LinearRgb

FILE = Path(__file__).with_name("vehicles.npz")
UNIT_M = 0.0005
"""Unit of stored positions, metres."""
LEVELS = 3
"""Levels of detail, the finest first."""

FIXED: dict[str, tuple[LinearRgb, float]] = {
    "glass": ((0.016, 0.021, 0.026), 0.95),
    "lamp": ((0.80, 0.80, 0.76), 0.8),
    "tail": ((0.42, 0.015, 0.012), 0.6),
    "black": ((0.018, 0.018, 0.020), 0.25),
    "under": ((0.010, 0.010, 0.011), 0.0),
    "seam": ((0.020, 0.020, 0.022), 0.0),
    "chrome": ((0.42, 0.43, 0.45), 0.8),
    "plate": ((0.70, 0.70, 0.66), 0.2),
    "tyre": ((0.014, 0.014, 0.015), 0.05),
    "rim": ((0.34, 0.35, 0.37), 0.6),
    "bumper": ((0.075, 0.076, 0.080), 0.2),
}
"""Colour and gloss of each material that all vehicles share (chosen)."""
MATERIALS = ("paint", "cargo", *FIXED)
"""Materials, in the order of the file."""
PAINT_GLOSS, CARGO_GLOSS = 0.7, 0.2
"""Gloss of paint and of the box of a truck (chosen)."""


COARSER_PX = (180.0, 75.0)
"""Radius in the picture below which a model has its second and its third level, pixels (chosen)."""


@cache
def stored(name: str, paint: LinearRgb, cargo: LinearRgb = (0.7, 0.7, 0.7)) -> Mesh:
    """Return a model of the file at its finest level, with the colours of its paint and its cargo box."""
    meshes = tuple(_level(name, level, paint, cargo) for level in range(LEVELS))
    _COARSER[id(meshes[0])] = meshes
    return meshes[0]


_COARSER: dict[int, tuple[Mesh, ...]] = {}
"""The levels of each model by the identity of its finest mesh. `stored` keeps these meshes, so identities last."""


def levels(mesh: Mesh) -> tuple[Mesh, ...]:
    """Return the levels of detail of a mesh, the finest first; the mesh alone if it has no others."""
    return _COARSER.get(id(mesh), (mesh,))


def level_of(size_px: npt.NDArray[np.float64], count: int) -> npt.NDArray[np.int64]:
    """Return the level, below `count`, that fits each radius in the picture, pixels."""
    rank = sum((size_px < least).astype(np.int64) for least in COARSER_PX)
    return np.minimum(rank, count - 1)


def _level(name: str, level: int, paint: LinearRgb, cargo: LinearRgb) -> Mesh:
    arrays = _arrays()
    vertices, index = arrays[f"{name}/{level}/vertices"], arrays[f"{name}/{level}/index"]
    table = np.array([(*paint, PAINT_GLOSS), (*cargo, CARGO_GLOSS), *((*c, gloss) for c, gloss in FIXED.values())])
    normals = vertices[:, 3:6] / np.linalg.norm(vertices[:, 3:6], axis=1, keepdims=True)
    rows = np.hstack([vertices[:, :3] * UNIT_M, normals, table[vertices[:, 6]]])
    return rows[index].astype(np.float32)


@cache
def _arrays() -> dict[str, npt.NDArray[np.int64]]:
    with np.load(FILE) as arrays:
        return {name: arrays[name].astype(np.int64) for name in arrays.files}
