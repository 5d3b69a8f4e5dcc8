"""Blue lights that flash by turns on a fire engine's roof."""

from __future__ import annotations

import numpy as np

from lingjing.plugins.engines.camera.effects.particles import DROP, Effects, Floats, ahead, billboards

FLASH_HZ = 2.2
LAMPS = ((-0.66, 3.35, 3.16), (0.66, 3.35, 3.16), (1.05, -4.15, 3.18), (-1.05, -4.15, 3.18))
"""In the body's frame, m; the first and third flash together."""
BLUE = (0.10, 0.30, 0.80)


def blue_lights(place: Floats, heading_deg: float, time_s: float) -> Effects:
    """Bright lamps and their halos."""
    right, along = ahead(heading_deg)
    points = np.array([place + right * x + along * y + np.array([0.0, 0.0, z]) for x, y, z in LAMPS])
    first = int(time_s * 2.0 * FLASH_HZ) % 2
    lit = np.array([1.0 if k % 2 == first else 0.0 for k in range(len(LAMPS))])
    lamps = billboards(points, 0.30, BLUE, 0.9 * lit, soft=0.5, glow=1.0, shape=DROP)
    halos = billboards(points, 1.3, BLUE, 0.30 * lit, soft=1.0, glow=1.0, shape=DROP)
    return Effects(np.concatenate([halos, lamps])[np.concatenate([lit, lit]) > 0.0])
