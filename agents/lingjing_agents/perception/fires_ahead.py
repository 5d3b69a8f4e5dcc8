"""Flames in a front picture, with their positions on the ground.

Flames are the brightest saturated orange and yellow, and their tongues differ from pixel to pixel. Rust, crates and
roofs are duller or redder and have no hot yellow core; lamps are smooth. The distance of a near fire follows from the
row of its base below the horizon, that of a far fire from the height of its flames.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from lingjing.plugins.geometry import bearing_deg, camera_axes, focal_px, pixel_ray
from lingjing.plugins.policy import CameraPose
from lingjing_agents.ground_plane import GroundPoint
from lingjing_agents.perception.images import ByteImage, ImageBox, PixelBox, opencv
from lingjing_agents.perception.people_at_sea import FoundBox

FLAME_M = 1.75
"""Usual height in metres of the flames of a fire on the ground."""

EMBERS = 0.02
"""Share of the flames' height that is added below them for the fuel, in the box only: one more row at the base would
reduce a distance by a third.
"""

HALF = 0.5
"""Least confidence of another detector's box. Chosen."""

SMALLEST_PX = 9
"""Least number of flame pixels. Chosen."""
FAINT_PX = 3.5
"""Rows at the tips of flames that haze makes invisible."""

SMOOTH, SMOOTH_SMALL, SMALL_ROWS, MEASURED_ROWS = 4.0, 9.5, (30, 80), 720
"""Mean difference in green of pixels side by side up to which a patch of many rows, and one of few, is a lamp; rows
between which it changes, in a picture of so many rows. Measured at tier 1 on seeds 0 to 4: 5 and more for fires of more
than 80 rows and 17 and more for small ones, 2 and less for lamps of more than 60 rows and 8 and less for small ones."""

NEAR_M = 9.0
"""Distance in metres below which the base determines the distance, and above which the height does."""


@dataclass(frozen=True, slots=True)
class FireAhead:
    """A fire in a front picture."""

    box: ImageBox
    """Normalised x0, y0, x1, y1."""
    bearing_deg: float
    """The bearing in degrees."""
    distance_m: float
    """The estimated distance from the camera in metres."""
    place: GroundPoint
    """Estimated east and north in metres."""
    confidence: float
    """Confidence of the detection, 0 to 1."""


def find_fires_ahead(rgb: ByteImage, pose: CameraPose, ground_m: float = 0.0) -> tuple[FireAhead, ...]:
    """Return the fires in a front picture (height, width, 3), the nearest first; `ground_m` is the ground's
    elevation.
    """
    cv2 = opencv()
    red, green, blue = (rgb[..., index].astype(np.int16) for index in range(3))
    flame = (red > 185) & (red - blue > 85) & (green - blue > 15) & (red - green > 10)
    hot = (red > 215) & (red - blue > 110)
    if int(flame.sum()) < SMALLEST_PX:
        return ()
    joined = cv2.dilate(flame.astype(np.uint8), np.ones((5, 5), np.uint8))
    count, labels, stats, _ = cv2.connectedComponentsWithStats(joined, connectivity=8)
    pixels = np.bincount(labels[flame], minlength=count)
    heat = np.bincount(labels[flame & hot], minlength=count)
    beside = flame[:, 1:] & flame[:, :-1]
    pairs = np.bincount(labels[:, 1:][beside], minlength=count)
    steps = np.bincount(labels[:, 1:][beside], np.abs(np.diff(green, axis=1))[beside], minlength=count)
    patches = [
        _Patch(
            (x + 2, y + 2, x + wide - 2, y + high - 2),
            int(pixels[label]),
            int(heat[label]),
            int(pairs[label]),
            float(steps[label]),
        )
        for label, (x, y, wide, high, _) in enumerate(stats.tolist())
        if label and pixels[label] >= SMALLEST_PX
    ]
    fires = []
    for patch in _gathered(patches):
        fire = _judged(patch, pose, ground_m)
        if fire is not None:
            fires.append(fire)
    return tuple(sorted(fires, key=lambda fire: (fire.distance_m, fire.box)))


@dataclass(frozen=True, slots=True)
class _Patch:
    """A connected patch of flame."""

    edges: PixelBox
    """Its box in pixels."""
    pixels: int
    """Number of flame pixels."""
    heat: int
    """Number of hot pixels."""
    pairs: int
    """Number of flame pixels with one on their left."""
    steps: float
    """Sum of their differences in green."""


