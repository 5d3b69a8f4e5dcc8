"""Fire: flames, which are the body of the target, with glow, smoke in the wind and scorched ground.

`heat` (0..1) scales all of it. A fire that is `out` leaves its scorch and a thin white steam.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lingjing.engines.camera.effects.night import darkness, pool
from lingjing.engines.camera.effects.particles import (
    BLOT,
    DROP,
    FLAME,
    Effects,
    Rows,
    billboards,
    chance,
    decal,
    hashed,
    ramp,
    stream,
    wind_of,
)
from lingjing.engines.camera.mesh_rows import Floats
from lingjing.mission.instance import Weather

# Linear colours of flames, glow, smoke (young to old), and light on the ground (chosen).
FLAME_HEART = (0.80, 0.50, 0.10)
GLOW = (0.75, 0.24, 0.03)
SOOT = ((0.024, 0.021, 0.018), (0.085, 0.080, 0.075), (0.21, 0.205, 0.20))
FIRELIGHT = (0.86, 0.46, 0.12)
FLAME_OPACITY = 0.55
"""Opacity of a single flame, 0..1 (chosen)."""
SOFT_WIDE, SOFT_LONG = 1.9, 1.35
"""Ratios of width and length of a soft flame to those of its solid body (chosen)."""
LEAN = 0.12
"""Lean of an old flame, in its lengths for each m/s of the smoke's velocity (chosen)."""
POOL_REACH, LIT_REACH = 3.2, 2.2
"""Radius of a fire's light after dark on the ground and on its smoke, in bed radii plus flame heights (chosen)."""
STEAM = (0.60, 0.61, 0.62)
"""Linear colour of the steam of a fire that is out (chosen)."""


@dataclass(frozen=True, slots=True)
class FireScale:
    """The size of a fire."""

    radius_m: float
    """Radius of its bed, metres."""
    height_m: float
    """Height of its flames, metres."""
    flames: int
    """Number of flames."""
    puffs: int
    """Number of puffs of smoke."""
    life_s: float
    """Lifetime of a puff, seconds."""
    puff_m: float
    """Width of an old puff, metres."""


BUILDING = FireScale(radius_m=3.6, height_m=3.2, flames=110, puffs=130, life_s=15.0, puff_m=7.5)
"""A fire of a building. From 110 m above it has some 70 pixels of flames and a plume ten times as long."""
GROUND = FireScale(radius_m=0.65, height_m=1.35, flames=60, puffs=60, life_s=7.0, puff_m=1.7)
"""A fire on the ground, for a dog at 2 to 20 m."""


def fire(
    seed: int, place: Floats, blaze: FireScale, heat: float, time_s: float, weather: Weather,
    inward: tuple[float, float] = (0.0, 0.0),
) -> Effects:  # fmt: skip
    """Return a fire at a place; `heat` 0 is out.

    Its scorch is shifted by `inward` (m, east and north), so that it lies on the roof.
    """
    size = max(heat, 0.0) ** 0.5
    scorch = decal(
        (float(place[0]) + inward[0], float(place[1]) + inward[1], float(place[2])),
        (2.3 * blaze.radius_m, 2.1 * blaze.radius_m), float(seed % 360), (0.012, 0.011, 0.010), 0.85, BLOT, seed % 97,
    )  # fmt: skip
    if size < 0.05:
        return Effects(_wisps(seed, place, blaze, time_s, weather), scorch)
    smoke = _smoke(seed, place, blaze, size, time_s, weather)
    rows = [_flames(seed, place, blaze, size, time_s, weather), _glow(seed, place, blaze, size, time_s), smoke]
    dark = darkness(weather)
    if dark <= 0.0:
        return Effects(np.concatenate(rows), scorch)
    flicker = 0.88 + 0.12 * float(np.sin(7.0 * time_s + seed % 11))
    light = pool(place, POOL_REACH * (blaze.radius_m + blaze.height_m) * size, FIRELIGHT, dark * flicker)
    rows += [_halo(place, blaze, size, dark * flicker), _lit_smoke(smoke, place, blaze, dark * flicker)]
    return Effects(np.concatenate(rows), np.concatenate([scorch, light]))


def _flames(seed: int, place: Floats, blaze: FireScale, size: float, time_s: float, weather: Weather) -> Rows:
    """Return the solid bodies of flames, which have ids, and the soft flames around them, which lean with the wind."""
    count = max(6, round(blaze.flames * size))
    age, number = stream(seed, time_s, count, 0.85)
    bearing, out = 6.2832 * hashed(number * np.uint64(3)), np.sqrt(hashed(number * np.uint64(3) + np.uint64(1)))
    vigour = 0.55 + 0.45 * hashed(number * np.uint64(3) + np.uint64(2))
    reach = blaze.radius_m * size
    tall = blaze.height_m * size * vigour * (1.15 - 0.55 * out)
    long = 0.5 * tall * (0.35 + 0.65 * np.sin(np.pi * np.clip(age * 1.1, 0.0, 1.0)))
    width = reach * (0.14 + 0.17 * hashed(number * np.uint64(13))) * (1.1 - 0.6 * age) * (1.15 - 0.4 * out)
    lean = 0.25 * tall * age
    points = np.stack(
        [
            place[0] + reach * out * np.cos(bearing) * (1.0 - 0.45 * age),
            place[1] + reach * out * np.sin(bearing) * (1.0 - 0.45 * age),
            place[2] + long + 0.6 * width + 0.55 * tall * age,
        ],
        axis=1,
    )
    axis = np.stack([0.2 * lean * np.cos(bearing), 0.2 * lean * np.sin(bearing), long], axis=1)
    warm = np.clip(1.08 - 0.40 * age - 0.22 * out - 0.30 * hashed(number * np.uint64(11)), 0.25, 1.0)
    colour = np.array(FLAME_HEART) * np.stack([np.minimum(warm + 0.30, 1.0), warm, warm**1.5], axis=1)
    bodies = billboards(points, width, colour, 1.0, axis=axis, glow=1.0, shape=FLAME, seed=number % 89, body=True)
    soft = bodies.copy()
    soft["id"], soft["alpha"], soft["size"] = 0, FLAME_OPACITY, SOFT_WIDE * bodies["size"]
    soft["axis"] = SOFT_LONG * bodies["axis"] + np.outer(age * long, LEAN * _drift(seed, weather)).astype(np.float32)
    return np.concatenate([bodies, soft])


