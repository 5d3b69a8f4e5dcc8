"""Leaks in pictures from above: a rusty clamp on a pipe with a white spray beside it over wet ground.

Roofs, cars and crates are rust-coloured too, and pipes are as white as water. Only a leak has a small rusty object with
a fan of white specks beside it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from lingjing.plugins.geometry import focal_px, pixel_to_plane
from lingjing.plugins.policy import CameraPose, Vector
from lingjing_agents.perception.images import ByteImage, ImageBox, MaskArray, PixelBox, opencv

Metres = npt.NDArray[np.floating]
"""Distances in metres, (n,)."""

CLAMP_M = (0.25, 2.2)
"""Smallest and largest clamp in metres. Chosen."""
SPRAY_M = (1.2, 9.0)
"""Shortest and longest spray in metres. Chosen."""
RUN_M, BIN_M = 10.0, 0.2
"""Distance in metres to both sides of a clamp along which its pipe is followed, and width of the strips beside the
axis.
"""

LEAST_M2 = 0.15
"""Least area of a spray in square metres. Chosen."""
GAP_M = 0.4
"""Gap in metres across which specks are joined. Chosen."""
TOUCH_M = 2.0
"""Largest distance in metres between a clamp and its spray. Chosen."""
PART = 0.3
"""Share of the largest patch below which a patch is noise."""

PIPE_M = 1.4
"""Height of pipes above the ground in metres."""

WHITE, OVER, PALE = 172.0, 32.0, 45
"""Least grey level of the darkest channel of white, its least excess over the ground, and largest difference of
channels.
"""

SPECKS = 1.0
"""Square metres of specks for full confidence. Chosen."""


@dataclass(frozen=True, slots=True)
class PipeLeak:
    """A detected leak of a pipeline."""

    box: ImageBox
    """Normalised x0, y0, x1, y1."""
    place: Vector
    """The position of the clamp in metres."""
    confidence: float
    """Confidence of the detection, 0 to 1."""


def find_leaks(rgb: ByteImage, pose: CameraPose, ground_m: float) -> tuple[PipeLeak, ...]:
    """Return the leaks in a nadir picture (height, width, 3), highest confidence first; `ground_m` is the ground's
    elevation.
    """
    above = pose.position[2] - ground_m - PIPE_M
    if above <= 2.0 or not rgb.any():
        return ()
    metres = above / focal_px(pose)
    clamps = _clamps(rgb, metres)
    if not clamps:
        return ()
    low, high = rgb.min(axis=2), rgb.max(axis=2)
    white: MaskArray = (low > max(WHITE, float(np.median(low)) + OVER)) & (high - low < PALE)
    leaks = []
    for clamp in clamps:
        spray = _spray(white, clamp, metres)
        place = pixel_to_plane(pose, (clamp[0] + clamp[2]) / 2, (clamp[1] + clamp[3]) / 2, ground_m + PIPE_M)
        if spray is None or place is None:
            continue
        x0, y0, x1, y1 = _union(clamp, spray[0])
        box = (x0 / pose.width, y0 / pose.height, x1 / pose.width, y1 / pose.height)
        leaks.append(PipeLeak(box, place, min(1.0, spray[1] * metres**2 / SPECKS)))
    return tuple(sorted(leaks, key=lambda leak: (-leak.confidence, leak.box)))


def _clamps(rgb: ByteImage, metres: float) -> list[PixelBox]:
    red, green, blue = (rgb[..., index].astype(np.int16) for index in range(3))
    rusty = (red - blue > 50) & (red - green > 22) & (red > 80)
    patches = _patches(rusty, round(CLAMP_M[0] / metres))
    return [edges for edges, _ in patches if _within(edges, metres, CLAMP_M)]


def _spray(white: MaskArray, clamp: PixelBox, metres: float) -> tuple[PixelBox, int] | None:
    """Return the fan of white specks beside a clamp with its number of pixels, or None.

    The fan is the white near the clamp that does not belong to the stripes along the pipe's axis.
    """
    u, v = (clamp[0] + clamp[2]) / 2, (clamp[1] + clamp[3]) / 2
    reach = round(RUN_M / metres)
    x0, y0 = max(0, round(u) - reach), max(0, round(v) - reach)
    window = white[y0 : round(v) + reach, x0 : round(u) + reach]
    rows, columns = np.nonzero(window)
    east, south = (columns + x0 - u) * metres, (rows + y0 - v) * metres
    axis = _axis(east, south)
    along, across = east * np.cos(axis) + south * np.sin(axis), south * np.cos(axis) - east * np.sin(axis)
    stripes = _stripes(along, across, metres)
    bins = np.floor((across + RUN_M) / BIN_M).astype(np.int64)
    fan = ~stripes[np.clip(bins, 0, len(stripes) - 1)] & (np.hypot(along, across) < SPRAY_M[1])
    own = np.zeros_like(window)
    own[rows[fan], columns[fan]] = True
    patches = sorted(_patches(own, round(GAP_M / metres)), key=lambda patch: (-patch[1], patch[0]))
    shifted = (clamp[0] - x0, clamp[1] - y0, clamp[2] - x0, clamp[3] - y0)
    fan_edges, total = shifted, 0
    big = [patch for patch in patches if patch[1] >= PART * patches[0][1]]
    for _ in big:  # a neighbouring pipe may divide the fan
        near = [patch for patch in big if _gap(fan_edges, patch[0]) * metres <= TOUCH_M]
        for edges, count in near:
            fan_edges, total = _union(fan_edges, edges), total + count
        big = [patch for patch in big if patch not in near]
    if total * metres**2 < LEAST_M2 or not _within(fan_edges, metres, SPRAY_M):
        return None
    return (fan_edges[0] + x0, fan_edges[1] + y0, fan_edges[2] + x0, fan_edges[3] + y0), total


def _axis(east: Metres, south: Metres) -> float:
    """Return the direction (radians) of the pipe through the clamp: that with the most white at a distance."""
    far = (np.hypot(east, south) > 2.0) & (np.hypot(east, south) < RUN_M)
    angles = np.radians(np.arange(0, 180, 2))
    counts = [int((np.abs(south[far] * np.cos(a) - east[far] * np.sin(a)) < 0.35).sum()) for a in angles]
    return float(angles[int(np.argmax(counts))])


def _stripes(along: Metres, across: Metres, metres: float) -> MaskArray:
    """Return the mask of strips of `BIN_M` metres beside the axis that are white along their whole length."""
    count = int(2 * RUN_M / BIN_M) + 1
    bins = np.clip(np.floor((across + RUN_M) / BIN_M).astype(np.int64), 0, count - 1)
    stripe = np.zeros(count, bool)
    for side in (-1.0, 1.0):
        far = (along * side > SPRAY_M[1] * 0.6) & (along * side < RUN_M)
        stripe |= np.bincount(bins[far], minlength=count) > 0.25 * BIN_M * RUN_M * 0.5 / metres**2
    grown: MaskArray = stripe | np.roll(stripe, 1) | np.roll(stripe, -1)
    grown[count // 2 - 2 : count // 2 + 3] = True
    return grown


def _patches(mask: MaskArray, join_px: int) -> list[tuple[PixelBox, int]]:
    """Return edges and pixel count of connected patches after gaps up to `join_px` are closed."""
    cv2 = opencv()
    joined = cv2.dilate(mask.astype(np.uint8), _square(join_px)) if join_px > 1 else mask.astype(np.uint8)
    count, labels, stats, _ = cv2.connectedComponentsWithStats(joined, connectivity=8)
    pixels = np.bincount(labels[mask], minlength=count)
    margin = (join_px - 1) // 2 if join_px > 1 else 0
    return [
        ((x + margin, y + margin, x + wide - margin, y + high - margin), int(pixels[label]))
        for label, (x, y, wide, high, _) in enumerate(stats.tolist())
        if label and pixels[label] > 2
    ]


def _square(side: float) -> ByteImage:
    return np.ones((max(1, round(side)),) * 2, np.uint8)


def _within(edges: PixelBox, metres: float, span: tuple[float, float]) -> bool:
    return span[0] <= max(edges[2] - edges[0], edges[3] - edges[1]) * metres <= span[1]


def _gap(a: PixelBox, b: PixelBox) -> float:
    wide = max(a[0] - b[2], b[0] - a[2], 0)
    high = max(a[1] - b[3], b[1] - a[3], 0)
    return float(np.hypot(wide, high))


def _union(a: PixelBox, b: PixelBox) -> PixelBox:
    return min(a[0], b[0]), min(a[1], b[1]), max(a[2], b[2]), max(a[3], b[3])
