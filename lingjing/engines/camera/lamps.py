"""Lamps at night: street lamps, and head and tail lights of vehicles, as glowing billboards."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
import numpy.typing as npt

from lingjing.engines.camera.effects.night import DRIVEN
from lingjing.engines.camera.effects.particles import DECAL, DROP, POOL, Rows, ahead, billboards
from lingjing.engines.camera.light import LAMPS_DEG
from lingjing.mission.instance import Weather
from lingjing.scene.city import Prop
from lingjing.scene.sizes import SIZES, Size
from lingjing.trace.records import BodyState

HEADS: dict[str, tuple[float, float, float]] = {"lamp": (0.0, 1.9, 7.95), "park_lamp": (0.0, 0.0, 3.4)}
"""Position of the light in the frame of each prop model, metres."""

WARM, WHITE, RED = (0.80, 0.62, 0.36), (0.80, 0.78, 0.70), (0.75, 0.03, 0.02)
"""Linear colours of street lamps, head lights and tail lights (chosen)."""

MURKY_M = 1000.0
"""Visibility below which vehicles have their lights on, metres (chosen)."""

REACH_M = 450.0
"""Distance up to which street lamps are drawn, metres (chosen)."""
POOL_REACH_M = 260.0
"""Distance up to which lamps light the ground, metres (chosen)."""
POOL_SHARE, MOST_HEIGHT_M = 1.7, 9.0
"""Radius of a lamp's light on the ground in heights of the lamp, and the greatest height that counts, metres (chosen).
Lamps of towns stand on ground of elevation 0."""
POOL_STRENGTH = 0.5
"""Strength of that light at night, 0..1 (chosen)."""
POOL_COLOUR = (0.95, 0.74, 0.46)
"""Linear colour of that light (chosen)."""


def vehicles_lit(weather: Weather) -> bool:
    """Return whether vehicles have their lights on: in the dark, in fog and in rain."""
    return weather.sun_elevation_deg < LAMPS_DEG or weather.visibility_m < MURKY_M or weather.rain > 0.2


def lamp_heads(props: Iterable[Prop]) -> npt.NDArray[np.float64]:
    """Return the positions of the lights of lamps among props, (n, 3) metres."""
    heads = []
    for prop in props:
        if prop.model in HEADS:
            right, along = ahead(prop.heading_deg)
            x, y, z = HEADS[prop.model]
            heads.append(np.array(prop.position) + (right * x + along * y + np.array([0.0, 0.0, z])) * prop.scale)
    return np.array(heads).reshape(-1, 3)


def lamp_rows(heads: npt.NDArray[np.float64], eye: tuple[float, float, float], dark: float) -> Rows:
    """Return the glow of lamps near the eye; `dark` is 0 by day and 1 at night."""
    near = heads[np.linalg.norm(heads - np.asarray(eye), axis=1) < REACH_M]
    strength = 0.35 + 0.65 * dark
    halos = billboards(near, 1.1, WARM, 0.34 * strength, soft=1.0, glow=1.0, shape=DROP)
    return np.concatenate([halos, billboards(near, 0.30, (0.80, 0.74, 0.60), 0.95, soft=0.4, glow=1.0, shape=DROP)])


def lamp_pools(heads: npt.NDArray[np.float64], eye: tuple[float, float, float], dark: float) -> Rows:
    """Return the light of lamps on the ground near the eye; `dark` is 0 by day and 1 at night."""
    near = heads[np.linalg.norm(heads - np.asarray(eye), axis=1) < POOL_REACH_M] if dark > 0.0 else heads[:0]
    rows = np.zeros(len(near), DECAL)
    height = np.minimum(near[:, 2], MOST_HEIGHT_M)
    rows["place"] = near - np.outer(near[:, 2], [0.0, 0.0, 1.0])
    rows["half"] = (POOL_SHARE * height)[:, None]
    rows["colour"], rows["alpha"], rows["kind"] = POOL_COLOUR, POOL_STRENGTH * dark, POOL
    return rows


def vehicle_rows(bodies: Sequence[tuple[BodyState, str]]) -> Rows:
    """Return head and tail lights of the bodies with a look in `DRIVEN`."""
    rows = [_lights(state, SIZES.get(look, SIZES["car"])) for state, look in bodies if look in DRIVEN]
    return np.concatenate([billboards(np.zeros((0, 3)), 0.0, 0.0, 0.0), *rows])


SIGNAL_LAMPS: dict[str, tuple[float, tuple[float, float, float]]] = {
    "signal_red": (3.55, (0.85, 0.03, 0.02)),
    "signal_amber": (3.25, (0.85, 0.42, 0.02)),
    "signal_green": (2.95, (0.03, 0.75, 0.25)),
}
"""Height of the lit lamp of each signal (m), and its linear colour; the unlit lamps belong to the model."""


def signal_rows(signals: Iterable[BodyState]) -> Rows:
    """Return the lit lamps of traffic signals."""
    rows = [billboards(np.zeros((0, 3)), 0.0, 0.0, 0.0)]
    for state in signals:
        up, colour = SIGNAL_LAMPS[state.kind]
        _, along = ahead(state.heading_deg)
        place = (np.array(state.position) + along * 0.24 + np.array([0.0, 0.0, up])).reshape(1, 3)
        rows.append(billboards(place, 0.30, colour, 0.35, soft=1.0, glow=1.0, shape=DROP))
        rows.append(billboards(place, 0.13, colour, 1.0, soft=0.2, glow=1.0, shape=DROP))
    return np.concatenate(rows)


def _lights(state: BodyState, size: Size) -> Rows:
    right, along = ahead(state.heading_deg)
    place = np.array(state.position) + np.array([0.0, 0.0, min(0.75, 0.45 * size.height_m)])
    side, front = right * 0.36 * size.width_m, along * (0.5 * size.length_m + 0.10)
    heads = np.array([place + front - side, place + front + side])
    tails = np.array([place - front - side, place - front + side])
    return np.concatenate([
        billboards(heads, 0.55, WHITE, 0.30, soft=1.0, glow=1.0, shape=DROP),
        billboards(tails, 0.36, RED, 0.30, soft=1.0, glow=1.0, shape=DROP),
        billboards(heads, 0.13, WHITE, 0.95, soft=0.3, glow=1.0, shape=DROP),
        billboards(tails, 0.11, RED, 0.95, soft=0.3, glow=1.0, shape=DROP),
    ])  # fmt: skip
