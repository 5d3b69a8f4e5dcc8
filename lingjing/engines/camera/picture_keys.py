"""`picture_key`: a key of all inputs of a picture. Two pictures of one city and instance with equal keys are equal.

Of moving things, only those that may show count: bodies and their shadows in sight, marks on the water, and effects. A
generous sphere around each thing decides, so a thing that may show is never left out.
"""

from __future__ import annotations

import hashlib

import msgspec
import numpy as np
import numpy.typing as npt

from lingjing.engines.camera.draw import Scenery
from lingjing.engines.camera.effects.particles import Rows
from lingjing.engines.camera.instances import Batch, in_sight
from lingjing.engines.camera.light import sun_direction
from lingjing.mission.instance import Vector
from lingjing.trace.records import CameraPose

ROOM = 1.25
"""Ratio of a sphere's radius to that of the thing inside (chosen)."""
DEEP_M = 5.0
"""Depth below their shadow's plane that meshes of moving things do not exceed, metres."""


def picture_key(pose: CameraPose, scenery: Scenery, level_m: float) -> bytes:
    """Return the key of a picture of a scenery from a pose, over water at `level_m`."""
    inputs: list[object] = [pose, scenery.time_s, scenery.weather, scenery.variant]
    sun = sun_direction(scenery.weather)
    for batch in scenery.batches:
        inputs += batch.key, batch.rows[_bodies(batch, pose, sun)].tobytes()
    marks, clouds, decals = scenery.marks, scenery.billboards, scenery.decals
    on_water = np.column_stack([marks["place"][:, :2], np.full(len(marks), level_m)])
    for rows, places, size in (
        (marks, on_water, np.sqrt(2.0) * marks["place"][:, 2]),
        (clouds, clouds["place"], np.sqrt(2.0) * (clouds["size"] + np.linalg.norm(clouds["axis"], axis=1))),
        (decals, decals["place"], np.hypot(decals["half"][:, 0], decals["half"][:, 1])),
    ):
        inputs.append(_shown(rows, places, size, pose).tobytes())
    return hashlib.sha256(msgspec.msgpack.encode(inputs)).digest()


def _bodies(batch: Batch, pose: CameraPose, sun: Vector) -> npt.NDArray[np.bool_]:
    """Return which instances may show, or cast a shadow that may: onto their plane, along the sun's rays."""
    at = batch.rows["rows"][:, :, 3].astype(np.float64)
    plane = batch.rows["plane"].astype(np.float64)
    scale = np.linalg.norm(batch.rows["rows"][:, :, :3].astype(np.float64), axis=1).max(axis=1, initial=1.0)
    reach = ROOM * batch.radius * scale
    high = np.maximum(at[:, 2] - plane, 0.0)
    shadow = at - np.asarray(sun) * (high / sun[2])[:, None]
    shadow[:, 2] = plane
    longer = reach * (1.0 + 1.0 / sun[2])  # a top that is higher by the radius casts its shadow farther by this
    return in_sight(at, reach + DEEP_M, pose) | in_sight(shadow, longer, pose)


def _shown(rows: Rows, places: npt.NDArray[np.floating], size: npt.NDArray[np.floating], pose: CameraPose) -> Rows:
    return rows[in_sight(places.astype(np.float64), ROOM * size.astype(np.float64), pose)]


__all__ = ["picture_key"]
