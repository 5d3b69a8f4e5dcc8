"""The airframe of coarse motion: a point mass with an attitude that follows each demand at once.

It stands for `QuadrotorAirframe` where learners need many steps and no pictures. Thrust, drag, wind and the limits of
the controller are the same; the attitude has no dynamics, and one step of the integration is a whole control period.
"""

from __future__ import annotations

import math

from lingjing.engines.flight_dynamics import STEP_S
from lingjing.engines.multirotor.airframe import LIFT_N, MASS_KG, RotorSample
from lingjing.engines.multirotor.control import DRAG
from lingjing.engines.sea import GRAVITY
from lingjing.mission.instance import Vector

COARSE_PERIOD_S = 0.25
"""Control period of coarse motion, seconds: half of the time constant of the velocity loop."""

_DENSITY = 1.225
"""Density of the air, kg/m^3: sea level of the ISA."""


class PointMassAirframe:
    """A point mass with the thrust and drag of `QuadrotorAirframe`, held in place until `release`."""

    def __init__(self, origin: tuple[float, float], elevation_m: float, heading_deg: float) -> None:
        self._held = True
        self._mass_kg = MASS_KG
        self._velocity: Vector = (0.0, 0.0, 0.0)
        self._wind: Vector = (0.0, 0.0, 0.0)
        self._attitude: Vector = (0.0, 0.0, math.radians(heading_deg % 360.0))
        self._yaw_rate = self._thrust_n = 0.0

    def release(self) -> None:
        """Let the airframe fly from now on."""
        self._held = False

    def set_load(self, load_kg: float) -> None:
        """Set the load, kg."""
        self._mass_kg = MASS_KG + load_kg

    def set_wind(self, east: float, north: float, up: float) -> None:
        """Set the velocity of the air, m/s."""
        self._wind = (east, north, up)

    def command(self, roll: float, pitch: float, yaw_rate: float, thrust_n: float) -> None:
        """Set attitude and thrust: roll and pitch in rad, yaw rate in rad/s, thrust in newtons."""
        self._attitude = (roll, pitch, self._attitude[2])
        self._yaw_rate, self._thrust_n = yaw_rate, min(max(thrust_n, 0.0), LIFT_N)

    def step(self, count: int) -> None:
        """Move on by `count` times `flight_dynamics.STEP_S`, in one step of the integration."""
        if self._held:
            return
        seconds = count * STEP_S
        roll, pitch, heading = self._attitude
        sine, cosine = math.sin(heading), math.cos(heading)
        push = self._thrust_n / self._mass_kg
        ahead, right = -push * math.sin(pitch) * math.cos(roll), push * math.sin(roll)
        lift = push * math.cos(pitch) * math.cos(roll)
        velocity, wind = self._velocity, self._wind
        east, north, up = velocity[0] - wind[0], velocity[1] - wind[1], velocity[2] - wind[2]
        drag = DRAG / self._mass_kg * math.sqrt(east * east + north * north + up * up)
        keep = 1.0 / (1.0 + seconds * drag)  # implicit: stable for any speed of the air
        self._velocity = (
            wind[0] + keep * (east + seconds * (ahead * sine + right * cosine)),
            wind[1] + keep * (north + seconds * (ahead * cosine - right * sine)),
            wind[2] + keep * (up + seconds * (lift - GRAVITY)),
        )
        self._attitude = (roll, pitch, (heading + seconds * self._yaw_rate) % (2.0 * math.pi))

    def sample(self) -> RotorSample:
        """Return the state."""
        roll, pitch, heading = self._attitude
        east, north, up = (speed - air for speed, air in zip(self._velocity, self._wind, strict=True))
        ahead = east * math.sin(heading) + north * math.cos(heading)
        right = east * math.cos(heading) - north * math.sin(heading)
        forward = ahead * math.cos(pitch) + up * math.sin(pitch)
        below = ahead * math.sin(pitch) - up * math.cos(pitch)
        aside, down = (
            right * math.cos(roll) + below * math.sin(roll),
            below * math.cos(roll) - right * math.sin(roll),
        )
        return RotorSample(
            velocity=self._velocity,
            attitude=self._attitude,
            air_velocity=(forward, aside, down),
            thrust_n=self._thrust_n,
            density=_DENSITY,
        )


__all__ = ["COARSE_PERIOD_S", "PointMassAirframe"]
