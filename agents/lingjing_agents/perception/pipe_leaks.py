"""Leaks in pictures from above: a rusty clamp on a pipe and the white spray that comes out of it over wet ground.

Roofs, cars and crates are rust-coloured, too, and pipes are as white as water; only a leak has a small rusty thing with
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

CLAMP_M = (0.25, 2.2)
SPRAY_M = (1.2, 9.0)
RUN_M, BIN_M = 10.0, 0.2
"""How far to both sides of a clamp its pipe is followed, and how finely what runs beside it is told apart."""

LEAST_M2 = 0.15
GAP_M = 0.4
TOUCH_M = 2.0
PART = 0.3
"""What is smaller than this share of the biggest patch is noise."""

PIPE_M = 1.4
"""How high over the ground pipes run."""

WHITE, OVER, PALE = 172.0, 32.0, 45
"""How bright (grey levels) the darkest channel of white is at least, and how much brighter than the ground; how far
the channels differ at most."""

SPECKS = 1.0
"""Square metres of specks that make a leak sure."""


@dataclass(frozen=True, slots=True)
class PipeLeak:
    """One leak as seen: a normalised box (x0, y0, x1, y1), the clamp's place (m), how sure (0..1)."""

    box: ImageBox
    place: Vector
    confidence: float


def find_leaks(rgb: ByteImage, pose: CameraPose, ground_m: float) -> tuple[PipeLeak, ...]:
    """Leaks in a nadir picture (height, width, 3), the surest first; `ground_m` is the ground's elevation."""
    above = pose.position[2] - ground_m - PIPE_M
    if above <= 2.0 or not rgb.any():
        return ()
    metres = above / focal_px(pose)
    clamps = _clamps(rgb, metres)
    if not clamps:
        return ()
    low, high = rgb.min(axis=2), rgb.max(axis=2)
    white: MaskArray = (low > max(WHITE, float(np.median(low)) + OVER)) & (high - low < PALE)
    found = []
    for clamp in clamps:
        spray = _spray(white, clamp, metres)
        place = pixel_to_plane(pose, (clamp[0] + clamp[2]) / 2, (clamp[1] + clamp[3]) / 2, ground_m + PIPE_M)
        if spray is None or place is None:
            continue
        x0, y0, x1, y1 = _union(clamp, spray[0])
        box = (x0 / pose.width, y0 / pose.height, x1 / pose.width, y1 / pose.height)
        found.append(PipeLeak(box, place, min(1.0, spray[1] * metres**2 / SPECKS)))
    return tuple(sorted(found, key=lambda leak: (-leak.confidence, leak.box)))


def _clamps(rgb: ByteImage, metres: float) -> list[PixelBox]:
    red, green, blue = (rgb[..., index].astype(np.int16) for index in range(3))
    rusty = (red - blue > 50) & (red - green > 22) & (red > 80)
    patches = _patches(rusty, round(CLAMP_M[0] / metres))
    return [edges for edges, _ in patches if _within(edges, metres, CLAMP_M)]


def _spray(white: MaskArray, clamp: PixelBox, metres: float) -> tuple[PixelBox, int] | None:
    """The fan of white specks beside a clamp and how many pixels it has: what is white near the clamp and does not
    belong to the stripes that run along the pipe's axis."""
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
    for _ in big:  # a pipe beside it may cut the fan in two
        near = [patch for patch in big if _gap(fan_edges, patch[0]) * metres <= TOUCH_M]
        for edges, count in near:
            fan_edges, total = _union(fan_edges, edges), total + count
        big = [patch for patch in big if patch not in near]
    if total * metres**2 < LEAST_M2 or not _within(fan_edges, metres, SPRAY_M):
        return None
    return (fan_edges[0] + x0, fan_edges[1] + y0, fan_edges[2] + x0, fan_edges[3] + y0), total


def _axis(east: Metres, south: Metres) -> float:
    """The direction (radians) of the pipe through the clamp: along it lies most white that is some way off."""
    far = (np.hypot(east, south) > 2.0) & (np.hypot(east, south) < RUN_M)
    angles = np.radians(np.arange(0, 180, 2))
    counts = [int((np.abs(south[far] * np.cos(a) - east[far] * np.sin(a)) < 0.35).sum()) for a in angles]
    return float(angles[int(np.argmax(counts))])


def _stripes(along: Metres, across: Metres, metres: float) -> MaskArray:
    """Which strips of `BIN_M` metres beside the axis are white all along, also far from the clamp."""
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
    """Edges and pixel count of what is connected when gaps up to `join_px` are closed."""
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
