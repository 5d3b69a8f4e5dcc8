"""A gap in a bridge's deck in pixels: open water where the deck should go on.

The deck is what is not water; its two edges are straight within a picture. Between them the share of water is near
nothing where the deck is whole, so a run of rows with water in them, with deck before and after it (or up to the
picture's edge), is a gap. The picture is turned so that the deck runs up and down, and read at a quarter of its size.
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
WATER_HUES = (82, 118)
"""Of OpenCV's 180: the blues and greens of water under any sky."""
LEAST_SATURATION = 70
DECK_M = (6.0, 45.0)
"""Narrowest and widest deck that is believed."""
OPEN = 0.12
"""Share of water across the deck from which a row is part of a gap."""
GAP_M = (3.0, 45.0)
WHOLE_SHARE = 0.25
"""Share of the picture's rows that must show a whole deck for its edges to be known."""


@dataclass(frozen=True, slots=True)
class DeckEdges:
    """The deck's two edges: columns as linear functions of the row, and which rows show it whole."""

    left: tuple[float, float]
    right: tuple[float, float]
    whole: MaskArray


def find_gaps(rgb: ByteImage, pose: CameraPose, level_m: float) -> tuple[FoundBox, ...]:
    """Gaps in a nadir picture (height, width, 3) of a bridge over water at elevation `level_m`."""
    above_m = pose.position[2] - level_m
    if above_m <= 0.0 or not rgb.any():
        return ()
    water = water_mask(rgb)
    metres_per_px = above_m / focal_px(pose) * SCALE
    upright = _upright(water, metres_per_px)
    seen = water if upright else water.T
    edges = deck_edges(seen, metres_per_px)
    if edges is None:
        return ()
    finds = tuple(_finds(seen, edges, metres_per_px))
    return finds if upright else tuple(FoundBox(_transposed(find.box), find.confidence) for find in finds)


def water_mask(rgb: ByteImage) -> MaskArray:
    """Which pixels of the reduced picture are water."""
    cv2 = opencv()
    size = (rgb.shape[1] // SCALE, rgb.shape[0] // SCALE)
    hsv = cv2.cvtColor(cv2.resize(rgb, size, interpolation=cv2.INTER_AREA), cv2.COLOR_RGB2HSV)
    blue = (hsv[..., 0] >= WATER_HUES[0]) & (hsv[..., 0] <= WATER_HUES[1]) & (hsv[..., 1] >= LEAST_SATURATION)
    # Glints on the water are white specks: too small for a deck.
    water: MaskArray = cv2.morphologyEx(blue.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((3, 3))) > 0
    return water


def deck_edges(water: MaskArray, metres_per_px: float) -> DeckEdges | None:
    """The edges of a deck that runs up and down, or None if no plain one is in the picture."""
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
    return DeckEdges(left, right, whole)


def _finds(water: MaskArray, edges: DeckEdges, metres_per_px: float) -> list[FoundBox]:
    height, width = water.shape
    rows = np.arange(height)
    left = edges.left[0] * rows + edges.left[1]
    right = edges.right[0] * rows + edges.right[1]
    if min(right[0] - left[0], right[-1] - left[-1]) < 8:
        return []
    inner = zip(water, np.maximum(left + 2, 0).round().astype(int), (right - 2).round().astype(int), strict=True)
    share = np.array([row[a : max(a + 1, b)].mean() for row, a, b in inner])
    found = []
    for top, bottom in runs(share > OPEN, round(2.0 / metres_per_px)):
        long_m = (bottom - top) * metres_per_px
        if not GAP_M[0] <= long_m <= GAP_M[1] or top <= 1 or bottom >= height - 1:
            continue
        pad = 1.0 / metres_per_px
        x0, x1 = min(left[top], left[bottom - 1]) - pad, max(right[top], right[bottom - 1]) + pad
        box = (
            max(0.0, x0) / width,
            max(0.0, top - pad) / height,
            min(1.0, x1 / width),
            min(1.0, (bottom + pad) / height),
        )
        found.append(FoundBox(box, float(min(1.0, 0.5 + share[top:bottom].mean()))))
    return sorted(found, key=lambda find: (-find.confidence, find.box))


def _upright(water: MaskArray, metres_per_px: float) -> bool:
    """Whether the deck runs up and down rather than from side to side."""
    up, across = (deck_edges(mask, metres_per_px) for mask in (water, water.T))
    if up is None or across is None:
        return across is None
    return bool(up.whole.mean() >= across.whole.mean())


def _line(rows: npt.NDArray[np.int64], columns: npt.NDArray[np.int64]) -> tuple[float, float]:
    """Slope and offset of a line through the points, outliers left out once."""
    slope, offset = np.polyfit(rows, columns, 1)
    near = np.abs(slope * rows + offset - columns) <= 3.0
    if near.sum() >= 8:
        slope, offset = np.polyfit(rows[near], columns[near], 1)
    return float(slope), float(offset)


def _transposed(box: ImageBox) -> ImageBox:
    return box[1], box[0], box[3], box[2]
