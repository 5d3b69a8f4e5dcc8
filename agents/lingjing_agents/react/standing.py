"""Rectangles around what stands on the ground in a depth picture from above: obstacles in words, for a walker's path.

A table of depths at equal distances cannot show a gap between two houses or a parked car, so that no path can be
planned by it. The heights of all pixels are sorted into a grid of metres. Few rectangles along the axes, with sides of
whole metres, cover the cells above the ground.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from lingjing.plugins.policy import Picture
from lingjing_agents.perception.depth_points import heights
from lingjing_agents.perception.images import FloatArray, MaskArray, opencv

CELL_M = 1.0
"""Side of a grid cell in metres. Chosen: a gap that a walker passes is two cells wide."""

STANDS_M = 0.4
"""Height above the ground in metres from which on something stands: a dog steps over lower things."""

HIGHEST_M = 1.0
"""Height in metres of the highest thing, at least: ripples of calm water are lower. Chosen."""

STRIDE_PX = 4
"""Sampling interval of pixels. At 120 m a pixel of the shipped cameras covers 0.11 m."""

FLAT_M, FLAT_SHARE = 0.1, 0.2
"""Half height in metres of the layer that is taken as the ground, and the least share of points in it. Waves and slopes
have no such layer. Chosen."""

MOST, MOST_POSTS = 110, 30
"""Number of rectangles and of posts, at most: some 2,300 tokens. Chosen: with 80 the parked cars of a street were left
out, and a dog walked into them."""

GAP_CELLS = 3
"""Side in cells of the closing that joins things with less than two metres between them: no walker passes there, and a
row of cars becomes one rectangle. Chosen."""

EMPTY_CELLS = (8, 16, 24, 36)
"""Free cells of a rectangle, at most; the first number that needs at most `MOST` rectangles counts. Chosen."""

SMALLEST_CELLS = 2
"""Side in cells of a rectangle that is not divided further."""

LEAST_CELLS = 3
"""Occupied cells of a thing with a rectangle, at least. Smaller ones are posts: lamps and signs. Chosen."""


@dataclass(frozen=True, slots=True)
class Standing:
    """The obstacles of one picture."""

    ground_m: float
    """Elevation of the ground in metres."""
    rectangles: tuple[tuple[int, int, int, int, int], ...]
    """West, south, east, north and elevation of the top, whole metres, the largest first."""
    left_out: int
    """Number of smaller rectangles beyond `MOST`."""
    posts: tuple[tuple[int, int], ...] = ()
    """East and north of lamps and signs, whole metres, those nearest to the middle of the picture."""


def standing(picture: Picture) -> Standing | None:
    """Return what stands in a picture from above; None without depth and without level ground."""
    if picture.depth is None:
        return None
    points = heights(picture.depth, picture.pose, 0.0, STRIDE_PX)
    ground_m = _ground_m(points[:, 2])
    if ground_m is None:
        return None
    west, south = math.floor(points[:, 0].min()), math.floor(points[:, 1].min())
    column, row = ((points[:, axis] - low).astype(np.int64) for axis, low in ((0, west), (1, south)))
    tops = np.full((row.max() + 1, column.max() + 1), -np.inf)
    np.maximum.at(tops, (row, column), points[:, 2])
    if tops.max() < ground_m + HIGHEST_M:
        return Standing(ground_m, (), 0)
    occupied = _joined(tops > ground_m + STANDS_M)
    boxes: list[tuple[int, int, int, int]] = []
    for empty in EMPTY_CELLS:
        boxes = _cover(occupied, empty)
        if len(boxes) <= MOST:
            break
    boxes.sort(key=lambda box: (-(box[2] - box[0]) * (box[3] - box[1]), box))
    rectangles = tuple(
        (west + x0, south + y0, west + x1, south + y1, round(_top_m(tops, (x0, y0, x1, y1))))
        for x0, y0, x1, y1 in boxes[:MOST]
    )
    middle = np.array(picture.pose.position[:2])
    posts = sorted(_posts(occupied, (west, south)), key=lambda post: (float(np.hypot(*(middle - post))), post))
    return Standing(ground_m, rectangles, max(0, len(boxes) - MOST), tuple(sorted(posts[:MOST_POSTS])))


def _top_m(tops: FloatArray, box: tuple[int, int, int, int]) -> float:
    """Return the elevation of the top in a box of cells. A box in a gap between two things, of which the picture shows
    no point, has that of the things."""
    x0, y0, x1, y1 = box
    top_m = float(tops[y0:y1, x0:x1].max())
    if math.isfinite(top_m):
        return top_m
    return float(tops[max(y0 - GAP_CELLS, 0) : y1 + GAP_CELLS, max(x0 - GAP_CELLS, 0) : x1 + GAP_CELLS].max())


def _posts(occupied: MaskArray, corner: tuple[int, int]) -> list[tuple[int, int]]:
    """Return the places of things that are too small for a rectangle."""
    count, _, measures, middles = opencv().connectedComponentsWithStats(occupied.astype(np.uint8), connectivity=4)
    small = [number for number in range(1, count) if measures[number, opencv().CC_STAT_AREA] < LEAST_CELLS]
    return [(corner[0] + round(middles[number][0]), corner[1] + round(middles[number][1])) for number in small]


def _ground_m(elevations: FloatArray) -> float | None:
    """Return the elevation of the lowest level layer with a large share of the points, or None."""
    if not len(elevations):
        return None
    low = np.floor(elevations.min() / FLAT_M) * FLAT_M
    counts = np.bincount(((elevations - low) / FLAT_M).astype(np.int64), minlength=2)
    layers = counts[:-1] + counts[1:]
    large = np.flatnonzero(layers >= FLAT_SHARE * len(elevations))
    if not len(large):
        return None
    bottom = low + large[0] * FLAT_M
    layer = elevations[(elevations >= bottom) & (elevations <= bottom + 2.0 * FLAT_M)]
    return float(np.median(layer))


def _joined(occupied: MaskArray) -> MaskArray:
    """Return the cells with narrow gaps closed."""
    kernel = np.ones((GAP_CELLS, GAP_CELLS), np.uint8)
    edge = GAP_CELLS  # without a margin the closing would fill the border of the grid
    wide = np.pad(occupied.astype(np.uint8), edge)
    joined: MaskArray = opencv().morphologyEx(wide, opencv().MORPH_CLOSE, kernel)[edge:-edge, edge:-edge] > 0
    return joined


def _cover(occupied: MaskArray, empty: int) -> list[tuple[int, int, int, int]]:
    """Return boxes of cells (x0, y0, x1, y1; ends excluded) that cover all occupied ones, each with at most `empty`
    free cells."""
    _, labels = opencv().connectedComponents(occupied.astype(np.uint8), connectivity=4)
    boxes: list[tuple[int, int, int, int]] = []
    rows, columns = np.nonzero(labels)
    numbers = labels[rows, columns]
    order = np.argsort(numbers, kind="stable")
    starts = np.flatnonzero(np.diff(numbers[order], prepend=0))
    for cells in np.split(order, starts[1:]) if len(starts) else ():
        if len(cells) >= LEAST_CELLS:
            boxes += _divided(rows[cells], columns[cells], empty)
    return boxes


def _divided(rows: np.ndarray, columns: np.ndarray, empty: int) -> list[tuple[int, int, int, int]]:
    """Return the boxes of some cells: their common box, or those of its two parts that together cover the least."""
    x0, x1, y0, y1 = int(columns.min()), int(columns.max()) + 1, int(rows.min()), int(rows.max()) + 1
    wide, high = x1 - x0, y1 - y0
    if wide * high - len(rows) <= empty or max(wide, high) <= SMALLEST_CELLS:
        return [(x0, y0, x1, y1)]
    best: tuple[int, int, int] | None = None
    for axis, (along, low, high_end) in enumerate(((columns, x0, x1), (rows, y0, y1))):
        other = rows if axis == 0 else columns
        size = high_end - low
        if size < 2:
            continue
        least, most = np.full(size, other.max() + 1), np.full(size, other.min() - 1)
        np.minimum.at(least, along - low, other)
        np.maximum.at(most, along - low, other)
        before = _areas(least, most)[:-1]
        after = _areas(least[::-1], most[::-1])[::-1][1:]
        cut = int(np.argmin(before + after))
        option = int((before + after)[cut]), axis, low + cut + 1
        best = option if best is None or option < best else best
    assert best is not None
    _, axis, at = best
    first = (columns if axis == 0 else rows) < at
    return [*_divided(rows[first], columns[first], empty), *_divided(rows[~first], columns[~first], empty)]


def _areas(least: np.ndarray, most: np.ndarray) -> np.ndarray:
    """Return the area of the box of the first 1, 2, … lines; empty lines at the end do not count."""
    held = most >= least
    span = np.maximum.accumulate(most) - np.minimum.accumulate(least) + 1
    numbers = np.arange(len(least))
    first = int(np.argmax(held))
    last = np.maximum.accumulate(np.where(held, numbers, -1))
    areas: np.ndarray = np.where(last >= 0, (last - first + 1) * span, 0)
    return areas
