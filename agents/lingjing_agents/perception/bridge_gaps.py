"""Detection of gaps in a bridge's deck: open water in the continuation of the deck.

The deck is the region without water; its two edges are straight within a picture. Between them the share of water is
almost zero where the deck is whole. A run of rows with water, with deck before and after it or up to the picture's
edge, is therefore a gap. The picture is rotated so that the deck runs vertically, and read at a quarter of its size.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lingjing.plugins.geometry import focal_px
from lingjing.plugins.policy import CameraPose
from lingjing_agents.perception.images import ByteImage, ImageBox, MaskArray, opencv, runs
from lingjing_agents.perception.people_at_sea import FoundBox

SCALE = 4
"""Factor by which the picture is reduced."""
WATER_HUES = (82, 118)
"""Hues of water under any sky, in OpenCV's range of 180: blues and greens. Chosen."""
LEAST_SATURATION = 70
"""Least saturation of water, 0 to 255. Chosen."""
DECK_M = (6.0, 45.0)
"""Narrowest and widest plausible deck in metres. Chosen."""
OPEN = 0.12
"""Share of water across the deck from which on a row belongs to a gap."""
GAP_M = (3.0, 45.0)
"""Shortest and longest plausible gap in metres. Chosen."""
RIM_M, RIM_OPEN = 0.9, 0.3
"""Width of a deck's rim in metres, and the least share of water in it where the deck is open: beside what lies on the
deck, the rim is whole. Chosen."""
WHOLE_SHARE = 0.25
"""Least share of the picture's rows with a whole deck, so that its edges are reliable."""


@dataclass(frozen=True, slots=True)
class _DeckEdges:
    """The two edges of a deck."""

    left: tuple[float, float]
    """Slope and offset of the left edge: column as a linear function of the row."""
    right: tuple[float, float]
    """Slope and offset of the right edge."""
    whole: MaskArray
    """(rows,), True for rows with a whole deck."""


def find_gaps(rgb: ByteImage, pose: CameraPose, level_m: float) -> tuple[FoundBox, ...]:
    """Return the gaps in a nadir picture (height, width, 3) of a bridge over water at elevation `level_m`."""
    above_m = pose.position[2] - level_m
    if above_m <= 0.0 or not rgb.any():
        return ()
    water = _water_mask(rgb)
    metres_per_px = above_m / focal_px(pose) * SCALE
    upright = _upright(water, metres_per_px)
    seen = water if upright else water.T
    edges = _deck_edges(seen, metres_per_px)
    if edges is None:
        return ()
    finds = tuple(_finds(seen, edges, metres_per_px))
    return finds if upright else tuple(FoundBox(_transposed(find.box), find.confidence) for find in finds)


def _water_mask(rgb: ByteImage) -> MaskArray:
    """Return the mask of water in the reduced picture."""
    cv2 = opencv()
    size = (rgb.shape[1] // SCALE, rgb.shape[0] // SCALE)
    hsv = cv2.cvtColor(cv2.resize(rgb, size, interpolation=cv2.INTER_AREA), cv2.COLOR_RGB2HSV)
    blue = (hsv[..., 0] >= WATER_HUES[0]) & (hsv[..., 0] <= WATER_HUES[1]) & (hsv[..., 1] >= LEAST_SATURATION)
    # Glints on the water are white specks, too small for a deck: close them.
    water: MaskArray = cv2.morphologyEx(blue.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((3, 3))) > 0
    return water


def _deck_edges(water: MaskArray, metres_per_px: float) -> _DeckEdges | None:
    """Return the edges of a vertical deck, or None if the picture shows no clear one."""
    spans = [max(runs(~row), key=lambda run: run[1] - run[0], default=(0, 0)) for row in water]
    starts, widths = np.array([(start, end - start) for start, end in spans]).T
    fits = (widths * metres_per_px >= DECK_M[0]) & (widths * metres_per_px <= DECK_M[1])
    if fits.mean() < WHOLE_SHARE:
        return None
    typical = float(np.median(widths[fits]))
    whole = fits & (np.abs(widths - typical) <= 0.08 * typical + 2)
    if whole.mean() < WHOLE_SHARE:
        return None
    rows = np.flatnonzero(whole)
    left = _line(rows, starts[whole])
    right = _line(rows, (starts + widths)[whole])
    return _DeckEdges(left, right, whole)


def _finds(water: MaskArray, edges: _DeckEdges, metres_per_px: float) -> list[FoundBox]:
    height, width = water.shape
    rows = np.arange(height)
    left = edges.left[0] * rows + edges.left[1]
    right = edges.right[0] * rows + edges.right[1]
    if min(right[0] - left[0], right[-1] - left[-1]) < 8:
        return []
    inner = zip(water, np.maximum(left + 2, 0).round().astype(int), (right - 2).round().astype(int), strict=True)
    share = np.array([row[a : max(a + 1, b)].mean() for row, a, b in inner])
    wide = max(2, round(RIM_M / metres_per_px))
    ends = zip(water, *(np.clip(edge, 0, width).round().astype(int) for edge in (left, right)), strict=True)
    rim = np.array([np.r_[row[a : a + wide], row[max(0, b - wide) : b], False].mean() for row, a, b in ends])
    boxes = []
    for top, bottom in runs(share > OPEN, round(2.0 / metres_per_px)):
        long_m = (bottom - top) * metres_per_px
        if not GAP_M[0] <= long_m <= GAP_M[1] or top <= 1 or bottom >= height - 1:
            continue
        if rim[top:bottom].mean() < RIM_OPEN:
            continue
        pad = 1.0 / metres_per_px
        x0, x1 = min(left[top], left[bottom - 1]) - pad, max(right[top], right[bottom - 1]) + pad
        box = (
            max(0.0, x0) / width,
            max(0.0, top - pad) / height,
            min(1.0, x1 / width),
            min(1.0, (bottom + pad) / height),
        )
        boxes.append(FoundBox(box, float(min(1.0, 0.5 + share[top:bottom].mean()))))
    return sorted(boxes, key=lambda find: (-find.confidence, find.box))


def _upright(water: MaskArray, metres_per_px: float) -> bool:
    """Return whether the deck runs vertically rather than horizontally."""
    up, across = (_deck_edges(mask, metres_per_px) for mask in (water, water.T))
    if up is None or across is None:
        return across is None
    return bool(up.whole.mean() >= across.whole.mean())


def _line(rows: npt.NDArray[np.int64], columns: npt.NDArray[np.int64]) -> tuple[float, float]:
    """Return slope and offset of a line through the points, fitted again without outliers."""
    slope, offset = np.polyfit(rows, columns, 1)
    near = np.abs(slope * rows + offset - columns) <= 3.0
    if near.sum() >= 8:
        slope, offset = np.polyfit(rows[near], columns[near], 1)
    return float(slope), float(offset)


def _transposed(box: ImageBox) -> ImageBox:
    return box[1], box[0], box[3], box[2]
