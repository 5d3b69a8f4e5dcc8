"""Water under pressure: the jet of a leak, which is the body of the target, mist, wet ground, steam and fountains."""

from __future__ import annotations

import numpy as np

from lingjing.engines.camera.effects.particles import (
    DROP,
    PUFF,
    WET,
    Effects,
    Rows,
    ahead,
    billboards,
    chance,
    decal,
    hashed,
    stream,
    wind_of,
)
from lingjing.engines.camera.mesh_rows import Floats
from lingjing.mission.instance import Weather

GRAVITY = 9.81
"""Gravity, m/s^2."""

# Linear colours (chosen).
SPRAY = (0.74, 0.78, 0.80)
MIST = (0.62, 0.65, 0.68)
PUDDLE = (0.022, 0.026, 0.030)
JET_WIDE, JET_LONG, JET_OPACITY = 3.2, 3.4, 0.40
"""Ratios of width and length of a soft streak of a jet to those of its drop, and its opacity (chosen)."""
SPLASH_WIDE, SPLASH_OPACITY = 4.5, 0.40
"""Ratio of the width of a soft splash to that of its drop, and its opacity (chosen)."""


def leak(
    seed: int, place: Floats, heading_deg: float, ground_m: float, flow: float, time_s: float, weather: Weather
) -> Effects:
    """Return a sideways jet out of a pipe along the heading; `flow` is 0..1, and 0 leaves only the wet ground."""
    right, along = ahead(heading_deg)
    side = right if seed % 2 else -right
    speed = 6.8 * max(flow, 0.0) ** 0.5
    out = 0.62 * side + 0.12 * along + np.array([0.0, 0.0, 0.78])
    height = max(float(place[2]) - ground_m, 0.0)
    flight = (out[2] * speed + (out[2] ** 2 * speed**2 + 2.0 * GRAVITY * height) ** 0.5) / GRAVITY
    landing = place + out * speed * flight
    wet = _wet(seed, place, landing, heading_deg, ground_m)
    if flow < 0.02:
        return Effects(decals=wet)
    start = place + 0.38 * side + np.array([0.0, 0.0, 0.15])
    rows = [
        _jet(seed, start, out, speed, flight, flow, ground_m, time_s),
        _splash(seed, landing, ground_m, flow, time_s),
        _mist(seed, start, out * speed, flight, flow, time_s, weather),
    ]
    return Effects(np.concatenate(rows), wet)


def _jet(
    seed: int, start: Floats, out: Floats, speed: float, flight: float, flow: float, ground_m: float, time_s: float
) -> Rows:
    count = 320
    age, number = stream(seed, time_s, count, flight)
    scatter = np.stack([hashed(number * np.uint64(7) + np.uint64(k)) - 0.5 for k in range(3)], axis=1)
    velocity = (out + 0.24 * scatter) * speed * (0.92 + 0.16 * hashed(number * np.uint64(7) + np.uint64(5)))[:, None]
    seconds = age * flight * 0.96
    fall = np.array([0.0, 0.0, GRAVITY])
    points = start + velocity * seconds[:, None] - 0.5 * np.outer(seconds**2, fall)
    points[:, 2] = np.maximum(points[:, 2], ground_m + 0.02)
    now = velocity - np.outer(seconds, fall)
    axis = 0.035 * now
    wide = (0.022 + 0.030 * age) * (0.7 + 0.6 * flow)
    shade = np.array(SPRAY) * (0.85 + 0.15 * hashed(number * np.uint64(7) + np.uint64(6)))[:, None]
    bodies = billboards(points, wide, shade, 1.0, axis=axis, shape=DROP, seed=number % 89, body=True)
    return np.concatenate([bodies, _softened(bodies, JET_WIDE, JET_LONG, JET_OPACITY)])


def _splash(seed: int, landing: Floats, ground_m: float, flow: float, time_s: float) -> Rows:
    count = 60
    age, number = stream(seed + 3, time_s, count, 0.55)
    bearing = 6.2832 * hashed(number * np.uint64(3))
    out = (0.25 + 1.1 * hashed(number * np.uint64(3) + np.uint64(1))) * age * flow
    hop = 0.45 * flow * np.sin(np.pi * age)
    points = np.stack(
        [landing[0] + out * np.cos(bearing), landing[1] + out * np.sin(bearing), ground_m + 0.06 + hop], axis=1
    )
    bodies = billboards(points, 0.055 - 0.02 * age, SPRAY, 1.0, shape=DROP, seed=number % 89, body=True)
    return np.concatenate([bodies, _softened(bodies, SPLASH_WIDE, 1.0, SPLASH_OPACITY)])


