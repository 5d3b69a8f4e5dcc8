"""Satellite navigation receivers: the noisy position and velocity that an agent observes through `uav.gnss`.

The error of a position is a first-order Gauss-Markov process in each axis, one value for each boundary. The error of a
velocity is white noise. Each body has a random stream of its own (`sensor/‹body›/gnss`), so the errors depend on the
seed and on the body, and on nothing that is hidden. Multipath and loss of reception are left out.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from lingjing.mission.instance import Entity, Instance, Vector
from lingjing.mission.seeding import generator

_CEP = 1.1774
"""Circular error probable of a two-dimensional normal distribution with equal deviations, in deviations."""

_MEDIAN = 0.6745
"""Median of the absolute value of a normal variable, in deviations."""

_CORRELATION_S = 60.0
"""Time constant of the position's error, seconds (chosen: errors of orbits, clocks and air change within minutes)."""


@dataclass(frozen=True, slots=True)
class _Receiver:
    """Standard deviations of a receiver's errors in each axis."""

    level_m: float
    """East and north, metres."""
    up_m: float
    """Upwards, metres."""
    velocity_mps: float
    """Each component of the velocity, m/s."""


RECEIVERS = {
    # u-blox NEO-M8, data sheet UBX-15031086: position 2.5 m CEP, velocity 0.05 m/s (50 %). It states no height; 1.5
    # times the horizontal deviation is chosen (the usual ratio of dilutions of precision).
    "m8": _Receiver(2.5 / _CEP, 1.5 * 2.5 / _CEP, 0.05 / _MEDIAN),
    # u-blox ZED-F9P with RTK, data sheet UBX-17051259: 0.01 m CEP, height 0.01 m (50 %), velocity 0.05 m/s (50 %).
    "f9p": _Receiver(0.01 / _CEP, 0.01 / _MEDIAN, 0.05 / _MEDIAN),
}
"""Receivers by the word in `gnss = …`."""


@dataclass(frozen=True, slots=True)
class GnssError:
    """The errors of one boundary."""

    position: Vector
    """Error of the position (east, north, up), metres."""
    velocity: Vector
    """Error of the velocity, m/s."""


class GnssErrors:
    """The errors of all receivers of an instance: a function of seed, body and boundary."""

    def __init__(self, instance: Instance) -> None:
        self._seed, self._tick_s = instance.seed, instance.clock.tick_s
        self._known: dict[str, list[GnssError]] = {}
        self._streams: dict[str, np.random.Generator] = {}

    def at(self, entity: Entity, tick: int) -> GnssError:
        """Return the errors of an entity's receiver at a boundary. The entity declares `gnss`."""
        receiver = RECEIVERS[str(entity.properties["gnss"])]
        known = self._known.setdefault(entity.id, [])
        stream = self._streams.setdefault(entity.id, generator(self._seed, f"sensor/{entity.id}/gnss"))
        keep = math.exp(-self._tick_s / _CORRELATION_S)
        while len(known) <= tick:
            share, kick = (keep, math.sqrt(1.0 - keep * keep)) if known else (0.0, 1.0)
            before = known[-1].position if known else (0.0, 0.0, 0.0)
            draws = stream.standard_normal(6).tolist()
            sigma = (receiver.level_m, receiver.level_m, receiver.up_m)
            east, north, up = (share * old + kick * s * d for old, s, d in zip(before, sigma, draws[:3], strict=True))
            drift = receiver.velocity_mps
            known.append(GnssError((east, north, up), (drift * draws[3], drift * draws[4], drift * draws[5])))
        return known[tick]


def shifted(place: Vector, error: Vector) -> Vector:
    """Return a measured vector: the true one with its error."""
    return place[0] + error[0], place[1] + error[1], place[2] + error[2]


__all__ = ["RECEIVERS", "GnssError", "GnssErrors", "shifted"]
