"""Buildings ahead that resemble the one in a reference picture: facades of its colour, with windows.

A wall is in the sun or in shade, and the reference picture shows one of the two, so both colours are searched for.
Windows distinguish walls from clouds, fences and pavements. The height of a facade above the horizon gives its rough
distance.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from lingjing.plugins.geometry import bearing_deg, focal_px, pixel_ray
from lingjing.plugins.policy import CameraPose
from lingjing_agents.perception.images import ByteImage, GreyPlane, ImageBox, MaskArray

COLUMNS = 64
"""Number of vertical strips of a picture. Chosen."""
LOWEST_DEG = 1.2
"""Least elevation in degrees of a facade's top; lower ones are too far away or garden walls. Chosen."""

HEIGHT_M = 20.0
"""Assumed height of a building in metres. Chosen."""
SUN = (1.67, 1.56, 1.44)
"""Ratio of a wall's red, green and blue in the sun to those in shade on a clear day."""

LIT, SHADED = 13.0, 9.0
"""Largest difference of each channel (0 to 255) from the expected colour, in the sun and in shade."""

BRIGHTEST = 246.0
"""Highest channel value of a wall. A reference that would exceed it in the sun is already in the sun."""

DOUBT = 0.3
"""Weight of walls in shade: many grey objects resemble them. Chosen."""

GAP_COLUMNS, HIGHEST, FOOT_DEG = 2, 20, 0.5
"""Distance of two neighbouring columns of one wall, at most; percentile of the columns' tops that is the top of its
box; and angle in degrees between the horizon and its foot. Chosen."""

WINDOWS = 2
"""Least number of window rows. Chosen."""


@dataclass(frozen=True, slots=True)
class WallColour:
    """The mean colour of a wall in a reference picture, 0 to 255."""

    red: float
    """Red."""
    green: float
    """Green."""
    blue: float
    """Blue."""


@dataclass(frozen=True, slots=True)
class FacadeColumn:
    """A facade in one column of a picture."""

    bearing_deg: float
    """Its bearing in degrees."""
    distance_m: float
    """Its rough distance in metres."""
    likeness: float
    """Its similarity to the reference, 0 to 1."""


