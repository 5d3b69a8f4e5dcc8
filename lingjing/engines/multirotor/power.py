"""Electric power from rotor thrust and airspeed.

Momentum theory (Glauert): the induced velocity solves `v = T / (2 rho A) / sqrt(Vt^2 + (Va + v)^2)`, with `Vt` the
airspeed in the rotor plane and `Va` the one through it. Thrust works against both. Profile drag of the blades grows
with the advance ratio. The thrust is that of the airframe in JSBSim, so it includes drag, climbs and head wind.
"""

from __future__ import annotations

import math

from lingjing.engines.multirotor.airframe import MASS_KG, RotorSample
from lingjing.engines.sea import GRAVITY

_DISC_M2 = 4 * math.pi * 0.119**2
"""Total disc area of the four rotors of 9.4 inches diameter, m^2."""
_INDUCED_LOSS = 1.15
"""Ratio of the real to the ideal induced power (a usual value for small rotors)."""

_DRIVE_EFFICIENCY = 0.70
"""Efficiency of motors and speed controllers together (chosen)."""

_PROFILE_W = 25.0
"""Power of the profile drag of all blades in hover, watts (chosen)."""

_TIP_MPS = 80.0
"""Speed of the blade tips, m/s (chosen)."""

_PROFILE_GROWTH = 4.65
"""Growth of the profile power with the square of the advance ratio (rotor theory)."""

_AVIONICS_W = 8.0
"""Power of the electronics, watts (chosen)."""

_SEA_LEVEL = 1.225
"""Density of air at sea level, kg/m^3 (ISA)."""


def _induced_velocity(thrust_n: float, density: float, plane: float, axial: float, guess: float) -> float:
    """Return the next damped iteration of Glauert's induced velocity, m/s. At 50 Hz it converges within 0.2 s.

    `plane` and `axial` are the airspeeds in and through the rotor plane, m/s. `guess` is the last value.
    """
    if thrust_n <= 0.0:
        return 0.0
    square = thrust_n / (2.0 * density * _DISC_M2)
    # The lower bound prevents divergence in a vortex ring (descent into its own wake), where the theory fails.
    through = max(math.hypot(plane, axial + guess), 0.5 * math.sqrt(square))
    return 0.5 * (guess + square / through)


def _electric_power(thrust_n: float, plane: float, axial: float, induced: float) -> float:
    """Return the electric power in watts. A windmilling rotor supplies no power."""
    lift = max(thrust_n * (_INDUCED_LOSS * induced + axial), 0.0)
    profile = _PROFILE_W * (1.0 + _PROFILE_GROWTH * (plane / _TIP_MPS) ** 2)
    return (lift + profile) / _DRIVE_EFFICIENCY + _AVIONICS_W


def hover_power() -> float:
    """Return the electric power of hovering in still air at sea level, watts."""
    weight = MASS_KG * GRAVITY
    return _electric_power(weight, 0.0, 0.0, math.sqrt(weight / (2.0 * _SEA_LEVEL * _DISC_M2)))


class RotorPower:
    """The electric power of one vehicle. It keeps the induced velocity from period to period."""

    def __init__(self) -> None:
        self._induced = 0.0

    def watts(self, sample: RotorSample) -> float:
        """Return the power in the flight state of `sample`, watts. Call it once in each control period."""
        forward, right, down = sample.air_velocity
        plane = math.hypot(forward, right)
        self._induced = _induced_velocity(sample.thrust_n, sample.density, plane, -down, self._induced)
        return _electric_power(sample.thrust_n, plane, -down, self._induced)
