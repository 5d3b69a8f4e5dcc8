"""Rows of effects (billboards, decals, extra meshes) and the hashes that place them.

Colours are linear RGB. Glowing ones stay below 0.8, so that the tone curve of the picture keeps their hue.
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
"""A quad that faces the camera.

`place`: centre (world, m). `axis`: half of its length as a world vector (0: round). `size`: half width (m). `colour`,
`alpha`: colour and opacity 0..1. `soft`: 0 crisp, 1 fading from the centre. `glow`: 1 its own light, 0 that of sun and
sky. `shape`: `PUFF`, `FLAME` or `DROP`. `seed`: of its ragged edge. `id`: 1 for the solid body of its
entity, which has no colour.
"""

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
"""A flat blot on the ground.

`place`: centre (world, m). `half`: half extents to the right and ahead (m). `heading`: radians. `colour`, `alpha`:
colour and opacity. `kind`: `BLOT`, `WET`, `PAINT`; light on the ground: `POOL`, round, and `BEAM`, a cone ahead.
`seed`: of its edge.
"""

Rows = npt.NDArray[np.void]

PUFF, FLAME, DROP = 0.0, 1.0, 2.0
"""Shapes of billboards, as in the shaders."""

BLOT, WET, PAINT, POOL, BEAM = 0.0, 1.0, 2.0, 3.0, 4.0
"""Kinds of decals, as in the shaders."""


def _none(dtype: np.dtype[np.void]) -> Rows:
    return np.zeros(0, dtype)


@dataclass(frozen=True, slots=True)
class EffectSolid:
    """A mesh with the id of its entity."""

    key: str
    """Name of the mesh."""
    mesh: Mesh
    """The mesh."""
    rows: Floats
    """Model-to-world matrix, (3, 4)."""
    plane: float
    """Elevation of the plane of its shadow, metres."""


@dataclass(frozen=True, slots=True)
class Effects:
    """The effects of one entity or prop in addition to its model."""

    billboards: Rows = field(default_factory=lambda: _none(BILLBOARD))
    """Rows of `BILLBOARD`."""
    decals: Rows = field(default_factory=lambda: _none(DECAL))
    """Rows of `DECAL`."""
    solids: tuple[EffectSolid, ...] = ()
    """Further meshes."""


def seed_of(name: str) -> int:
    """Return a number for a name; it is the same in every process."""
    return zlib.crc32(name.encode())


def chance(seed: int, salt: int, count: int) -> Floats:
    """Return `count` uniform values in [0, 1) for a seed and a salt, from an integer hash."""
    return hashed(np.arange(count, dtype=np.uint64) + np.uint64((seed * 2_654_435_761 + salt * 97_003) & 0xFFFFFFFF))


def hashed(numbers: npt.NDArray[np.uint64]) -> Floats:
    """Return a uniform value in [0, 1) for each number (a 32-bit finaliser of two rounds)."""
    mask = np.uint64(0xFFFFFFFF)
    n = numbers & mask
    n = ((n ^ (n >> np.uint64(16))) * np.uint64(0x7FEB352D)) & mask
    n = ((n ^ (n >> np.uint64(15))) * np.uint64(0x846CA68B)) & mask
    n ^= n >> np.uint64(16)
    return np.asarray(n.astype(np.float64) / 2.0**32)


def stream(seed: int, time_s: float, count: int, life_s: float) -> tuple[Floats, npt.NDArray[np.uint64]]:
    """Return `count` particles with lifetime `life_s` that are born one after another: (age 0..1, number of each
    birth).

    The number of births grows without limit, so a particle that is born again has other random values.
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
    """Return rows of `BILLBOARD` from columns; `place` (n, 3) determines their number."""
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
    """Return one row of `DECAL`."""
    rows = np.zeros(1, DECAL)
    rows["place"], rows["half"], rows["heading"], rows["colour"] = place, half, radians(heading_deg), colour
    rows["alpha"], rows["kind"], rows["seed"] = alpha, kind, seed
    return rows


def ahead(heading_deg: float) -> tuple[Floats, Floats]:
    """Return the world vectors to the right of a heading and along it."""
    h = radians(heading_deg)
    return np.array([cos(h), -sin(h), 0.0]), np.array([sin(h), cos(h), 0.0])


def wind_of(speed_mps: float, from_deg: float) -> Floats:
    """Return the world velocity (m/s) of a wind from a bearing."""
    return -speed_mps * ahead(from_deg)[1]


def ramp(stops: npt.ArrayLike, at: Floats) -> Floats:
    """Return colours (n, 3) along evenly spaced stops (m, 3) at 0..1."""
    colours = np.asarray(stops, np.float64)
    where = np.linspace(0.0, 1.0, len(colours))
    return np.stack([np.interp(at, where, colours[:, k]) for k in range(3)], axis=1)