def _glow(seed: int, place: Floats, blaze: FireScale, size: float, time_s: float) -> Rows:
    flicker = 0.85 + 0.15 * np.sin(9.0 * time_s + np.arange(3) * 2.1 + seed % 7)
    height = np.array([0.25, 0.55, 0.9]) * blaze.height_m * size
    points = np.tile(place, (3, 1)) + np.stack([0 * height, 0 * height, height], axis=1)
    wide = blaze.radius_m * size * np.array([1.9, 1.5, 1.1])
    return billboards(points, wide, GLOW, 0.20 * flicker, soft=1.0, glow=1.0, seed=seed % 31)


def _smoke(seed: int, place: Floats, blaze: FireScale, size: float, time_s: float, weather: Weather) -> Rows:
    """Return the puffs of smoke. They start at the lee side of the bed, so that the flames stay visible from above."""
    count = max(8, round(blaze.puffs * size))
    age, number = stream(seed + 7, time_s, count, blaze.life_s)
    away = _drift(seed, weather)
    lee = away / np.linalg.norm(away)
    seconds = age * blaze.life_s
    spread = 6.2832 * hashed(number * np.uint64(5))
    stray = (0.35 + 0.65 * hashed(number * np.uint64(5) + np.uint64(1))) * blaze.radius_m * size * (0.45 + 1.9 * age)
    rise = blaze.height_m * (0.55 + 3.4 * age**0.8)
    points = place + lee * (0.55 * blaze.radius_m * size) + np.outer(seconds, away)
    points += np.stack([stray * np.cos(spread), stray * np.sin(spread), rise], axis=1)
    wide = blaze.puff_m * size * (0.18 + 0.82 * age**0.75) * (0.65 + 0.7 * hashed(number * np.uint64(5) + np.uint64(2)))
    shade = ramp(SOOT, age) * (0.6 + 0.9 * hashed(number * np.uint64(5) + np.uint64(3)))[:, None]
    alpha = 0.70 * np.minimum(age / 0.06, 1.0) * (1.0 - age) ** 0.9
    return billboards(points, wide, shade, alpha, soft=0.75, seed=number % 89)


def _halo(place: Floats, blaze: FireScale, size: float, strength: float) -> Rows:
    """Return the glow of the air around a fire after dark."""
    points = place + np.outer([0.5, 0.8, 1.0], [0.0, 0.0, blaze.height_m * size])
    wide = (blaze.radius_m + blaze.height_m) * size * np.array([0.9, 1.5, 2.3])
    return billboards(points, wide, GLOW, np.array([0.20, 0.15, 0.11]) * strength, soft=1.0, glow=1.0, shape=DROP)


def _lit_smoke(smoke: Rows, place: Floats, blaze: FireScale, strength: float) -> Rows:
    """Return the smoke over a fire after dark, lit from below."""
    away = np.linalg.norm(smoke["place"] - np.asarray(place, np.float32), axis=1)
    reach = LIT_REACH * (blaze.radius_m + blaze.height_m)
    lit: Rows = smoke[away < reach].copy()
    lit["colour"], lit["glow"], lit["soft"] = GLOW, 1.0, 1.0
    lit["alpha"] *= 0.32 * strength * (1.0 - away[away < reach] / reach)
    return lit


def _wisps(seed: int, place: Floats, blaze: FireScale, time_s: float, weather: Weather) -> Rows:
    count = blaze.puffs // 6
    age, number = stream(seed + 11, time_s, count, 6.0)
    at = 6.2832 * chance(seed, 3, count)
    out = 0.7 * blaze.radius_m * np.sqrt(chance(seed, 4, count))
    points = place + np.outer(age * 4.0, _drift(seed, weather))
    points += np.stack([out * np.cos(at), out * np.sin(at), 0.3 + blaze.height_m * 1.2 * age], axis=1)
    return billboards(points, blaze.puff_m * (0.12 + 0.3 * age), STEAM, 0.22 * (1.0 - age), soft=1.0, seed=number % 89)


def _drift(seed: int, weather: Weather) -> Floats:
    """Return the velocity of the smoke (m/s): with the wind, and never exactly 0."""
    lazy = wind_of(0.7, 360.0 * float(chance(seed, 9, 1)[0]))
    return 0.8 * wind_of(weather.wind_mps, weather.wind_from_deg) + lazy
