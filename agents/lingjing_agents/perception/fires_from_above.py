"""Flames in pictures from above: orange patches of a few metres with varying hue and soot around them.

A painted roof is as orange as a fire, but of one hue. The detector therefore searches for orange with a hue that varies
from pixel to pixel. The picture is read at half its size.
"""

from __future__ import annotations

import numpy as np

from lingjing.plugins.geometry import focal_px
from lingjing.plugins.policy import CameraPose
from lingjing_agents.perception.images import ByteImage, MaskArray, PixelBox, opencv
from lingjing_agents.perception.people_at_sea import FoundBox

SCALE = 2
"""Factor by which the picture is reduced."""
HUES = (6, 26)
"""Hues from red-orange to yellow, in OpenCV's range of 180."""
LEAST_SATURATION, LEAST_VALUE = 130, 140
"""Least saturation and value of flames, 0 to 255. Chosen."""
WINDOW_PX = 7
"""Side of the window in which the hue's variation is measured."""
VARIED = 1.1
"""Least standard deviation of the hue (of 180) within the window; a painted roof stays below 1."""
SIZE_M = (2.0, 24.0)
"""Shortest and longest side of a fire in metres at ground level; a fire on a high roof appears twice as large.
Chosen."""
LEAST_FILL = 0.35
"""Least share of its box that a fire fills. Chosen."""
SOOT_VALUE = 95
"""Highest value (0 to 255) of soot. Chosen."""
RING_PX = 6
"""Width of the ring around a patch in which soot is measured."""


def find_fires_from_above(rgb: ByteImage, pose: CameraPose, level_m: float) -> tuple[FoundBox, ...]:
    """Return the fires in a nadir picture (height, width, 3), highest confidence first; the ground is at `level_m`."""
    cv2 = opencv()
    above_m = pose.position[2] - level_m
    if above_m <= 0.0 or not rgb.any():
        return ()
    height, width = rgb.shape[0] // SCALE, rgb.shape[1] // SCALE
    hsv = cv2.cvtColor(cv2.resize(rgb, (width, height), interpolation=cv2.INTER_AREA), cv2.COLOR_RGB2HSV)
    flicker = _flickering(hsv)
    count, labels, stats, _ = cv2.connectedComponentsWithStats(flicker, connectivity=8)
    metres_per_px = above_m / focal_px(pose) * SCALE
    finds = []
    for label in range(1, count):
        x, y, wide, high, area = (int(value) for value in stats[label])
        if min(wide, high) * metres_per_px < SIZE_M[0] or max(wide, high) * metres_per_px > SIZE_M[1]:
            continue
        if area < LEAST_FILL * wide * high:
            continue
        confidence = min(1.0, 0.55 + 0.9 * _soot(hsv, labels == label, (x, y, wide, high)))
        finds.append(FoundBox((x / width, y / height, (x + wide) / width, (y + high) / height), confidence))
    return tuple(sorted(finds, key=lambda find: (-find.confidence, find.box)))


def _flickering(hsv: ByteImage) -> ByteImage:
    """Return the mask of orange pixels with varying hue, with gaps closed and thin edges of painted objects removed."""
    cv2 = opencv()
    hue, saturation, value = hsv[..., 0], hsv[..., 1], hsv[..., 2]
    orange = (hue >= HUES[0]) & (hue <= HUES[1]) & (saturation >= LEAST_SATURATION) & (value >= LEAST_VALUE)
    weight = orange.astype(np.float32)
    size = (WINDOW_PX, WINDOW_PX)
    share = cv2.boxFilter(weight, -1, size)
    mean = cv2.boxFilter(weight * hue, -1, size) / np.maximum(share, 1e-3)
    square = cv2.boxFilter(weight * hue.astype(np.float32) ** 2, -1, size) / np.maximum(share, 1e-3)
    varied = orange & (share > 0.3) & (square - mean * mean > VARIED**2)
    closed = cv2.morphologyEx(varied.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((5, 5), np.uint8))
    opened: ByteImage = cv2.morphologyEx(closed, cv2.MORPH_OPEN, np.ones((5, 5), np.uint8))
    return opened


def _soot(hsv: ByteImage, own: MaskArray, box: PixelBox) -> float:
    """Return the share (0 to 1) of the ring around a patch that is dark and grey: burnt roof or smoke."""
    cv2 = opencv()
    x, y, wide, high = box
    rows = slice(max(0, y - RING_PX), y + high + RING_PX)
    columns = slice(max(0, x - RING_PX), x + wide + RING_PX)
    patch = own[rows, columns].astype(np.uint8)
    ring = (cv2.dilate(patch, np.ones((2 * RING_PX + 1, 2 * RING_PX + 1), np.uint8)) > 0) & (patch == 0)
    dark = (hsv[rows, columns, 2] < SOOT_VALUE) & (hsv[rows, columns, 1] < 90)
    return float(dark[ring].mean()) if ring.any() else 0.0