def _gathered(patches: list[_Patch]) -> list[_Patch]:
    """Merge the tongues of one fire: patches that are closer than half the height of the higher one."""
    left = sorted(patches, key=lambda patch: (-patch.pixels, patch.edges))
    fires: list[_Patch] = []
    while left:
        fire, merged = left.pop(0), True
        while merged:
            near = [patch for patch in left if _touching(fire.edges, patch.edges)]
            merged = bool(near)
            left = [patch for patch in left if patch not in near]
            for patch in near:
                a, b = fire.edges, patch.edges
                edges = (min(a[0], b[0]), min(a[1], b[1]), max(a[2], b[2]), max(a[3], b[3]))
                fire = _Patch(edges, fire.pixels + patch.pixels, fire.heat + patch.heat, fire.pairs + patch.pairs,
                              fire.steps + patch.steps)  # fmt: skip
        fires.append(fire)
    return fires


def _touching(a: PixelBox, b: PixelBox) -> bool:
    gap = 0.5 * max(a[3] - a[1], b[3] - b[1])
    return a[0] - gap < b[2] and b[0] - gap < a[2] and a[1] - gap < b[3] and b[1] - gap < a[3]


def _judged(patch: _Patch, pose: CameraPose, ground_m: float) -> FireAhead | None:
    x0, y0, x1, y1 = patch.edges
    pixels, heat = patch.pixels, patch.heat
    wide, high = x1 - x0, y1 - y0
    cut = x0 <= 2 or y0 <= 2 or x1 >= pose.width - 2 or y1 >= pose.height - 2
    if heat < 0.2 * pixels or (wide > 2.5 * high + 4 and not cut) or pixels < 0.12 * wide * high:
        return None  # a stripe, scattered specks or a dull object
    rows = high * MEASURED_ROWS / pose.height
    share = min(1.0, max(0.0, (rows - SMALL_ROWS[0]) / (SMALL_ROWS[1] - SMALL_ROWS[0])))
    if patch.steps <= (SMOOTH_SMALL + share * (SMOOTH - SMOOTH_SMALL)) * patch.pairs:
        return None  # a lamp, or a column of pixels
    foot = min(float(pose.height), y1 + EMBERS * high)
    left, top, right, low = (
        max(0.0, x0 - 1.0),
        max(0.0, y0 - 1.0),
        min(x1 + 1.0, pose.width),
        min(foot + 1.0, pose.height),
    )
    box = (left / pose.width, top / pose.height, right / pose.width, low / pose.height)
    confidence = min(1.0, 0.3 + 0.4 * heat / pixels + 0.3 * min(1.0, pixels / 80.0))
    return _placed(pose, patch.edges, box, confidence, ground_m)


def fires_in_boxes(finds: Iterable[FoundBox], pose: CameraPose, ground_m: float) -> tuple[FireAhead, ...]:
    """Return the fires of another detector's boxes with a confidence of at least `HALF`, the nearest first.

    The distances follow from the boxes as they would from flames.
    """
    fires = []
    for find in finds:
        if find.confidence < HALF:
            continue
        x0, y0, x1, y1 = (share * side for share, side in zip(find.box, (pose.width, pose.height) * 2, strict=True))
        high = max(1.0, (y1 - y0 - 2.0) / (1.0 + EMBERS))
        fires.append(_placed(pose, (x0, y0 + 1.0, x1, y0 + 1.0 + high), find.box, find.confidence, ground_m))
    return tuple(sorted(fires, key=lambda fire: (fire.distance_m, fire.box)))


def _placed(
    pose: CameraPose, edges: tuple[float, float, float, float], box: ImageBox, confidence: float, ground_m: float
) -> FireAhead:
    """Return the fire with flames at these edges (pixels)."""
    x0, y0, x1, y1 = edges
    ray = pixel_ray(pose, (x0 + x1) / 2.0, (y0 + y1) / 2.0)
    bearing = bearing_deg((0.0, 0.0), ray)
    distance = _distance_m(pose, y1 - y0, float(y1), (x0 + x1) / 2.0, ground_m)
    place = (
        pose.position[0] + distance * math.sin(math.radians(bearing)),
        pose.position[1] + distance * math.cos(math.radians(bearing)),
    )
    return FireAhead(box, bearing, distance, place, confidence)


def _distance_m(pose: CameraPose, high_px: float, foot_px: float, u: float, ground_m: float) -> float:
    """Return the horizontal distance of a fire with flames of height `high_px` that end at row `foot_px`."""
    ray = pixel_ray(pose, u, pose.height / 2.0)
    _, _, forward = camera_axes(pose)
    slant = math.hypot(ray[0], ray[1]) / max(1e-6, math.hypot(forward[0], forward[1]))
    by_size = focal_px(pose) * FLAME_M / (high_px + FAINT_PX) * slant
    down = pixel_ray(pose, u, min(foot_px, float(pose.height)))
    above = pose.position[2] - ground_m
    if down[2] >= -1e-3 or above <= 0.0:
        return by_size
    by_foot = above / -down[2] * math.hypot(down[0], down[1])
    return by_foot if by_foot < NEAR_M and by_size < 2.0 * NEAR_M else by_size
