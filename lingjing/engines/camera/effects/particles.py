"""Rows of effects and the chance that places them: billboards, decals, extra meshes; hashes for jitter.

Colours are linear RGB; what glows stays under 0.8, so that the picture's tone curve keeps its hue.
"""

from __future__ import annotations

import zlib
from dataclasses import dataclass, field
from math import cos, radians, sin

import numpy as np
import numpy.typing as npt

from lingjing.engines.camera.mesh_rows import Floats
from lingjing.engines.camera.meshes import Mesh
from lingjing.mission.appearance import LinearRgb
from lingjing.mission.instance import Vector

BILLBOARD = np.dtype(
    [
        ("place", "f4", (3,)),
        ("axis", "f4", (3,)),
        ("size", "f4"),
        ("colour", "f4", (3,)),
        ("alpha", "f4"),
        ("soft", "f4"),
        ("glow", "f4"),
        ("shape", "f4"),
        ("seed", "f4"),
        ("id", "u4"),
    ]
)
"""A quad that faces the camera: centre (world, m), half of its length as a world vector (0: round), half width (m),
colour, opacity 0..1, softness (0 crisp, 1 fading from the centre), glow (1: its own light, 0: the sun's and sky's),
shape (`PUFF`, `FLAME`, `DROP`), seed of its ragged edge, and 1 if it is the body of its entity."""

DECAL = np.dtype(
    [
        ("place", "f4", (3,)),
        ("half", "f4", (2,)),
        ("heading", "f4"),
        ("colour", "f4", (3,)),
        ("alpha", "f4"),
        ("kind", "f4"),
        ("seed", "f4"),
    ]
)
"""A flat blot: centre (world, m), half extents right and ahead (m), heading (radians), colour, opacity, kind (`BLOT`,
`WET`, `PAINT`; light on the ground: `POOL`, round, and `BEAM`, a cone ahead), seed."""

Rows = npt.NDArray[np.void]

PUFF, FLAME, DROP = 0.0, 1.0, 2.0
BLOT, WET, PAINT, POOL, BEAM = 0.0, 1.0, 2.0, 3.0, 4.0


def _none(dtype: np.dtype[np.void]) -> Rows:
    return np.zeros(0, dtype)


@dataclass(frozen=True, slots=True)
class EffectSolid:
    """A mesh with its entity's id: `rows` (3, 4) is model-to-world, `plane` the elevation its shadow falls on (m)."""

    key: str
    mesh: Mesh
    rows: Floats
    plane: float


@dataclass(frozen=True, slots=True)
class Effects:
    """What one entity or prop shows beside its model."""

    billboards: Rows = field(default_factory=lambda: _none(BILLBOARD))
    decals: Rows = field(default_factory=lambda: _none(DECAL))
    solids: tuple[EffectSolid, ...] = ()


def seed_of(name: str) -> int:
    """A number that is the same for a name in every process."""
    return zlib.crc32(name.encode())


def chance(seed: int, salt: int, count: int) -> Floats:
    """`count` uniform values in [0, 1) of a seed and a salt, by an integer hash."""
    return hashed(np.arange(count, dtype=np.uint64) + np.uint64((seed * 2_654_435_761 + salt * 97_003) & 0xFFFFFFFF))


def hashed(numbers: npt.NDArray[np.uint64]) -> Floats:
    """Uniform values in [0, 1), one a number (a 32-bit finaliser of two rounds)."""
    mask = np.uint64(0xFFFFFFFF)
    n = numbers & mask
    n = ((n ^ (n >> np.uint64(16))) * np.uint64(0x7FEB352D)) & mask
    n = ((n ^ (n >> np.uint64(15))) * np.uint64(0x846CA68B)) & mask
    n ^= n >> np.uint64(16)
    return np.asarray(n.astype(np.float64) / 2.0**32)


def stream(seed: int, time_s: float, count: int, life_s: float) -> tuple[Floats, npt.NDArray[np.uint64]]:
    """`count` particles that are born one after the other and live `life_s`: (age 0..1, number of each birth).

    The number of a birth grows for ever, so a particle that is reborn gets other chances.
    """
    phase = time_s / life_s + np.arange(count) / count
    born = np.floor(phase)
    number = (born.astype(np.int64) * count + np.arange(count)).astype(np.uint64)
    return phase - born, number + np.uint64(seed & 0xFFFFFF) * np.uint64(4099)


def billboards(
    place: Floats,
    size: npt.ArrayLike,
    colour: npt.ArrayLike,
    alpha: npt.ArrayLike,
    *,
    axis: npt.ArrayLike = 0.0,
    soft: npt.ArrayLike = 0.6,
    glow: npt.ArrayLike = 0.0,
    shape: float = PUFF,
    seed: npt.ArrayLike = 0.0,
    body: bool = False,
) -> Rows:
    """Rows of `BILLBOARD` from columns; `place` (n, 3) says how many."""
    rows = np.zeros(len(place), BILLBOARD)
    rows["place"], rows["size"], rows["colour"], rows["alpha"] = place, size, colour, alpha
    rows["axis"], rows["soft"], rows["glow"], rows["shape"] = axis, soft, glow, shape
    rows["seed"], rows["id"] = seed, int(body)
    return rows


def decal(
    place: Vector,
    half: tuple[float, float],
    heading_deg: float,
    colour: LinearRgb,
    alpha: float,
    kind: float,
    seed: float,
) -> Rows:
    """One row of `DECAL`."""
    rows = np.zeros(1, DECAL)
    rows["place"], rows["half"], rows["heading"], rows["colour"] = place, half, radians(heading_deg), colour
    rows["alpha"], rows["kind"], rows["seed"] = alpha, kind, seed
    return rows


def ahead(heading_deg: float) -> tuple[Floats, Floats]:
    """World vectors to the right of a heading and along it."""
    h = radians(heading_deg)
    return np.array([cos(h), -sin(h), 0.0]), np.array([sin(h), cos(h), 0.0])


def wind_of(speed_mps: float, from_deg: float) -> Floats:
    """World velocity (m/s) of a wind that comes from a bearing."""
    return -speed_mps * ahead(from_deg)[1]


def ramp(stops: npt.ArrayLike, at: Floats) -> Floats:
    """Colours (n, 3) along evenly spaced stops (m, 3) at 0..1."""
    colours = np.asarray(stops, np.float64)
    where = np.linspace(0.0, 1.0, len(colours))
    return np.stack([np.interp(at, where, colours[:, k]) for k in range(3)], axis=1)
