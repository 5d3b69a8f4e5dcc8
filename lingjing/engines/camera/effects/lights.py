"""Blue lights on a fire engine's roof, which flash alternately."""

from __future__ import annotations

import numpy as np

from lingjing.engines.camera.effects.night import darkness, pool
from lingjing.engines.camera.effects.particles import DROP, Effects, ahead, billboards
from lingjing.engines.camera.mesh_rows import Floats
from lingjing.mission.instance import Weather

FLASH_HZ = 2.2
"""Flashes of a light per second (chosen)."""
LAMPS = ((-0.66, 3.35, 3.16), (0.66, 3.35, 3.16), (1.05, -4.15, 3.18), (-1.05, -4.15, 3.18))
"""Positions in the body's frame, metres; the first and third flash together."""
BLUE = (0.10, 0.30, 0.80)
"""Linear colour of the lights (chosen)."""

ON_GROUND = (0.20, 0.45, 1.0)
"""Linear colour of their light on the street (chosen)."""

POOL_M = 11.0
"""Radius of their light on the street, metres (chosen)."""


def blue_lights(place: Floats, heading_deg: float, time_s: float, weather: Weather) -> Effects:
    """Return bright lamps and their halos; after dark also their light on the street."""
    right, along = ahead(heading_deg)
    points = np.array([place + right * x + along * y + np.array([0.0, 0.0, z]) for x, y, z in LAMPS])
    first = int(time_s * 2.0 * FLASH_HZ) % 2
    lit = np.array([1.0 if k % 2 == first else 0.0 for k in range(len(LAMPS))])
    lamps = billboards(points, 0.30, BLUE, 0.9 * lit, soft=0.5, glow=1.0, shape=DROP)
    halos = billboards(points, 1.3, BLUE, 0.30 * lit, soft=1.0, glow=1.0, shape=DROP)
    shown = np.concatenate([halos, lamps])[np.concatenate([lit, lit]) > 0.0]
    dark = darkness(weather)
    if dark <= 0.0:
        return Effects(shown)
    burning = points[lit > 0.0]
    wide = billboards(burning, 3.2, BLUE, 0.16 * dark, soft=1.0, glow=1.0, shape=DROP)
    ground = burning * (1.0, 1.0, 0.0) + (0.0, 0.0, float(place[2]))
    pools = [pool(spot, POOL_M, ON_GROUND, 0.8 * dark) for spot in ground]
    return Effects(np.concatenate([wide, shown]), np.concatenate(pools))
