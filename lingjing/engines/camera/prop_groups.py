"""The props of the tiles in a picture, grouped by mesh, each with the mesh that fits its size in the picture."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from lingjing.engines.camera.effects.particles import Rows
from lingjing.engines.camera.instances import Batch, in_sight
from lingjing.engines.camera.meshes import Mesh
from lingjing.engines.camera.models import level_of
from lingjing.engines.camera.reduced_meshes import (
    FAR_M,
    FAR_PX,
    FULL_PX,
    LUMP_PX,
    SPECK,
    SPECK_PX,
    TINY,
    TINY_FAR_PX,
    TINY_PX,
    coarsened,
    plant,
    reduced,
    slight,
)
from lingjing.scene.camera_geometry import focal_px
from lingjing.trace.records import CameraPose

LEAST_PROP_PX = 1.2
"""Radius in pixels below which a prop is not drawn (chosen)."""


class Look(NamedTuple):
    """Instances that are drawn with one mesh."""

    key: str
    """Name of the mesh."""
    mesh: Mesh
    """The mesh."""
    rows: Rows
    """The instances."""
    dull: bool
    """True if the instances are drawn without gloss."""


class MergedProps:
    """The props of several tiles, kept while the tiles stay the same, as they do in most successive pictures."""

    def __init__(self) -> None:
        self._groups: list[Sequence[Batch]] = []
        self._batches: list[Batch] = []

    def of(self, groups: list[Sequence[Batch]]) -> list[Batch]:
        """Return `merged` of the groups."""
        known = self._groups
        if len(groups) != len(known) or any(a is not b for a, b in zip(groups, known, strict=True)):
            self._groups, self._batches = groups, merged(groups)
        return self._batches


def merged(groups: Sequence[Sequence[Batch]]) -> list[Batch]:
    """Return the batches of several tiles, one for each mesh, in order of keys."""
    groups_by_key: dict[str, list[Batch]] = {}
    for group in groups:
        for batch in group:
            groups_by_key.setdefault(batch.key, []).append(batch)
    return [
        Batch(key, some[0].mesh, np.concatenate([b.rows for b in some]), np.concatenate([b.radius for b in some]),
              np.concatenate([b.floating for b in some]), some[0].coarser)
        for key, some in sorted(groups_by_key.items())
    ]  # fmt: skip


def looks_of(batch: Batch, pose: CameraPose, lump_m: float) -> Iterator[Look]:
    """Return the instances of a batch in sight, by the mesh that they are drawn with.

    Beyond `lump_m` metres, in pictures that reach so far, meshes are the coarsest and thin props are left out.
    """
    at = batch.rows["rows"][:, :, 3].astype(np.float64)
    away = np.linalg.norm(at - np.array(pose.position), axis=1)
    size = batch.radius * focal_px(pose) / np.maximum(away, 0.1)
    seen = in_sight(at, batch.radius, pose) & (size > LEAST_PROP_PX)
    if slight(batch):
        seen &= away <= lump_m
    small_mesh, coarse = reduced(batch), coarsened(batch)
    near = seen & (size >= FULL_PX) if small_mesh is not None else seen
    tiny = seen & ~near & (size < np.where(away > FAR_M, TINY_FAR_PX, TINY_PX))
    speck = tiny & (away > lump_m) & (size < SPECK_PX)
    far = seen & (away > FAR_M) & (size < FAR_PX) if coarse is not None else np.zeros(len(seen), bool)
    lump = far & (away > lump_m) & (size < LUMP_PX)
    for suffix, mesh, which in (
        ("", batch.mesh, near & ~far), ("/small", small_mesh, seen & ~near & ~tiny),
        ("/tiny", reduced(batch, TINY), tiny & ~speck), ("/speck", reduced(batch, SPECK), speck),
        ("/far", coarse, far & ~lump), ("/lump", coarsened(batch, lump=True), lump),
    ):  # fmt: skip
        if mesh is batch.mesh and which.any():
            yield from _by_detail(batch, which, size)
        elif mesh is not None and which.any():
            yield Look(batch.key + suffix, mesh, batch.rows[which], plant(batch) or suffix == "/lump")


def _by_detail(batch: Batch, which: npt.NDArray[np.bool_], size: npt.NDArray[np.float64]) -> Iterator[Look]:
    """Yield instances that are drawn in full, by the level of detail that fits their size in the picture."""
    meshes = batch.levels
    level = level_of(size, len(meshes))
    for number, mesh in enumerate(meshes):
        mine = which & (level == number)
        if mine.any():
            key = f"{batch.key}/level-{number}" if number else batch.key
            yield Look(key, mesh, batch.rows[mine], plant(batch))


__all__ = ["Look", "MergedProps", "looks_of", "merged"]