def _softened(bodies: Rows, wide: float, long: float, opacity: float) -> Rows:
    """Return the soft sprites that show drops; the solid drops themselves have ids and no colour."""
    soft = bodies.copy()
    soft["id"], soft["alpha"], soft["soft"], soft["shape"] = 0, opacity, 1.0, PUFF
    soft["size"], soft["axis"] = wide * bodies["size"], long * bodies["axis"]
    return soft


def _mist(
    seed: int, start: Floats, velocity: Floats, flight: float, flow: float, time_s: float, weather: Weather
) -> Rows:
    count = 34
    age, number = stream(seed + 5, time_s, count, 2.6)
    early = np.minimum(age * 2.6, 0.75 * flight)
    points = start + np.outer(early, velocity) - 0.5 * np.outer(early**2, np.array([0.0, 0.0, GRAVITY]))
    stray = np.stack([hashed(number * np.uint64(9) + np.uint64(k)) - 0.5 for k in range(3)], axis=1)
    points += 1.7 * stray * (0.3 + age)[:, None] + np.outer(
        2.6 * age, 0.4 * wind_of(weather.wind_mps, weather.wind_from_deg)
    )
    points[:, 2] = np.maximum(points[:, 2], start[2] - 0.5)
    alpha = 0.48 * flow * np.minimum(age / 0.1, 1.0) * (1.0 - age)
    return billboards(points, 0.45 + 1.0 * age, MIST, alpha, soft=1.0, seed=number % 89)


def _wet(seed: int, place: Floats, landing: Floats, heading_deg: float, ground_m: float) -> Rows:
    middle = 0.45 * place + 0.55 * landing
    lift = ground_m + 0.02
    spots = [
        ((float(middle[0]), float(middle[1]), lift), (6.2, 5.2), 0.72),
        ((float(landing[0]), float(landing[1]), lift + 0.01), (3.9, 3.4), 0.80),
    ]
    return np.concatenate(
        [
            decal(spot, half, heading_deg, PUDDLE, alpha, WET, seed % 97 + k)
            for k, (spot, half, alpha) in enumerate(spots)
        ]
    )


def steam(seed: int, place: Floats, height_m: float, time_s: float, weather: Weather) -> Effects:
    """Return white puffs above a vent, which resemble smoke."""
    age, number = stream(seed, time_s, 30, 5.0)
    stray = np.stack([hashed(number * np.uint64(9) + np.uint64(k)) - 0.5 for k in range(3)], axis=1)
    points = (
        place
        + 0.9 * stray * (0.2 + age)[:, None]
        + np.outer(5.0 * age, 0.7 * wind_of(weather.wind_mps, weather.wind_from_deg))
    )
    points[:, 2] += height_m + 3.2 * age**0.8
    alpha = 0.42 * np.minimum(age / 0.08, 1.0) * (1.0 - age)
    return Effects(billboards(points, 0.25 + 1.1 * age, (0.70, 0.71, 0.72), alpha, soft=0.9, seed=number % 89))


def fountain(seed: int, place: Floats, time_s: float) -> Effects:
    """Return eight arcs of water into a basin."""
    count = 160
    age, number = stream(seed, time_s, count, 1.0)
    bearing = 6.2832 * (number % np.uint64(8)).astype(np.float64) / 8.0 + 0.1 * chance(seed, 1, count)
    out = 1.7 * age
    points = place + np.stack([out * np.cos(bearing), out * np.sin(bearing), 1.0 + 3.6 * age - 4.2 * age**2], axis=1)
    lean = np.stack([1.7 * np.cos(bearing), 1.7 * np.sin(bearing), 3.6 - 8.4 * age], axis=1)
    return Effects(billboards(points, 0.13 + 0.12 * age, SPRAY, 0.5, axis=0.10 * lean, soft=1.0, seed=number % 89))
