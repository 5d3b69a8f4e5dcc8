"""Reference models for `eyes.py`: vehicles and a pedestrian from a package, read from glTF.

The package is `metadrive-simulator`; nothing of it is part of this project. Its walking man is CC-BY-4.0
(Renderpeople). Of its vehicles only those are used for which an older package of the same project, `pgdrive`, names a
licence: light truck, Beetle and sports car, all CC-BY-4.0. They are drawn with vertex colours alone: the base colour
of the material, or the texel of its texture at the vertex.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from lingjing.engines.camera.meshes import Mesh
from lingjing.scene.gltf_file import GltfFile

VEHICLES = {
    "light truck": ("truck", 5.8, 0.37, 0.931, 1.726, -1.075),
    "Beetle": ("beetle", 4.25, 0.39, 0.79, 1.22, -1.28),
    "sports car": ("130", 4.4, 0.39, 0.803, 1.285, -1.203),
}
"""Folder, length (m), radius of a tyre, half track, front and rear axle of each vehicle, as its package declares."""


def baked(file: Path, share: float | None = None) -> Mesh:
    """Return all triangles of a file, z up; with its skin at a share of its animation."""
    mesh = GltfFile(file).bake(share)
    colours, row = mesh.colours.copy(), 0
    for name, count in mesh.materials:
        if "glass" in name:
            colours[row : row + count] = (0.015, 0.02, 0.026)
        row += count
    gloss = 0.5 * (1.0 - mesh.roughness[:, None]) + 0.2
    return np.hstack([zup(mesh.points), zup(mesh.normals), colours, gloss]).astype(np.float32)


def zup(rows: np.ndarray) -> np.ndarray:
    """Return vectors of a frame with y up in one with z up."""
    return np.stack([rows[:, 0], -rows[:, 2], rows[:, 1]], axis=1)


def scaled(mesh: Mesh, factor: float) -> Mesh:
    out = mesh.copy()
    out[:, :3] *= factor
    return out


def grounded(mesh: Mesh) -> Mesh:
    """Return the mesh with the middle of its footprint at the origin."""
    out = mesh.copy()
    low, high = out[:, :3].min(axis=0), out[:, :3].max(axis=0)
    out[:, :3] -= [(low[0] + high[0]) / 2, (low[1] + high[1]) / 2, low[2]]
    return out


def vehicle(folder: Path, name: str, length_m: float, radius: float, half: float, axles: Sequence[float]) -> Mesh:
    """Return a vehicle on its wheels, in metres, ahead along y."""
    body = baked(folder / "vehicle" / name / "vehicle.gltf")
    parts = [scaled(body, length_m / float(np.ptp(body[:, 1])))]
    for end, y in zip(("front", "back"), axles, strict=True):
        tyre = baked(folder / "vehicle" / name / f"right_tire_{end}.gltf")
        tyre = scaled(tyre, radius / float(np.abs(tyre[:, 2]).max()))
        other = tyre.copy()
        other[:, [0, 3]] *= -1.0
        parts += [placed(tyre, half, y, radius), placed(other, -half, y, radius)]
    return grounded(np.concatenate(parts))


def placed(mesh: Mesh, *offset: float) -> Mesh:
    out = mesh.copy()
    out[:, :3] += np.array(offset, np.float32)
    return out


def reference_models(package: Path) -> dict[str, list[Mesh]]:
    """Return the reference of each kind, from the folder in which the package was installed."""
    folder = package / "metadrive" / "assets" / "models"
    made = {name: vehicle(folder, *row[:4], row[4:]) for name, row in VEHICLES.items()}
    man = folder / "pedestrian" / "scene.gltf"
    walk = [grounded(scaled(baked(man, share), 0.01)) for share in (0.1, 0.35, 0.6, 0.85)]
    truck = [made["light truck"]]
    return {"car": [made["Beetle"], made["sports car"]], "truck": truck, "delivery_van": truck, "person": walk}
