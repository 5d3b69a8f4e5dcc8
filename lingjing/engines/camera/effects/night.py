"""Lights after dark: pools of light on the ground, halos, and the lights of vehicles, vessels and aircraft.

By day and at dusk (`darkness` 0) there are none, and a picture is the same as without this module. A pool (`POOL`,
`BEAM`) multiplies the picture below it, so that the texture remains.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import radians

import numpy as np

from lingjing.engines.camera.effects.particles import BEAM, DECAL, DROP, POOL, Effects, Rows, ahead, billboards, decal
from lingjing.engines.camera.light import light_of
from lingjing.engines.camera.mesh_rows import Floats
from lingjing.mission.appearance import LinearRgb
from lingjing.mission.instance import Weather
from lingjing.scene.sizes import SIZES
from lingjing.trace.records import BodyState

FIRST_DARK = 0.10
"""Share of the night (`Light.dark`) from which lights show (chosen): at sunset none does."""
DRIVEN = (
    "car", "taxi", "police_car", "ambulance", "delivery_van", "truck", "bus", "fire_truck", "motorcycle",
)  # fmt: skip
"""Looks with head and tail lights."""

LOW_BEAM_M, BEAM_WIDE_M = 13.0, 2.9
"""Length and half width of headlights on the road, metres (chosen)."""

# Linear colours (chosen).
HEADLIGHT: LinearRgb = (0.95, 0.90, 0.72)
TAIL_GLOW: LinearRgb = (0.60, 0.05, 0.03)
RED, GREEN, WHITE = (0.80, 0.03, 0.02), (0.03, 0.70, 0.20), (0.80, 0.78, 0.70)


@dataclass(frozen=True, slots=True)
class _Lamp:
    """A light that a body carries."""

    place: tuple[float, float, float]
    """Position in the body's frame, metres."""
    colour: LinearRgb
    """Linear colour."""
    lamp_m: float
    """Half width of the lamp, metres."""
    halo_m: float
    """Half width of its halo, metres."""
    blinks: bool = False
    """True if it blinks."""


CARRIED: dict[str, tuple[_Lamp, ...]] = {
    "lifeboat": (
        _Lamp((0.0, -1.9, 3.66), WHITE, 0.10, 0.9),
        _Lamp((-0.98, -0.4, 2.05), RED, 0.08, 0.5),
        _Lamp((0.98, -0.4, 2.05), GREEN, 0.08, 0.5),
    ),
    "quadrotor": (
        _Lamp((-0.24, 0.24, 0.10), RED, 0.035, 0.16),
        _Lamp((0.24, 0.24, 0.10), GREEN, 0.035, 0.16),
        _Lamp((0.0, -0.2, -0.08), WHITE, 0.045, 0.28, blinks=True),
    ),
}
"""Lights after dark for each look: red to port, green to starboard."""
BLINK_S, BLINK_ON = 1.0, 0.3
"""Period of blinking (s), and share of it with light (chosen)."""


def darkness(weather: Weather) -> float:
    """Return the share of the night: 0 by day and until sunset, 1 in the dark."""
    dark = light_of(weather, 1.0).dark
    return max(0.0, (dark - FIRST_DARK) / (1.0 - FIRST_DARK))


def pool(place: Floats, radius_m: float, colour: LinearRgb, strength: float) -> Rows:
    """Return a round pool of light at a place; `strength` is 0..1."""
    return decal((float(place[0]), float(place[1]), float(place[2])), (radius_m, radius_m), 0.0, colour, strength,
                 POOL, 0.0)  # fmt: skip


def carried_lights(look: str, state: BodyState, time_s: float, weather: Weather) -> Effects:
    """Return the lights that a body of a look carries after dark."""
    dark = darkness(weather)
    lamps = [lamp for lamp in CARRIED[look] if not lamp.blinks or time_s % BLINK_S < BLINK_ON]
    if dark <= 0.0:
        return Effects()
    right, along = ahead(state.heading_deg)
    points = np.array([np.array(state.position) + right * lamp.place[0] + along * lamp.place[1]
                       + np.array([0.0, 0.0, lamp.place[2]]) for lamp in lamps])  # fmt: skip
    colours = np.array([lamp.colour for lamp in lamps])
    halos = billboards(points, [lamp.halo_m for lamp in lamps], colours, 0.34 * dark, soft=1.0, glow=1.0, shape=DROP)
    cores = billboards(points, [lamp.lamp_m for lamp in lamps], colours, 0.95, soft=0.4, glow=1.0, shape=DROP)
    return Effects(np.concatenate([halos, cores]))


def road_light(bodies: Sequence[tuple[BodyState, str]], weather: Weather) -> Rows:
    """Return the light of vehicles' head and tail lights on the road after dark: rows of `DECAL`."""
    dark = darkness(weather)
    driven = [(state, SIZES.get(look, SIZES["car"])) for state, look in bodies if look in DRIVEN]
    if dark <= 0.0 or not driven:
        return np.zeros(0, DECAL)
    heading = np.array([radians(state.heading_deg) for state, _ in driven])
    along = np.stack([np.sin(heading), np.cos(heading), np.zeros(len(driven))], axis=1)
    place = np.array([state.position for state, _ in driven])
    half_long = np.array([0.5 * size.length_m for _, size in driven])
    beams, tails = np.zeros(len(driven), DECAL), np.zeros(len(driven), DECAL)
    beams["place"] = place + along * (half_long + 0.5 * LOW_BEAM_M)[:, None]
    beams["half"], beams["colour"], beams["kind"] = (BEAM_WIDE_M, 0.5 * LOW_BEAM_M), HEADLIGHT, BEAM
    tails["place"] = place - along * (half_long + 0.6)[:, None]
    tails["half"], tails["colour"], tails["kind"] = (1.5, 1.5), TAIL_GLOW, POOL
    for rows, strength in ((beams, 0.85), (tails, 0.5)):
        rows["heading"], rows["alpha"] = heading, strength * dark
    return np.concatenate([beams, tails])


__all__ = ["CARRIED", "carried_lights", "darkness", "pool", "road_light"]
