"""Models that are kept as data: `vehicles.npz` and `people.npz`, made by `tools/vehicle_models.py` and
`tools/people_models.py`, at three levels of detail.

A level is an array of vertices (position, normal, material) and one of three indices a triangle. The colours are here:
a material is one of `FIXED`, or one of `VARIABLE`, which each look has its own colour for (a `Palette`).
"""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import numpy.typing as npt

from lingjing.engines.camera.meshes import Mesh
from lingjing.mission.appearance import LinearRgb

FOLDER = Path(__file__).parent
UNIT_M = 0.0005
"""Unit of stored positions, metres."""
LEVELS = 3
"""Levels of detail, the finest first."""

VARIABLE: dict[str, float] = {
    "paint": 0.7, "cargo": 0.2, "coat": 0.0, "trousers": 0.0, "shirt": 0.0, "skin": 0.05, "hair": 0.1, "shoes": 0.15,
    "bag": 0.1, "helmet": 0.6,
}  # fmt: skip
"""Gloss of each material that the look has a colour for (chosen)."""
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
    "white": ((0.78, 0.78, 0.76), 0.3),
    "yellow": ((0.72, 0.52, 0.03), 0.3),
    "orange": ((0.75, 0.20, 0.02), 0.3),
    "red": ((0.52, 0.03, 0.025), 0.3),
    "blue": ((0.02, 0.09, 0.62), 0.8),
    "steel": ((0.46, 0.47, 0.49), 0.5),
    "eye": ((0.022, 0.016, 0.013), 0.3),
    "lip": ((0.34, 0.12, 0.09), 0.1),
}
"""Colour and gloss of each material that all models share (chosen)."""
MATERIALS = (*VARIABLE, *FIXED)
"""Materials, in the order of the files."""

Palette = tuple[tuple[str, LinearRgb], ...]
"""Colours of variable materials by name; the others are grey."""
UNPAINTED: LinearRgb = (0.5, 0.5, 0.5)

COARSER_PX = (180.0, 75.0)
"""Radius in the picture below which a model has its second and its third level, pixels (chosen)."""


@cache
def stored(name: str, palette: Palette) -> tuple[Mesh, ...]:
    """Return the levels of a vehicle, the finest first."""
    made = []
    for level in range(LEVELS):
        arrays = stored_arrays("vehicles")
        vertices, index = arrays[f"{name}/{level}/vertices"], arrays[f"{name}/{level}/index"]
        normals = vertices[:, 3:6] / np.linalg.norm(vertices[:, 3:6], axis=1, keepdims=True)
        made.append(painted_rows(vertices[:, :3] * UNIT_M, normals, vertices[:, 6], index, palette))
    return tuple(made)


def painted_rows(
    points: npt.NDArray[np.floating],
    normals: npt.NDArray[np.floating],
    materials: npt.NDArray[np.int64],
    index: npt.NDArray[np.int64],
    palette: Palette,
) -> Mesh:
    """Return the mesh of vertices and indices with the colours of their materials."""
    colours = dict(palette)
    table = [(*colours.get(name, UNPAINTED), gloss) for name, gloss in VARIABLE.items()]
    table += [(*colours.get(name, colour), gloss) for name, (colour, gloss) in FIXED.items()]
    rows = np.hstack([points, normals, np.array(table)[materials]])
    return np.ascontiguousarray(rows[index], np.float32)


def level_of(size_px: npt.NDArray[np.float64], count: int) -> npt.NDArray[np.int64]:
    """Return the level, below `count`, that fits each radius in the picture, pixels."""
    rank = sum((size_px < least).astype(np.int64) for least in COARSER_PX)
    return np.minimum(rank, count - 1)


@cache
def stored_arrays(file: str) -> dict[str, npt.NDArray[np.int64]]:
    """Return the arrays of a file by name."""
    with np.load(FOLDER / f"{file}.npz") as arrays:
        return {name: arrays[name].astype(np.int64) for name in arrays.files}
