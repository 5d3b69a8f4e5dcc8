"""Which buildings ahead look like the one in a reference picture: facades of its colour, with windows.

A wall is either in the sun or in shade, and the reference picture shows one of the two: both colours are looked for.
Windows tell walls from clouds, fences and pavements. How high a facade reaches over the horizon tells roughly how far
it is.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from lingjing.plugins.geometry import bearing_deg, focal_px, pixel_ray
from lingjing.plugins.policy import CameraPose
from lingjing_agents.perception.images import ByteImage, GreyPlane, MaskArray

COLUMNS = 64
LOWEST_DEG = 1.2
"""A facade that rises less over the horizon is too far, or a wall."""

HEIGHT_M = 20.0
SUN = (1.67, 1.56, 1.44)
"""By how much the sun brightens a wall's red, green and blue against the shade on a clear day."""

LIT, SHADED = 13.0, 9.0
"""How far each channel may be from the wanted colour (0..255), in the sun and in shade."""

BRIGHTEST = 246.0
"""No wall is brighter: a reference that would be in the sun is in the sun already."""

DOUBT = 0.3
"""What shaded walls count: many greys look like them."""

WINDOWS = 2


@dataclass(frozen=True, slots=True)
class WallColour:
    """What to look for: the wall's mean colour (0..255) in the reference picture."""

    red: float
    green: float
    blue: float


@dataclass(frozen=True, slots=True)
class FacadeColumn:
    """What one column shows: its bearing (degrees), the rough distance (m) and how much it looks wanted (0..1)."""

    bearing_deg: float
    distance_m: float
    likeness: float


def look_of(rgb: ByteImage) -> WallColour:
    """The colour of the wall that fills most of a reference picture's upper middle."""
    height, width = rgb.shape[:2]
    wall = rgb[height // 8 : height * 5 // 8, width // 6 : width * 5 // 6].reshape(-1, 3).astype(np.float32)
    bright = wall.sum(axis=1)
    upper = wall[bright >= np.percentile(bright, 45)]
    red, green, blue = (float(value) for value in np.median(upper, axis=0))
    return WallColour(red, green, blue)


def skyline(rgb: ByteImage, pose: CameraPose) -> tuple[tuple[float, float], ...]:
    """For each column its bearing and how high (degrees over the horizon) what stands there hides the sky."""
    strip = rgb.shape[1] // COLUMNS
    part = rgb[::2, : strip * COLUMNS].reshape(-1, COLUMNS, strip, 3).astype(np.float32).mean(axis=2)
    red, blue = part[..., 0], part[..., 2]
    sky = (blue > 140.0) & (blue >= red - 4.0) & (blue + red > 270.0)
    rows = np.where(sky.all(axis=0), len(sky), np.argmin(sky, axis=0)) * 2
    found = []
    for index, row in enumerate(rows.tolist()):
        ray = pixel_ray(pose, (index + 0.5) * strip, float(row))
        elevation = math.degrees(math.atan2(ray[2], math.hypot(ray[0], ray[1])))
        found.append((bearing_deg((0.0, 0.0), ray), elevation))
    return tuple(found)


def find_facades(rgb: ByteImage, pose: CameraPose, look: WallColour) -> tuple[FacadeColumn, ...]:
    """The columns of a front picture that show a wall of the wanted colour with windows in it."""
    height, width = rgb.shape[:2]
    if not rgb.any():
        return ()
    horizon = height / 2.0 - focal_px(pose) * math.tan(math.radians(pose.tilt_deg))
    low = int(min(max(horizon - focal_px(pose) * math.tan(math.radians(0.3)), 8), height))
    strip = width // COLUMNS
    band = rgb[:low].astype(np.float32)[:, : strip * COLUMNS]
    alike = likeness(band, look)
    found = []
    for index in range(COLUMNS):
        part = alike[:, index * strip : (index + 1) * strip]
        column = (part > 0.0).mean(axis=1) > 0.5
        top, share, windows = _wall(column)
        u = (index + 0.5) * strip
        ray = pixel_ray(pose, u, float(top))
        elevation = math.degrees(math.atan2(ray[2], math.hypot(ray[0], ray[1])))
        if elevation < LOWEST_DEG or share < 0.25 or windows < WINDOWS:
            continue
        lit = float(part[part > 0.0].mean())
        distance = HEIGHT_M / math.tan(math.radians(min(elevation, 60.0)))
        found.append(FacadeColumn(bearing_deg((0.0, 0.0), ray), distance, lit * min(1.0, share * 1.5)))
    return tuple(found)


def likeness(rgb: GreyPlane, look: WallColour) -> GreyPlane:
    """1 where a pixel has the wall's colour in the sun, `DOUBT` where it has that in shade, else 0."""
    lit, shaded = _lights(look)
    in_sun = (np.abs(rgb - np.array(lit, np.float32)) < LIT).all(axis=2)
    in_shade = (np.abs(rgb - np.array(shaded, np.float32)) < SHADED).all(axis=2)
    best: GreyPlane = np.where(in_sun, 1.0, np.where(in_shade, DOUBT, 0.0)).astype(np.float32)
    return best


def _lights(look: WallColour) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """The wall's colour in the sun and in shade, whichever of the two the reference picture shows: walls in shade are
    bluish, as the sky that lights them."""
    here = (look.red, look.green, look.blue)
    brighter = tuple(value * factor for value, factor in zip(here, SUN, strict=True))
    if max(brighter) <= BRIGHTEST:
        return brighter, here
    return here, tuple(value / factor for value, factor in zip(here, SUN, strict=True))


def _wall(column: MaskArray) -> tuple[int, float, int]:
    """Top row of the lowest run of wall with gaps no longer than a window row, its share of wall, and how many
    windows it has. Rows count from the top; the last is the lowest."""
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
