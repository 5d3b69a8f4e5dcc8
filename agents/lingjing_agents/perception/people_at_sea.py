"""People in the water, by their difference from the water in colour, size and shape.

In colour space, water, foam and glints lie near the line from the local water colour to white; clothes and skin do not.
A pixel is described by its position along that line (`whiteness`, 0 at the water, 1 at white) and its distance from it
(`colour`, in grey levels). Patches with warm pixels are judged by rules about a waving person: one to two metres long,
neither solid nor round (buoys and crates are), no stick, partly but not mostly pale skin, and no white paint (life
rings have it).

Only nadir pictures of open water are supported; shores are rejected by size. The thresholds were chosen on rendered
frames of other seeds than the studies use.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from lingjing.plugins.geometry import focal_px
from lingjing.plugins.policy import CameraPose
from lingjing_agents.perception.images import ByteImage, GreyPlane, ImageBox, IntArray, MaskArray, PixelBox, opencv

COLOUR = 18.0
"""Distance from the water-white line, in grey levels, from which on a pixel is not water."""
WHITE = 0.4
"""Whiteness from which on a pixel is not water."""
WARM, WARM_COLOUR = 26.0, 24.0
"""Least excess of red over blue beyond that of the water, and least `colour`, of warm pixels (skin, wood, vests), in
grey levels.
"""
WARM_LEAST = 2
"""Least number of warm pixels of a person. Chosen."""
PALE, PALE_COLOUR = 0.45, 45.0
"""Least whiteness and largest `colour` of skin in the sun."""
GAPS_M = (0.0, 0.15)
"""Gaps in metres across which patches are joined. Arms and head may appear separate from dark clothes, so both are
tried.
"""
BACKGROUND_SCALE = 8
"""Reduction of the picture for the local water colour."""
BACKGROUND_WINDOW = 7
"""Side of the median filter on the reduced picture."""

RULES: tuple[tuple[str, tuple[float, float, float, float]], ...] = (
    ("length_m", (0.80, 1.00, 1.70, 2.10)),
    ("width_m", (0.40, 0.58, 1.30, 1.60)),
    ("area_m2", (0.12, 0.24, 0.95, 1.20)),
    ("fill", (0.16, 0.28, 0.60, 0.70)),
    ("solidity", (0.36, 0.48, 0.84, 0.90)),
    ("elongation", (1.00, 1.16, 2.20, 3.20)),
    ("pale", (0.00, 0.04, 0.32, 0.48)),
    ("brightest", (0.30, 0.50, 0.90, 0.97)),
    ("warm", (0.04, 0.10, 0.86, 0.94)),
)
"""For each measure four corners of a trapezoid: full membership between the middle two, none outside the outer two."""
LONGEST_M = dict(RULES)["length_m"][3]
"""Largest length of a person in metres."""


@dataclass(frozen=True, slots=True)
class FoundBox:
    """A detection."""

    box: ImageBox
    """Normalised x0, y0, x1, y1; origin top left."""
    confidence: float
    """From 0 to 1."""


@dataclass(frozen=True, slots=True)
class _WaterContrast:
    """The description of each pixel relative to the local water colour."""

    whiteness: GreyPlane
    """Position on the line from water (0) to white (1)."""
    colour: GreyPlane
    """Distance from the line from water to white, grey levels."""
    warmth: GreyPlane
    """Excess of red over blue in grey levels."""


@dataclass(frozen=True, slots=True)
class _ColourPatch:
    """A connected patch that is not water."""

    box: PixelBox
    """Its box in pixels."""
    mask: MaskArray
    """The mask of its pixels in the box."""
    measures: dict[str, float]
    """The measures of `RULES`."""


def find_people(rgb: ByteImage, pose: CameraPose, water_level_m: float) -> tuple[FoundBox, ...]:
    """Return the people in a nadir picture (height, width, 3), highest confidence first; none in a black picture."""
    height, width = rgb.shape[:2]
    above_m = pose.position[2] - water_level_m
    if above_m <= 0.0 or not rgb.any():
        return ()
    metres_per_px = above_m / focal_px(pose)
    gaps_px = tuple(round(gap_m / metres_per_px) for gap_m in GAPS_M)
    water = _local_water(rgb)
    rows, columns = _warm_pixels(rgb, water)
    if len(rows) < WARM_LEAST:
        return ()
    reach = math.ceil(LONGEST_M / metres_per_px) + 2 * max(gaps_px) + 2  # longer patches are no people
    y0, x0 = (max(0, int(indices.min()) - reach) for indices in (rows, columns))
    around = slice(y0, int(rows.max()) + reach + 1), slice(x0, int(columns.max()) + reach + 1)
    seen = contrast(rgb[around], water[around])
    finds = []
    for gap_px in gaps_px:
        for blob in _blobs(seen, metres_per_px, gap_px):
            confidence = _likelihood(blob.measures)
            if confidence > 0.0:
                left, top, right, bottom = blob.box
                box = ((x0 + left) / width, (y0 + top) / height, (x0 + right) / width, (y0 + bottom) / height)
                finds.append(FoundBox(box, confidence))
    return _distinct(sorted(finds, key=lambda find: (-find.confidence, find.box)))


def _distinct(finds: list[FoundBox]) -> tuple[FoundBox, ...]:
    """Return the first of each group of overlapping detections."""
    kept: list[FoundBox] = []
    for find in finds:
        if not any(_overlap(find.box, other.box) for other in kept):
            kept.append(find)
    return tuple(kept)


def _overlap(a: ImageBox, b: ImageBox) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


def _local_water(rgb: ByteImage) -> ByteImage:
    """Return the colour of the water around each pixel, (height, width, 3)."""
    cv2 = opencv()
    height, width = rgb.shape[:2]
    size = (max(1, width // BACKGROUND_SCALE), max(1, height // BACKGROUND_SCALE))
    small = cv2.medianBlur(cv2.resize(rgb, size, interpolation=cv2.INTER_AREA), BACKGROUND_WINDOW)
    water: ByteImage = cv2.resize(small, (width, height), interpolation=cv2.INTER_LINEAR)
    return water


def _warm_pixels(rgb: ByteImage, water: ByteImage) -> tuple[IntArray, IntArray]:
    """Return the rows and columns of the warm pixels."""
    cv2 = opencv()
    redder = cv2.subtract(rgb[..., 0], water[..., 0], dtype=cv2.CV_16S)
    bluer = cv2.subtract(rgb[..., 2], water[..., 2], dtype=cv2.CV_16S)
    rows, columns = np.divmod(np.flatnonzero(cv2.subtract(redder, bluer) > WARM), rgb.shape[1])
    warm = contrast(rgb[rows, columns], water[rows, columns]).colour > WARM_COLOUR
    return rows[warm], columns[warm]


def contrast(rgb: ByteImage, water: ByteImage) -> _WaterContrast:
    """Split the difference of pixels (…, 3) from the local water colour into whiteness and colour."""
    levels = np.moveaxis(water, -1, 0).astype(np.float32, order="C")
    to_white = 255.0 - levels
    difference = np.moveaxis(rgb, -1, 0).astype(np.float32, order="C") - levels
    length2 = np.maximum(_dot(to_white, to_white), 1.0)
    whiteness: GreyPlane = np.divide(_dot(difference, to_white), length2)
    distance2 = _dot(difference, difference) - whiteness * whiteness * length2
    return _WaterContrast(whiteness, np.sqrt(np.maximum(distance2, 0.0)), difference[0] - difference[2])


def _dot(left: GreyPlane, right: GreyPlane) -> GreyPlane:
    """Return the sum of products over three channels, the first axis. Whole numbers below 2^24 are exact in any
    order.
    """
    product: GreyPlane = left[0] * right[0] + left[1] * right[1] + left[2] * right[2]
    return product


def _blobs(seen: _WaterContrast, metres_per_px: float, gap_px: int) -> Iterator[_ColourPatch]:
    """Yield patches with at least `WARM_LEAST` warm pixels, inside the picture and no longer than a person.

    Pieces at most `gap_px` apart form one patch.
    """
    cv2 = opencv()
    warm = (seen.colour > WARM_COLOUR) & (seen.warmth > WARM)
    patches = ((seen.colour > COLOUR) | (seen.whiteness > WHITE)).astype(np.uint8)
    joined = cv2.dilate(patches, np.ones((gap_px + 1, gap_px + 1), np.uint8)) if gap_px else patches
    count, labels, stats, _ = cv2.connectedComponentsWithStats(joined, connectivity=8)
    warm_counts = np.bincount(labels[warm & (patches > 0)], minlength=count)
    height, width = patches.shape
    longest_px = LONGEST_M / metres_per_px
    for label in np.flatnonzero(warm_counts >= WARM_LEAST).tolist():
        x, y, wide, high = (int(value) for value in stats[label, :4])
        if label == 0 or max(wide, high) > longest_px + gap_px:
            continue
        window = (slice(y, y + high), slice(x, x + wide))
        own = (labels[window] == label) & (patches[window] > 0)
        rows, columns = np.flatnonzero(own.any(axis=1)), np.flatnonzero(own.any(axis=0))
        x0, y0, x1, y1 = x + columns[0], y + rows[0], x + columns[-1] + 1, y + rows[-1] + 1
        if x0 == 0 or y0 == 0 or x1 == width or y1 == height:
            continue
        mask: MaskArray = own[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
        inside = (slice(y0, y1), slice(x0, x1))
        pale = (seen.whiteness[inside] > PALE) & (seen.colour[inside] < PALE_COLOUR)
        measures = measure(mask, metres_per_px)
        measures["pale"] = float(pale[mask].mean())
        measures["brightest"] = float(seen.whiteness[inside][mask].max())
        measures["warm"] = float(warm_counts[label]) / float(mask.sum())
        yield _ColourPatch((int(x0), int(y0), int(x1), int(y1)), mask, measures)


def measure(mask: MaskArray, metres_per_px: float) -> dict[str, float]:
    """Return size (m, m²) and shape of a patch: share of its box, share of its convex hull, ratio of its principal
    axes.
    """
    cv2 = opencv()
    rows, columns = np.nonzero(mask)
    points = np.stack([columns, rows], axis=1).astype(np.int32)
    hull = cv2.convexHull(points)
    # A hull of pixel centres lacks half a pixel all around (Pick's theorem).
    hull_px = cv2.contourArea(hull) + cv2.arcLength(hull, True) / 2.0 + 1.0
    spread = np.linalg.eigvalsh(np.cov(points.T)) if len(points) > 2 else np.ones(2)
    high, wide = mask.shape
    return {
        "length_m": max(high, wide) * metres_per_px,
        "width_m": min(high, wide) * metres_per_px,
        "area_m2": len(points) * metres_per_px**2,
        "fill": len(points) / mask.size,
        "solidity": len(points) / hull_px,
        "elongation": float(np.sqrt(max(spread[1], 1e-3) / max(spread[0], 1e-3))),
    }


def _likelihood(measures: dict[str, float]) -> float:
    """Return the membership of a patch in the class of people, 0 to 1: the product over all measures."""
    product = 1.0
    for name, corners in RULES:
        product *= _membership(measures[name], corners)
    return product


def _membership(value: float, corners: tuple[float, float, float, float]) -> float:
    return float(np.interp(value, corners, (0.0, 1.0, 1.0, 0.0)))