def look_of(rgb: ByteImage) -> WallColour:
    """Return the colour of the wall in a reference picture's upper centre."""
    height, width = rgb.shape[:2]
    wall = rgb[height // 8 : height * 5 // 8, width // 6 : width * 5 // 6].reshape(-1, 3).astype(np.float32)
    bright = wall.sum(axis=1)
    upper = wall[bright >= np.percentile(bright, 45)]
    red, green, blue = (float(value) for value in np.median(upper, axis=0))
    return WallColour(red, green, blue)


def skyline(rgb: ByteImage, pose: CameraPose) -> tuple[tuple[float, float], ...]:
    """Return for each column its bearing and the elevation of its skyline, in degrees."""
    strip = rgb.shape[1] // COLUMNS
    part = rgb[::2, : strip * COLUMNS].reshape(-1, COLUMNS, strip, 3).astype(np.float32).mean(axis=2)
    red, blue = part[..., 0], part[..., 2]
    sky = (blue > 140.0) & (blue >= red - 4.0) & (blue + red > 270.0)
    rows = np.where(sky.all(axis=0), len(sky), np.argmin(sky, axis=0)) * 2
    columns = []
    for index, row in enumerate(rows.tolist()):
        ray = pixel_ray(pose, (index + 0.5) * strip, float(row))
        elevation = math.degrees(math.atan2(ray[2], math.hypot(ray[0], ray[1])))
        columns.append((bearing_deg((0.0, 0.0), ray), elevation))
    return tuple(columns)


def find_facades(rgb: ByteImage, pose: CameraPose, look: WallColour) -> tuple[FacadeColumn, ...]:
    """Return the columns of a front picture with a wall of the reference's colour and with windows."""
    strip = rgb.shape[1] // COLUMNS
    columns = []
    for index, top, weight in _columns(rgb, pose, look):
        ray = pixel_ray(pose, (index + 0.5) * strip, float(top))
        elevation = math.degrees(math.atan2(ray[2], math.hypot(ray[0], ray[1])))
        if elevation >= LOWEST_DEG:
            distance = HEIGHT_M / math.tan(math.radians(min(elevation, 60.0)))
            columns.append(FacadeColumn(bearing_deg((0.0, 0.0), ray), distance, weight))
    return tuple(columns)


def facade_box(rgb: ByteImage, pose: CameraPose, look: WallColour) -> ImageBox | None:
    """Return the box of the largest wall of the reference's colour with windows; None without one.

    Its columns are neighbours, with at most `GAP_COLUMNS` between two, behind a tree or a lamp. Its foot is assumed
    just below the horizon, because a low camera sees the ground in front of a wall in few rows.
    """
    height, width = rgb.shape[:2]
    runs: list[list[tuple[int, int]]] = []
    for index, top, _ in _columns(rgb, pose, look):
        if not runs or index - runs[-1][-1][0] > GAP_COLUMNS:
            runs.append([])
        runs[-1].append((index, top))
    foot = min(1.0, (_horizon(pose) + focal_px(pose) * math.tan(math.radians(FOOT_DEG))) / height)
    strip = width // COLUMNS
    boxes = [
        (run[0][0] * strip / width, float(np.percentile([top for _, top in run], HIGHEST)) / height,
         (run[-1][0] + 1) * strip / width, foot)
        for run in runs
    ]  # fmt: skip
    return max(boxes, key=lambda box: ((box[2] - box[0]) * (box[3] - box[1]), box), default=None)


def _columns(rgb: ByteImage, pose: CameraPose, look: WallColour) -> Iterator[tuple[int, int, float]]:
    """Yield index, top row and weight of the columns with a wall of the reference's colour and with windows."""
    if not rgb.any():
        return
    height, width = rgb.shape[:2]
    low = int(min(max(_horizon(pose) - focal_px(pose) * math.tan(math.radians(0.3)), 8), height))
    strip = width // COLUMNS
    alike = likeness(rgb[:low].astype(np.float32)[:, : strip * COLUMNS], look)
    for index in range(COLUMNS):
        part = alike[:, index * strip : (index + 1) * strip]
        top, share, windows = _wall((part > 0.0).mean(axis=1) > 0.5)
        if share >= 0.25 and windows >= WINDOWS:
            yield index, top, float(part[part > 0.0].mean()) * min(1.0, share * 1.5)


def _horizon(pose: CameraPose) -> float:
    """Return the row of the horizon."""
    return pose.height / 2.0 - focal_px(pose) * math.tan(math.radians(pose.tilt_deg))


def likeness(rgb: GreyPlane, look: WallColour) -> GreyPlane:
    """Return 1 for pixels of the wall's colour in the sun, `DOUBT` for its colour in shade, else 0; (height, width)."""
    lit, shaded = _lights(look)
    in_sun = (np.abs(rgb - np.array(lit, np.float32)) < LIT).all(axis=2)
    in_shade = (np.abs(rgb - np.array(shaded, np.float32)) < SHADED).all(axis=2)
    best: GreyPlane = np.where(in_sun, 1.0, np.where(in_shade, DOUBT, 0.0)).astype(np.float32)
    return best


def _lights(look: WallColour) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return the wall's colours in the sun and in shade, derived from the one in the reference picture.

    Walls in shade are bluish, because the sky lights them.
    """
    here = (look.red, look.green, look.blue)
    brighter = tuple(value * factor for value, factor in zip(here, SUN, strict=True))
    if max(brighter) <= BRIGHTEST:
        return brighter, here
    return here, tuple(value / factor for value, factor in zip(here, SUN, strict=True))


def _wall(column: MaskArray) -> tuple[int, float, int]:
    """Return top row, share of wall pixels and number of windows of the lowest wall in a column.

    Gaps up to the height of a row of windows belong to the wall. Rows count from the top.
    """
    rows = np.flatnonzero(column)
    if len(rows) < 6:
        return len(column), 0.0, 0
    gaps = np.diff(rows)
    longest = max(8, int(0.3 * len(column)))
    breaks = np.flatnonzero(gaps > longest)
    first = rows[breaks[-1] + 1] if len(breaks) else rows[0]
    inside = column[first:]
    edges = int((np.diff(inside.astype(np.int8)) == -1).sum())
    return int(first), float(inside.mean()), edges
