"""Seamless value noise from hashed integer lattices, as a texture for ground, clouds and foam."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

SIZE = 256
OCTAVES = (8, 16, 32, 64, 128)


def noise_texture() -> npt.NDArray[np.uint8]:
    """(SIZE, SIZE, 4) bytes: smooth fractal noise, the same elsewhere, its two finest octaves, white noise."""
    smooth, other = _fractal(1, OCTAVES), _fractal(7, OCTAVES)
    fine, white = _fractal(3, OCTAVES[3:]), _lattice(5, SIZE)
    return np.rint(255.0 * np.stack([smooth, other, fine, white], axis=-1)).astype(np.uint8)


def lace_texture() -> npt.NDArray[np.uint8]:
    """(SIZE, SIZE) bytes: fine noise of full contrast that breaks foam up."""
    values = 0.45 * _fractal(11, OCTAVES[1:]) + 0.55 * _fractal(17, OCTAVES[3:])
    stretched = np.clip(0.5 + (values - values.mean()) / (4.5 * values.std()), 0.0, 1.0)
    return np.asarray(np.rint(255.0 * stretched), np.uint8)


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
    """Uniform values in [0, 1) from an integer hash (Wang's mix)."""
    n = np.arange(cells * cells, dtype=np.uint64) + np.uint64(salt * 1_000_003)
    mask = np.uint64(0xFFFFFFFF)
    n = ((n ^ np.uint64(61)) ^ (n >> np.uint64(16))) * np.uint64(9) & mask
    n = (n ^ (n >> np.uint64(4))) * np.uint64(0x27D4EB2D) & mask
    n = n ^ (n >> np.uint64(15))
    return (n.astype(np.float64) / 2.0**32).reshape(cells, cells)
