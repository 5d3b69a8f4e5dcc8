"""Instances of meshes: rows of props and entities, and their culling."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import cos, radians, sin
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from lingjing.engines.camera.classes import prop_class
from lingjing.engines.camera.meshes import Mesh, SameMesh
from lingjing.engines.camera.models import HERE, ModelPart, level_of, prop_part
from lingjing.engines.camera.ocean import SeaSurface
from lingjing.mission.instance import Entity
from lingjing.scene.camera_geometry import camera_axes, focal_px
from lingjing.scene.city import Pieces, Prop
from lingjing.trace.records import BodyState, CameraPose

if TYPE_CHECKING:
    from lingjing.engines.camera.effects.particles import Rows  # `effects` imports this module

ROW = np.dtype([("rows", "f4", (3, 4)), ("plane", "f4"), ("id", "u4")])
"""An instance: rows of the model-to-world matrix, elevation of its shadow's plane (m), drawn id."""


KEPT_RADII = 1024
"""Radii of moving things' meshes in memory (chosen)."""


@dataclass(frozen=True, slots=True)
class Batch:
    """Instances of one mesh."""

    key: str
    """Name of the mesh."""
    mesh: Mesh
    """The mesh."""
    rows: Rows
    """Rows of `ROW`, (n,)."""
    radius: npt.NDArray[np.float64]
    """Bounding radius of each, metres."""
    floating: npt.NDArray[np.bool_]
    """True for those that float on the waves."""
    coarser: tuple[Mesh, ...] = ()
    """The mesh at coarser levels of detail."""

    @property
    def levels(self) -> tuple[Mesh, ...]:
        """The mesh at all levels of detail, the finest first."""
        return self.mesh, *self.coarser

    @property
    def coarsest(self) -> Mesh:
        """The mesh that casts the shadows."""
        return self.levels[-1]


@dataclass(frozen=True, slots=True)
class DrawnPart:
    """A part of a moving thing in the world."""

    place: npt.NDArray[np.float64]
    """Matrix (3, 4) from the mesh's frame to the world."""
    key: str
    """Name of the mesh."""
    levels: tuple[Mesh, ...]
    """The mesh at all levels of detail, the finest first."""
    number: int
    """Drawn id."""
    plane: float
    """Elevation of the plane on which its shadow falls, metres."""


def matrix(
    position: tuple[float, float, float], heading_deg: float, pitch_deg: float, roll_deg: float, scale: float = 1.0
) -> npt.NDArray[np.float64]:
    """Return the (3, 4) model-to-world matrix. Positive pitch lifts the bow, positive roll lowers the right side."""
    h, p, r = radians(heading_deg), radians(pitch_deg), radians(roll_deg)
    turn = np.array([[cos(h), sin(h), 0.0], [-sin(h), cos(h), 0.0], [0.0, 0.0, 1.0]])
    nod = np.array([[1.0, 0.0, 0.0], [0.0, cos(p), -sin(p)], [0.0, sin(p), cos(p)]])
    lean = np.array([[cos(r), 0.0, sin(r)], [0.0, 1.0, 0.0], [-sin(r), 0.0, cos(r)]])
    return np.hstack([turn @ nod @ lean * scale, np.array(position)[:, None]])


def row(rows: npt.NDArray[np.float64], plane: float, number: int) -> Rows:
    """Return one instance as an array of length 1."""
    out = np.zeros(1, ROW)
    out["rows"], out["plane"], out["id"] = rows, plane, number
    return out


def mesh_radius(mesh: Mesh) -> float:
    """Return the radius of a mesh about its origin, metres."""
    return float(np.linalg.norm(mesh[:, :3], axis=1).max()) if len(mesh) else 0.0


def prop_batches(city: Pieces) -> tuple[Batch, ...]:
    """Return all props of a city or a tile, one batch for each mesh."""
    groups: dict[str, list[tuple[Prop, ModelPart]]] = {}
    for prop in city.props:
        variant = prop.options.get("variant", 0)
        part = prop_part(prop.model, variant if isinstance(variant, int) else 0)
        groups.setdefault(part.key, []).append((prop, part))
    return tuple(_prop_batch(group) for _, group in sorted(groups.items()))


def _prop_batch(group: Sequence[tuple[Prop, ModelPart]]) -> Batch:
    """Return the batch of a mesh. All rows are computed at once, because a town has thousands of props.

    The values equal those of `matrix` and `row`.
    """
    props, first = [prop for prop, _ in group], group[0][1]
    heading = [radians(prop.heading_deg) for prop in props]
    east, north = np.array([cos(h) for h in heading]), np.array([sin(h) for h in heading])
    scale = np.array([prop.scale for prop in props])
    rows = np.zeros(len(props), ROW)
    rows["rows"][:, :2, 0] = np.column_stack([east, -north]) * scale[:, None]
    rows["rows"][:, :2, 1] = np.column_stack([north, east]) * scale[:, None]
    rows["rows"][:, 2, 2] = scale
    rows["rows"][:, :, 3] = [prop.position for prop in props]
    wider = np.ones(len(props))
    if any(part.rows is not HERE for _, part in group):
        rows["rows"][:, :, :3] = rows["rows"][:, :, :3] @ np.array([part.rows[:, :3] for _, part in group])
        wider = np.array([_widening(part.rows) for _, part in group])
    rows["plane"] = rows["rows"][:, 2, 3]
    rows["id"] = [prop_class(prop.cls) for prop in props]
    radius = mesh_radius(first.mesh) * scale * wider
    return Batch(first.key, first.mesh, rows, radius, np.array([prop.floating for prop in props]), first.coarser)


