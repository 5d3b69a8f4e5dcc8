"""What flying costs: electric power from rotor thrust and airspeed, and the battery it drains.

Momentum theory (Glauert): the induced velocity solves `v = T / (2 rho A) / sqrt(Vt^2 + (Va + v)^2)`, with `Vt` the
airspeed in the rotor plane and `Va` the one through it. Thrust works against both; blade profile drag grows with the
advance ratio. Because thrust is what the airframe really produces, drag, climbs and head wind are all paid for.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from lingjing.engines.multirotor.airframe import MASS_KG, Sample
from lingjing.engines.sea import GRAVITY

_DISC_M2 = 4 * math.pi * 0.119**2
"""Four rotors of 9.4 inches."""
_INDUCED_LOSS = 1.15
_DRIVE_EFFICIENCY = 0.70
_PROFILE_W = 25.0
_TIP_MPS = 80.0
_PROFILE_GROWTH = 4.65
_AVIONICS_W = 8.0
_SEA_LEVEL = 1.225


def induced_velocity(thrust_n: float, density: float, plane: float, axial: float, guess: float) -> float:
    """One damped iteration towards Glauert's induced velocity, m/s; called at 50 Hz it follows within 0.2 s."""
    if thrust_n <= 0.0:
        return 0.0
    square = thrust_n / (2.0 * density * _DISC_M2)
    # The floor keeps a descent into the own wake (vortex ring), where momentum theory ends, from diverging.
    through = max(math.hypot(plane, axial + guess), 0.5 * math.sqrt(square))
    return 0.5 * (guess + square / through)


def electric_power(thrust_n: float, plane: float, axial: float, induced: float) -> float:
    """Electric power in watts; a windmilling rotor gives nothing back."""
    lift = max(thrust_n * (_INDUCED_LOSS * induced + axial), 0.0)
    profile = _PROFILE_W * (1.0 + _PROFILE_GROWTH * (plane / _TIP_MPS) ** 2)
    return (lift + profile) / _DRIVE_EFFICIENCY + _AVIONICS_W


def hover_power() -> float:
    """Electric power in watts of hovering in still air at sea level."""
    weight = MASS_KG * GRAVITY
    return electric_power(weight, 0.0, 0.0, math.sqrt(weight / (2.0 * _SEA_LEVEL * _DISC_M2)))


@dataclass(slots=True)
class Battery:
    """Energy left, sized so that hovering in still air lasts `endurance_s`."""

    capacity_wh: float
    left_wh: float
    induced: float = 0.0

    @classmethod
    def lasting(cls, endurance_s: float) -> Battery:
        """A full battery that hovers for `endurance_s` seconds."""
        capacity = hover_power() * endurance_s / 3600.0
        return cls(capacity_wh=capacity, left_wh=capacity)

    @property
    def empty(self) -> bool:
        """Whether nothing is left."""
        return self.left_wh <= 0.0

    @property
    def share(self) -> float:
        """What is left, 0..1."""
        return self.left_wh / self.capacity_wh

    def drain(self, sample: Sample, dt_s: float) -> None:
        """Pay for `dt_s` seconds of the flight state in `sample`."""
        forward, right, down = sample.air_velocity
        plane = math.hypot(forward, right)
        self.induced = induced_velocity(sample.thrust_n, sample.density, plane, -down, self.induced)
        watts = electric_power(sample.thrust_n, plane, -down, self.induced)
        self.left_wh = max(0.0, self.left_wh - watts * dt_s / 3600.0)
