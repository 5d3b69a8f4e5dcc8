"""The autopilot: stick and throttle for a bank angle, a climb rate and an airspeed, 50 times a second.

Three loops each drive one control, as in autopilots of light aircraft. The aileron controls bank, the elevator controls
climb (through pitch), the throttle controls airspeed. With a stopped engine the elevator holds the airspeed and the
aircraft glides.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from lingjing.engines.aircraft import PERIOD_S
from lingjing.engines.fixed_wing.airframe import PlaneSample

# Gains of the loops, tuned by hand in flights of the Cessna 172 (chosen). Angles in rad, speeds in m/s.
_BANK_GAIN, _BANK_INTEGRAL, _BANK_DAMPING = 2.0, 0.3, 0.5
_CLIMB_GAIN, _CLIMB_INTEGRAL = 0.025, 0.006
_PITCH_GAIN, _PITCH_INTEGRAL, _PITCH_DAMPING = 2.5, 1.0, 0.8
_GLIDE_GAIN = 0.02
_THROTTLE_GAIN, _THROTTLE_INTEGRAL = 0.12, 0.03

_MAX_PITCH = 0.26
"""Limit of the pitch, rad (15 degrees, chosen)."""

_SLOW_SHARE = 0.92
"""Share of the demanded airspeed below which the aircraft does not climb (chosen)."""


class _StickDemand(NamedTuple):
    """Commands to the controls."""

    aileron: float
    """Aileron, -1..1; positive: right wing down."""
    elevator: float
    """Elevator, -1..1; positive: nose down."""
    throttle: float
    """Throttle, 0..1."""


class Autopilot:
    """Controller state of one aircraft: the integrals of its loops, which hold the trim."""

    def __init__(self) -> None:
        self._aileron = 0.0
        self._pitch = 0.05
        self._elevator = -0.1
        self._throttle = 0.65

    def fly(self, sample: PlaneSample, bank: float, climb: float, airspeed: float, *, powered: bool) -> _StickDemand:
        """Return the controls of one period.

        `bank` is in radians (positive: right wing down), `climb` and `airspeed` (true) in m/s. `powered` is false after
        the engine has stopped.
        """
        pitch = self._climb(sample, climb, airspeed) if powered else self._glide(sample, airspeed)
        return _StickDemand(
            aileron=self._roll(sample, bank),
            elevator=self._nose(sample, pitch),
            throttle=self._power(sample, airspeed) if powered else 0.0,
        )

    def _roll(self, sample: PlaneSample, bank: float) -> float:
        error = bank - sample.attitude[0]
        self._aileron = _within(self._aileron + PERIOD_S * _BANK_INTEGRAL * error, 0.4)
        return _within(_BANK_GAIN * error + self._aileron - _BANK_DAMPING * sample.rates[0], 1.0)

    def _climb(self, sample: PlaneSample, climb: float, airspeed: float) -> float:
        if sample.airspeed < _SLOW_SHARE * airspeed:  # regain speed before height, to stay clear of a stall
            climb = min(climb, 0.0)
        error = climb - sample.velocity[2]
        self._pitch = _within(self._pitch + PERIOD_S * _CLIMB_INTEGRAL * error, _MAX_PITCH)
        return _within(_CLIMB_GAIN * error + self._pitch, _MAX_PITCH)

    def _glide(self, sample: PlaneSample, airspeed: float) -> float:
        return _within(_GLIDE_GAIN * (sample.airspeed - airspeed) - 0.05, _MAX_PITCH)

    def _nose(self, sample: PlaneSample, pitch: float) -> float:
        error = pitch - sample.attitude[1]
        self._elevator = _within(self._elevator + PERIOD_S * _PITCH_INTEGRAL * error, 0.6)
        # In a banked turn the nose moves through the horizon; this rate feeds the damping of any further rotation.
        return _within(-_PITCH_GAIN * error - self._elevator + _PITCH_DAMPING * sample.rates[1], 1.0)

    def _power(self, sample: PlaneSample, airspeed: float) -> float:
        error = airspeed - sample.airspeed
        self._throttle = min(max(self._throttle + PERIOD_S * _THROTTLE_INTEGRAL * error, 0.0), 1.0)
        return min(max(self._throttle + _THROTTLE_GAIN * error, 0.0), 1.0)


def _within(value: float, most: float) -> float:
    return math.copysign(min(abs(value), most), value)
