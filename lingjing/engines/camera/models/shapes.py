"""Shapes for models, in addition to the primitives of `camera.meshes`, and `ModelPart`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import cos, radians, sin

import numpy as np
import numpy.typing as npt

from lingjing.engines.camera.meshes import Mesh, cylinder, ellipsoid, flat, loft, merge
from lingjing.mission.appearance import LinearRgb
from lingjing.mission.instance import Vector

Placement = npt.NDArray[np.float64]
HERE: Placement = np.eye(3, 4)
"""The identity: the part stays in the body's frame."""


@dataclass(frozen=True, slots=True)
class ModelPart:
    """A mesh of an entity."""

    key: str
    """Name that always stands for this mesh."""
    mesh: Mesh
    """The mesh."""
    rows: Placement = field(default_factory=lambda: HERE)
    """Matrix (3, 4) from the part's frame to the body's."""
    coarser: tuple[Mesh, ...] = ()
    """The mesh at coarser levels of detail."""

    @property
    def levels(self) -> tuple[Mesh, ...]:
        """The mesh at all levels of detail, the finest first."""
        return self.mesh, *self.coarser


def turned(mesh: Mesh, rows: Placement) -> Mesh:
    """Return the mesh moved by a rigid (3, 4) transformation."""
    moved = mesh.copy()
    moved[:, :3] = mesh[:, :3] @ rows[:, :3].T + rows[:, 3]
    moved[:, 3:6] = mesh[:, 3:6] @ rows[:, :3].T
    return moved


def at(place: Vector, yaw_deg: float = 0.0, pitch_deg: float = 0.0, roll_deg: float = 0.0) -> Placement:
    """Return the (3, 4) matrix that rolls about y, pitches about x (up), turns clockwise about z, then moves."""
    y, p, r = radians(yaw_deg), radians(pitch_deg), radians(roll_deg)
    yaw = np.array([[cos(y), sin(y), 0.0], [-sin(y), cos(y), 0.0], [0.0, 0.0, 1.0]])
    nod = np.array([[1.0, 0.0, 0.0], [0.0, cos(p), -sin(p)], [0.0, sin(p), cos(p)]])
    lean = np.array([[cos(r), 0.0, sin(r)], [0.0, 1.0, 0.0], [-sin(r), 0.0, cos(r)]])
    return np.hstack([yaw @ nod @ lean, np.array(place, float)[:, None]])


def shell(
    sections: Sequence[tuple[float, Sequence[tuple[float, float]]]], colour: LinearRgb, gloss: float = 0.0
) -> Mesh:
    """Return a skin through open cross-sections as `loft`, with flat ends."""
    ends = []
    for y, ring in (sections[0], sections[-1]):
        corners = [(x, y, z) for x, z in ring]
        ends += [(corners[0], corners[k], corners[k + 1]) for k in range(1, len(corners) - 1)]
    return merge(loft(sections, colour, gloss), flat(np.array(ends), colour, gloss))


def quad(a: Vector, b: Vector, c: Vector, d: Vector, colour: LinearRgb, gloss: float = 0.0) -> Mesh:
    """Return two triangles over four corners in order."""
    return flat([(a, b, c), (a, c, d)], colour, gloss)


def pane(
    corners: Sequence[Vector],
    colour: LinearRgb,
    gloss: float,
    share: float = 0.86,
    lift: float = 0.012,
    away: Vector = (0.0, 0.0, 0.0),
) -> Mesh:
    """Return a quad shrunk to a share about its middle and lifted off its plane, away from a point inside the model."""
    p = np.array(corners, float)
    middle = p.mean(axis=0)
    normal = np.cross(p[1] - p[0], p[2] - p[0])
    normal /= max(float(np.linalg.norm(normal)), 1e-9)
    if normal @ (middle - np.array(away)) < 0.0:
        normal = -normal
    p = middle + share * (p - middle) + lift * normal
    return flat(np.array([(p[0], p[1], p[2]), (p[0], p[2], p[3])]), colour, gloss)


def limb(start: Vector, end: Vector, radii: tuple[float, float], colour: LinearRgb, sides: int = 6) -> Mesh:
    """Return an arm, a leg or a strut without end caps."""
    return cylinder(start, end, radii, colour, sides=sides)[: 6 * sides]


def blob(centre: Vector, radii: Vector, colour: LinearRgb, seed: int, rows: int = 4, sides: int = 7) -> Mesh:
    """Return a lumpy, leafy ellipsoid, darker below and inside."""
    mesh = ellipsoid((0.0, 0.0, 0.0), (1.0, 1.0, 1.0), colour, rows=rows, sides=sides)
    p = mesh[:, :3].astype(np.float64)
    bump = (
        1.0
        + 0.13 * np.sin(p @ np.array([5.3, 3.1, 4.7]) + 1.7 * seed)
        + 0.09 * np.sin(p @ np.array([-3.7, 6.1, 2.9]) + 2.9 * seed)
    )
    mesh[:, :3] = p * bump[:, None] * np.array(radii) + np.array(centre)
    mesh[:, 6:9] *= (0.62 + 0.38 * (0.5 + 0.5 * p[:, 2:]) + 0.10 * (bump[:, None] - 1.0)).astype(np.float32)
    return mesh


def mirrored(mesh: Mesh) -> Mesh:
    """Return the mesh with its mirror image across x = 0."""
    other = mesh.copy()
    other[:, 0] *= -1.0
    other[:, 3] *= -1.0
    return merge(mesh, other)


__all__ = ["HERE", "ModelPart", "at", "blob", "limb", "mirrored", "pane", "quad", "shell", "turned"]
