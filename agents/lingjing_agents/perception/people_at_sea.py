"""People in the water, by their difference from the water in colour, size and shape.

In colour space, water, foam and glints lie near the line from the local water colour to white; clothes and skin do not.
A pixel is described by its position along that line (`whiteness`, 0 at the water, 1 at white) and its distance from it
(`colour`, in grey levels). Patches with warm pixels are judged by rules about a waving person: one to two metres long,
neither solid nor round (buoys and crates are), no stick, partly but not mostly pale skin, and no white paint (life
rings have it). People in dark clothes are nearly as dark and blue as the water: a second set of rules judges patches
with a *tint*, more red and less green than the water, and with little white, which foam has.

Only nadir pictures of open water are supported; shores are rejected by size. The thresholds were chosen on rendered
frames of other seeds than the studies use (2000 to 2005): 135 people in 178 pictures and 310 pictures of buoys, crates,
boats, seaweed and other floating things.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

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
"""Least number of warm pixels, or of tinted ones in dark clothes, of a person. Chosen."""
TINT, TINT_COLOUR = 12.0, 12.0
"""Least excess of red over green beyond that of the water, and least `colour`, of tinted pixels, in grey levels."""
LEAST_DIFFERENCE = math.ceil(TINT_COLOUR / 3.0**0.5)
"""Difference from the water, in the channel where it is largest, below which a pixel is water by every rule; grey
levels."""
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

Corners = tuple[float, float, float, float]
"""Corners of a trapezoid: full membership between the middle two, none outside the outer two."""
RULES: dict[str, Corners] = {
    "length_m": (0.80, 1.00, 1.70, 2.10),
    "width_m": (0.40, 0.58, 1.30, 1.60),
    "area_m2": (0.12, 0.24, 0.95, 1.20),
    "fill": (0.16, 0.28, 0.60, 0.70),
    "solidity": (0.36, 0.48, 0.84, 0.90),
    "elongation": (0.90, 1.02, 2.20, 3.20),
    "pale": (-1.0, 0.00, 0.32, 0.48),
    "brightest": (0.30, 0.50, 0.90, 0.97),
    "marked": (0.04, 0.10, 0.80, 0.90),
}
"""The rules of a person by the measures of a patch; marked pixels are warm."""
DARK_RULES: dict[str, Corners] = {
    "length_m": (0.60, 0.80, 1.60, 2.00),
    "width_m": (0.40, 0.60, 1.35, 1.60),
    "area_m2": (0.15, 0.24, 0.90, 1.15),
    "fill": (0.20, 0.30, 0.60, 0.68),
    "solidity": (0.40, 0.50, 0.80, 0.86),
    "elongation": (0.90, 1.05, 2.00, 2.80),
    "pale": (-1.0, 0.00, 0.22, 0.30),
    "brightest": (0.30, 0.42, 0.85, 0.95),
    "marked": (0.35, 0.50, 1.01, 1.02),
    "whiteness": (-0.05, 0.00, 0.28, 0.36),
    "colour": (7.0, 9.5, 23.0, 28.0),
    "strongest": (19.0, 23.0, 60.0, 75.0),
}
"""The rules of a person in dark clothes; marked pixels are tinted."""
LEAST_DARK_M = 1.1
"""Least side of the box of a person in dark clothes, metres: the span of the arms in development pictures."""
LONGEST_M = RULES["length_m"][3]
"""Largest length of a person in metres."""


@dataclass(frozen=True, slots=True)
class FoundBox:
    """A detected person, with its box."""

    box: ImageBox
    """Normalised x0, y0, x1, y1; origin top left."""
    confidence: float
    """Confidence of the detection, 0 to 1."""


@dataclass(frozen=True, slots=True)
class _WaterContrast:
    """The description of each pixel relative to the local water colour."""

    whiteness: GreyPlane
    """Position on the line from water (0) to white (1)."""
    colour: GreyPlane
    """Distance from the line from water to white, grey levels."""
    warmth: GreyPlane
    """Excess of red over blue in grey levels."""
    tint: GreyPlane
    """Excess of red over green in grey levels."""


class _Marked(NamedTuple):
    """Pixels that decide on patches, each (height, width)."""

    patches: MaskArray
    """True for pixels that are not water."""
    marked: MaskArray
    """True for warm pixels, or tinted ones for dark clothes."""
    rules: dict[str, Corners]
    """The rules that judge the patches."""
    least_m: float
    """Least side of a box, metres: dark arms are lost in the water."""


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
    finds = _finds(_sparse_contrast(rgb, water), _dark, (0, 0), (height, width), metres_per_px, gaps_px)
    rows, columns = _warm_pixels(rgb, water)
    if len(rows) >= WARM_LEAST:
        reach = math.ceil(LONGEST_M / metres_per_px) + 2 * max(gaps_px) + 2  # longer patches are no people
        y0, x0 = (max(0, int(indices.min()) - reach) for indices in (rows, columns))
        around = slice(y0, int(rows.max()) + reach + 1), slice(x0, int(columns.max()) + reach + 1)
        seen = contrast(rgb[around], water[around])
        finds += _finds(seen, _bright, (x0, y0), (height, width), metres_per_px, gaps_px)
    return _distinct(sorted(finds, key=lambda find: (-find.confidence, find.box)))


def _finds(
    seen: _WaterContrast,
    mark: Callable[[_WaterContrast], _Marked],
    corner: tuple[int, int],
    shape: tuple[int, int],
    metres_per_px: float,
    gaps_px: tuple[int, ...],
) -> list[FoundBox]:
    """Return the patches that the rules of `mark` accept; `seen` begins at `corner` (x, y) of a picture of `shape`."""
    (x0, y0), (height, width), marks = corner, shape, mark(seen)
    finds = []
    for gap_px in gaps_px:
        for blob in _blobs(seen, marks, metres_per_px, gap_px):
            confidence = _likelihood(blob.measures, marks.rules)
            if confidence > 0.0:
                left, top, right, bottom = _widened(blob.box, marks.least_m / metres_per_px)
                box = (max(x0 + left, 0) / width, max(y0 + top, 0) / height,
                       min(x0 + right, width) / width, min(y0 + bottom, height) / height)  # fmt: skip
                finds.append(FoundBox(box, confidence))
    return finds


def _widened(box: PixelBox, least_px: float) -> tuple[float, float, float, float]:
    """Return a box with sides of at least `least_px` pixels around the same middle."""
    left, top, right, bottom = box
    across, down = max(least_px - (right - left), 0.0) / 2.0, max(least_px - (bottom - top), 0.0) / 2.0
    return left - across, top - down, right + across, bottom + down


def _bright(seen: _WaterContrast) -> _Marked:
    warm = (seen.colour > WARM_COLOUR) & (seen.warmth > WARM)
    return _Marked((seen.colour > COLOUR) | (seen.whiteness > WHITE), warm, RULES, 0.0)


def _dark(seen: _WaterContrast) -> _Marked:
    tinted = (seen.colour > TINT_COLOUR) & (seen.tint > TINT)
    return _Marked((seen.colour > COLOUR) | (seen.whiteness > WHITE) | tinted, tinted, DARK_RULES, LEAST_DARK_M)


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


def _sparse_contrast(rgb: ByteImage, water: ByteImage) -> _WaterContrast:
    """Return the contrast of a whole picture, with zeros where it is too small for any rule."""
    cv2 = opencv()
    red, green, blue = cv2.split(cv2.absdiff(rgb, water))
    where = np.flatnonzero(cv2.max(cv2.max(red, green), blue) >= LEAST_DIFFERENCE)
    seen = contrast(rgb.reshape(-1, 3)[where], water.reshape(-1, 3)[where])
    planes = [np.zeros(rgb.shape[:2], np.float32) for _ in range(4)]
    for plane, values in zip(planes, (seen.whiteness, seen.colour, seen.warmth, seen.tint), strict=True):
        plane.ravel()[where] = values
    return _WaterContrast(*planes)


def contrast(rgb: ByteImage, water: ByteImage) -> _WaterContrast:
    """Split the difference of pixels (…, 3) from the local water colour into whiteness and colour."""
    levels = np.moveaxis(water, -1, 0).astype(np.float32, order="C")
    to_white = 255.0 - levels
    difference = np.moveaxis(rgb, -1, 0).astype(np.float32, order="C") - levels
    length2 = np.maximum(_dot(to_white, to_white), 1.0)
    whiteness: GreyPlane = np.divide(_dot(difference, to_white), length2)
    distance2 = _dot(difference, difference) - whiteness * whiteness * length2
    return _WaterContrast(whiteness, np.sqrt(np.maximum(distance2, 0.0)), difference[0] - difference[2],
                          difference[0] - difference[1])  # fmt: skip


def _dot(left: GreyPlane, right: GreyPlane) -> GreyPlane:
    """Return the sum of products over three channels, the first axis. Whole numbers below 2^24 are exact in any
    order.
    """
    product: GreyPlane = left[0] * right[0] + left[1] * right[1] + left[2] * right[2]
    return product


def _blobs(seen: _WaterContrast, marks: _Marked, metres_per_px: float, gap_px: int) -> Iterator[_ColourPatch]:
    """Yield patches with enough marked pixels, inside the picture and of the length of a person.

    Pieces at most `gap_px` apart form one patch.
    """
    cv2 = opencv()
    patches = marks.patches.astype(np.uint8)
    joined = cv2.dilate(patches, np.ones((gap_px + 1, gap_px + 1), np.uint8)) if gap_px else patches
    count, labels, stats, _ = cv2.connectedComponentsWithStats(joined, connectivity=8)
    own_counts = np.bincount(labels[marks.patches], minlength=count)
    marked_counts = np.bincount(labels[marks.marked & marks.patches], minlength=count)
    height, width = patches.shape
    least, _, _, most = marks.rules["length_m"]
    longest = stats[:, 2:4].max(axis=1)
    likely = (marked_counts >= WARM_LEAST) & (longest <= most / metres_per_px + gap_px)
    likely &= (longest >= least / metres_per_px) & (marked_counts > marks.rules["marked"][0] * own_counts)
    for label in np.flatnonzero(likely[1:]).tolist():
        x, y, wide, high = (int(value) for value in stats[label + 1, :4])
        window = (slice(y, y + high), slice(x, x + wide))
        own = (labels[window] == label + 1) & marks.patches[window]
        rows, columns = np.flatnonzero(own.any(axis=1)), np.flatnonzero(own.any(axis=0))
        x0, y0, x1, y1 = x + columns[0], y + rows[0], x + columns[-1] + 1, y + rows[-1] + 1
        if x0 == 0 or y0 == 0 or x1 == width or y1 == height:
            continue
        mask: MaskArray = own[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
        inside = (slice(y0, y1), slice(x0, x1))
        whiteness, colour = seen.whiteness[inside][mask], seen.colour[inside][mask]
        measures = {
            "pale": float(((whiteness > PALE) & (colour < PALE_COLOUR)).mean()),
            "brightest": float(whiteness.max()),
            "marked": float(marked_counts[label + 1]) / float(mask.sum()),
            "whiteness": float(whiteness.mean()),
            "colour": float(colour.mean()),
            "strongest": float(colour.max()),
        }
        if _likelihood(measures, {name: marks.rules[name] for name in measures if name in marks.rules}) > 0.0:
            measures |= measure(mask, metres_per_px)
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


def _likelihood(measures: dict[str, float], rules: dict[str, Corners]) -> float:
    """Return the membership of a patch in the class of people, 0 to 1: the product over all measures."""
    product = 1.0
    for name, corners in rules.items():
        product *= _membership(measures[name], corners)
    return product


def _membership(value: float, corners: Corners) -> float:
    return float(np.interp(value, corners, (0.0, 1.0, 1.0, 0.0)))
