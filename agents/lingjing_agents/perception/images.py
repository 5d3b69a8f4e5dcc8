"""Images as numpy arrays, and OpenCV, which is imported with the first picture."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt

ByteImage = npt.NDArray[np.uint8]
"""(rows, columns) or (rows, columns, 3) with red, green and blue, 0 to 255."""

FloatArray = npt.NDArray[np.float64]
GreyPlane = npt.NDArray[np.float32]
IntArray = npt.NDArray[np.intp]
MaskArray = npt.NDArray[np.bool_]

ImageBox = tuple[float, float, float, float]
"""x0, y0, x1, y1 as shares (0 to 1) of an image's width and height; origin top left."""

PixelBox = tuple[int, int, int, int]
"""x0, y0, x1, y1 in pixels; the last two are exclusive."""


@cache
def opencv() -> Any:
    """Return the cv2 module, limited to one thread: results must not depend on a thread pool."""
    import cv2

    cv2.setNumThreads(1)
    return cv2


def runs(flags: MaskArray, bridge: int = 0) -> list[tuple[int, int]]:
    """Return runs of True as (first, last + 1), in order. Runs at most `bridge` apart are merged."""
    steps = np.diff(np.concatenate(([0], flags.astype(np.int8), [0])))
    merged: list[tuple[int, int]] = []
    for start, end in zip(np.flatnonzero(steps == 1).tolist(), np.flatnonzero(steps == -1).tolist(), strict=True):
        if bridge and merged and start - merged[-1][1] <= bridge:
            start = merged.pop()[0]
        merged.append((start, end))
    return merged
