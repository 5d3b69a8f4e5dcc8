"""The distortion of a lens, applied to the pictures that clients receive. Pictures in the trace are those of a pinhole.

The model is Brown's: a ray that meets the image plane of a pinhole at (x, y), in focal lengths from the centre, meets
that of the lens at

    x (1 + K1 r^2 + K2 r^4 + K3 r^6) + 2 P1 x y + P2 (r^2 + 2 x^2)
    y (1 + K1 r^2 + K2 r^4 + K3 r^6) + P1 (r^2 + 2 y^2) + 2 P2 x y,   r^2 = x^2 + y^2

which are the names and the order of OpenCV's calibration.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from lingjing.scene.camera_geometry import focal_px
from lingjing.trace.records import CameraPose

LARGEST = 1.0
"""Largest absolute value of a parameter (chosen): real lenses have less."""
_ROUNDS = 20
"""Rounds of the fixed-point iteration that inverts the model (chosen)."""
_EXACT_PX = 0.5
"""Largest error of an inverse that counts as found, pixels (chosen)."""

Array = npt.NDArray[Any]


class Distortion(NamedTuple):
    """The parameters of a lens; all are 0 for a pinhole."""

    K1: float = 0.0
    K2: float = 0.0
    K3: float = 0.0
    P1: float = 0.0
    P2: float = 0.0


def distorted(pixels: Array, distortion: Distortion | None, pose: CameraPose, outside: float) -> Array:
    """Return (height, width, ...) values of a pinhole's picture as the lens shows them, each that of the nearest pixel.

    `outside` stands where the lens sees beyond the border of the pinhole's picture.
    """
    if distortion is None or not any(distortion):
        return pixels
    columns, rows, seen = _sources(distortion, pose)
    picture = pixels[rows, columns]
    picture[~seen] = outside
    return picture


def _sources(distortion: Distortion, pose: CameraPose) -> tuple[Array, Array, Array]:
    """Return the column and the row of the pinhole's pixel for each pixel of the lens, and whether it has one."""
    focal = focal_px(pose)
    u = (np.arange(pose.width) + 0.5 - pose.width / 2.0)[None, :] / focal
    v = (np.arange(pose.height) + 0.5 - pose.height / 2.0)[:, None] / focal
    x, y = np.broadcast_arrays(u, v)
    with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
        for _ in range(_ROUNDS):
            scale, shift_x, shift_y = _model(distortion, x, y)
            x, y = (u - shift_x) / scale, (v - shift_y) / scale
        scale, shift_x, shift_y = _model(distortion, x, y)
        error = np.hypot(x * scale + shift_x - u, y * scale + shift_y - v) * focal
        columns = np.floor(x * focal + pose.width / 2.0)
        rows = np.floor(y * focal + pose.height / 2.0)
        seen = (error < _EXACT_PX) & (columns >= 0) & (columns < pose.width) & (rows >= 0) & (rows < pose.height)
    return np.where(seen, columns, 0).astype(np.intp), np.where(seen, rows, 0).astype(np.intp), seen


def _model(distortion: Distortion, x: Array, y: Array) -> tuple[Array, Array, Array]:
    """Return the radial factor, and the tangential shifts to the right and downwards."""
    k1, k2, k3, p1, p2 = distortion
    squared = x * x + y * y
    scale = 1.0 + squared * (k1 + squared * (k2 + squared * k3))
    return scale, 2.0 * p1 * x * y + p2 * (squared + 2.0 * x * x), p1 * (squared + 2.0 * y * y) + 2.0 * p2 * x * y