def _widening(rows: npt.NDArray[np.float64]) -> float:
    """Return the largest factor by which a matrix (3, 4) without shear lengthens a vector."""
    return float(np.linalg.norm(rows[:, :3], axis=0).max())


def entity_batches(drawn: Iterable[DrawnPart]) -> tuple[Batch, ...]:
    """Return moving things as batches, one for each mesh, in order of keys."""
    groups: dict[str, list[DrawnPart]] = {}
    for part in drawn:
        groups.setdefault(part.key, []).append(part)
    return tuple(_entity_batch(group) for _, group in sorted(groups.items()))


def _entity_batch(group: Sequence[DrawnPart]) -> Batch:
    first, count = group[0], len(group)
    rows = np.concatenate([row(part.place, part.plane, part.number) for part in group])
    radius = _known_radius(first.key, SameMesh(first.levels)) * np.array([_widening(part.place) for part in group])
    return Batch(first.key, first.levels[0], rows, radius, np.zeros(count, bool), first.levels[1:])


@lru_cache(maxsize=KEPT_RADII)
def _known_radius(name: str, of: SameMesh) -> float:
    return mesh_radius(of.levels[0])


def by_detail(batch: Batch, pose: CameraPose) -> Iterator[Batch]:
    """Yield the instances of a batch by the level of detail that fits their size in the picture."""
    meshes = batch.levels
    if len(meshes) == 1:
        yield batch
        return
    away = np.linalg.norm(batch.rows["rows"][:, :, 3].astype(np.float64) - np.array(pose.position), axis=1)
    level = level_of(batch.radius * focal_px(pose) / np.maximum(away, 0.1), len(meshes))
    for number, mesh in enumerate(meshes):
        mine = level == number
        if mine.any():
            key = f"{batch.key}/level-{number}" if number else batch.key
            yield Batch(key, mesh, batch.rows[mine], batch.radius[mine], batch.floating[mine], meshes[number + 1 :])


def afloat(batch: Batch, swell: SeaSurface) -> Rows:
    """Return the batch's rows, with floating ones tilted by the waves.

    The drawn sea is flat, so their position stays on its plane.
    """
    if not batch.floating.any():
        return batch.rows
    rows = batch.rows.copy()
    which = np.flatnonzero(batch.floating)
    at = rows["rows"][which].astype(np.float64)
    _, east, north = swell.at(at[:, 0, 3], at[:, 1, 3])
    lean = np.broadcast_to(np.eye(3), (len(which), 3, 3)).copy()
    lean[:, 2, 0], lean[:, 2, 1], lean[:, 0, 2], lean[:, 1, 2] = east, north, -east, -north
    at[:, :, :3] = lean @ at[:, :, :3]
    rows["rows"][which] = at.astype(np.float32)
    return rows


def visible(rows: Rows, radius: npt.NDArray[np.float64], pose: CameraPose, slack: float = 0.0) -> npt.NDArray[np.bool_]:
    """Return which instances may show: inside the frustum (spheres enlarged by `slack` radii), a third of a pixel or
    more."""
    at = rows["rows"][:, :, 3].astype(np.float64)
    away = np.linalg.norm(at - np.array(pose.position), axis=1)
    sized: npt.NDArray[np.bool_] = radius * focal_px(pose) > 0.17 * np.maximum(away, 1.0)
    return sized & in_sight(at, radius * (1.0 + slack), pose)


def in_sight(
    centres: npt.NDArray[np.float64], reach: npt.NDArray[np.float64], pose: CameraPose
) -> npt.NDArray[np.bool_]:
    """Return which spheres (n, 3), (n,) touch the camera's frustum, without its far end."""
    right, down, axis = (np.array(a) for a in camera_axes(pose))
    offset = centres - np.array(pose.position)
    focal = focal_px(pose)
    z = offset @ axis
    keep: npt.NDArray[np.bool_] = z > -reach
    for across, half in ((right, pose.width / 2.0), (down, pose.height / 2.0)):
        keep &= np.abs(offset @ across) <= z * half / focal + reach * np.hypot(1.0, half / focal)
    return keep


MARK = np.dtype([("place", "f4", (4,)), ("kind", "f4", (2,))])
"""A mark on the water: place (east, north, size, heading) and kind (0 ring or 1 wake, strength)."""


def marks(states: Sequence[tuple[BodyState, Entity]]) -> npt.NDArray[np.void]:
    """Return the marks on the water: rings around targets, and the wake of a moving asset."""
    out = []
    for state, entity in states:
        east, north, _ = state.position
        speed = float(np.hypot(state.velocity[0], state.velocity[1]))
        heading = radians(state.heading_deg)
        if entity.role == "target":
            out.append(((east, north, 1.3, heading), (0.0, 0.5)))
        elif speed > 0.3:
            size = 6.0 + 6.0 * speed
            back = 0.97 * size - 4.1
            at = (east - back * sin(heading), north - back * cos(heading), size, heading)
            out.append((at, (1.0, min(1.0, 0.3 + 0.25 * speed))))
    return np.array(out, MARK)
