"""Seamless value noise from hashed integer lattices: textures of ground, clouds and foam."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

SIZE, GRAIN, CLOUDS = 256, 1024, 1024
"""Sides of the textures, texels (chosen)."""

OCTAVES = (8, 16, 32, 64, 128)
"""Cells along a side in each octave of the noise (chosen)."""


def noise_texture() -> npt.NDArray[np.uint8]:
    """Return (SIZE, SIZE, 4) bytes: smooth fractal noise, another one, its two finest octaves, and white noise."""
    smooth, other = _fractal(1, OCTAVES), _fractal(7, OCTAVES)
    fine, white = _fractal(3, OCTAVES[3:]), _lattice(5, SIZE)
    return np.rint(255.0 * np.stack([smooth, other, fine, white], axis=-1)).astype(np.uint8)


def lace_texture() -> npt.NDArray[np.uint8]:
    """Return (SIZE, SIZE) bytes of fine noise of full contrast, which breaks up foam."""
    values = 0.45 * _fractal(11, OCTAVES[1:]) + 0.55 * _fractal(17, OCTAVES[3:])
    stretched = np.clip(0.5 + (values - values.mean()) / (4.5 * values.std()), 0.0, 1.0)
    return np.asarray(np.rint(255.0 * stretched), np.uint8)


def grain_texture() -> npt.NDArray[np.uint8]:
    """Return (GRAIN, GRAIN, 4) bytes for the surfaces of a town: tone and bare patches of paving, tone of asphalt, wear
    of paint.

    Each has a wide variation across the texture and a fine one that repeats eight times.
    """
    coarse = noise_texture().astype(np.float64) / 255.0
    wide, fine = _stretched(coarse), np.tile(coarse[::2, ::2], (GRAIN * 2 // SIZE, GRAIN * 2 // SIZE, 1))
    paving = 0.5 + 0.5 * (0.6 * wide[..., 0] + 0.45 * fine[..., 0] + 0.7 * fine[..., 2] - 0.875)
    patches = _smoothstep(0.40, 0.78, 0.8 * wide[..., 1] + 0.2 * fine[..., 1])
    asphalt = (0.42 * wide[..., 0] + 0.24 * fine[..., 2]) / 0.66
    wear = _smoothstep(0.25, 0.45, 0.6 * fine[..., 0] + 0.5 * wide[..., 1])
    values = np.stack([paving, patches, asphalt, wear], axis=-1)
    return np.asarray(np.rint(255.0 * np.clip(values, 0.0, 1.0)), np.uint8)


def cloud_texture() -> npt.NDArray[np.uint8]:
    """Return (CLOUDS, CLOUDS, 1) bytes: the thickness of clouds, large puffs with finer ones of a third of their
    size."""
    coarse = noise_texture().astype(np.float64) / 255.0
    puffs = 0.7 * _tiled(coarse[..., :1], 1) + 0.45 * _tiled(coarse[..., 1:2], 3)
    return np.asarray(np.rint(255.0 / 1.15 * puffs), np.uint8)


def _stretched(values: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Return a seamless texture at `GRAIN` texels a side."""
    return _tiled(values, 1, GRAIN)


def _tiled(values: npt.NDArray[np.float64], times: int, size: int = CLOUDS) -> npt.NDArray[np.float64]:
    """Return a seamless texture repeated `times` times, at `size` texels a side."""
    at = np.arange(size) * SIZE * times / size
    low = at.astype(np.int64)
    share = (at - low)[:, None, None]
    low, high = low % SIZE, (low + 1) % SIZE
    rows = values[low] * (1.0 - share) + values[high] * share
    share = share.reshape(1, -1, 1)
    return np.asarray(rows[:, low] * (1.0 - share) + rows[:, high] * share)


def _smoothstep(start: float, end: float, at: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    t = np.clip((at - start) / (end - start), 0.0, 1.0)
    return t * t * (3.0 - 2.0 * t)


def _fractal(salt: int, octaves: tuple[int, ...]) -> npt.NDArray[np.float64]:
    values = np.sum([_octave(salt + k, cells) / 2.0**k for k, cells in enumerate(octaves)], axis=0)
    return np.asarray((values - values.min()) / np.ptp(values))


def _octave(salt: int, cells: int) -> npt.NDArray[np.float64]:
    lattice = _lattice(salt, cells)
    at = np.arange(SIZE) * cells / SIZE
    low = at.astype(np.int64)
    f = at - low
    f = f * f * (3.0 - 2.0 * f)
    high = (low + 1) % cells
    rows = lattice[low] * (1.0 - f)[:, None] + lattice[high] * f[:, None]
    return np.asarray(rows[:, low] * (1.0 - f) + rows[:, high] * f)


def _lattice(salt: int, cells: int) -> npt.NDArray[np.float64]:
    """Return uniform values in [0, 1) from an integer hash (Wang's mix)."""
    n = np.arange(cells * cells, dtype=np.uint64) + np.uint64(salt * 1_000_003)
    mask = np.uint64(0xFFFFFFFF)
    n = ((n ^ np.uint64(61)) ^ (n >> np.uint64(16))) * np.uint64(9) & mask
    n = (n ^ (n >> np.uint64(4))) * np.uint64(0x27D4EB2D) & mask
    n = n ^ (n >> np.uint64(15))
    return (n.astype(np.float64) / 2.0**32).reshape(cells, cells)
