"""The hull: the motion of a small lifeboat of 6 m through moving water.

Fossen's manoeuvring model with three degrees of freedom, in velocities relative to the water. A steady current carries
the hull without a further force. Surge and sway have linear and quadratic damping; sway has the lift of the keel. Yaw
has a part of the Munk moment. Wind acts on the sides of the hull, and waves add resistance. The integration is
classical Runge-Kutta. Angles are radians, the heading is clockwise from north, yaw rate and sway are positive to
starboard, forces are newtons.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from lingjing.engines.sea import current_velocity, wind_velocity
from lingjing.mission.instance import Weather

STEP_S = 0.1
"""Integration step, seconds."""

COARSE_STEP_S = 0.5
"""Integration step with coarse motion, seconds (chosen: the fastest mode of the steered hull decays in 0.5 s)."""

LENGTH_M = 6.0
"""Length of the hull, metres (chosen)."""

HALF_LENGTH_M = LENGTH_M / 2.0

_SURGE_MASS = 1680.0
"""Mass in surge with the added water, kg (chosen: 1600 kg and 5 %)."""

_SWAY_MASS = 2880.0
"""Mass in sway with the added water, kg (chosen: 1600 kg and 80 %)."""
YAW_INERTIA = 5040.0
"""Yaw inertia with the added water, kg m^2 (chosen)."""
# Linear and quadratic damping, N per m/s and per m^2/s^2 (yaw: N m per rad/s and per rad^2/s^2); chosen.
_SURGE_DRAG = (60.0, 90.0)
_SWAY_DRAG = (400.0, 1200.0)
_YAW_DRAG = (2500.0, 6000.0)
_KEEL_LIFT = 1500.0
"""Side force of keel and skeg, N per m^2/s^2 of surge times sway (chosen)."""
_MUNK_SHARE = 0.3
"""Share of the Munk moment that the skeg, far aft, does not cancel (chosen)."""
_AIR_FORCE = 0.5 * 1.225 * 0.9
"""Wind force per area and speed squared, kg/m^3: half the density of air times a drag coefficient of 0.9."""

_FRONT_M2 = 2.5
"""Area of the hull above water seen from ahead, m^2 (chosen)."""

_SIDE_M2 = 6.0
"""Area of the hull above water seen from abeam, m^2 (chosen)."""
_WAVE_DRAG = 80.0
"""Added resistance in head seas, N per square metre of significant wave height; 0 in following seas (chosen)."""

HullState = tuple[float, float, float, float, float, float]
"""east, north (m), heading (rad), surge, sway (m/s through the water), yaw rate (rad/s)."""


def surge_drag(speed: float) -> float:
    """Return the resistance at a speed through still water, N, which the propeller must overcome."""
    return (_SURGE_DRAG[0] + _SURGE_DRAG[1] * abs(speed)) * speed


@dataclass(frozen=True, slots=True)
class HullForcing:
    """Wind, current and waves that act on a hull."""

    wind: tuple[float, float]
    """Velocity of the wind (east, north), m/s."""
    current: tuple[float, float]
    """Velocity of the current (east, north), m/s."""
    wave_height_m: float
    """Significant wave height, metres."""
    wave_to_rad: float
    """Direction in which the waves travel, rad clockwise from north."""

    @classmethod
    def of(cls, weather: Weather) -> HullForcing:
        """Return the forcing of a weather."""
        towards = math.radians(weather.wind_from_deg + 180.0)
        return cls(wind_velocity(weather), current_velocity(weather), weather.wave_height_m, towards)


def ground_velocity(state: HullState, around: HullForcing) -> tuple[float, float]:
    """Return the velocity over ground (east, north), m/s."""
    _, _, heading, surge, sway, _ = state
    sine, cosine = math.sin(heading), math.cos(heading)
    return (
        surge * sine + sway * cosine + around.current[0],
        surge * cosine - sway * sine + around.current[1],
    )


def advance(state: HullState, thrust: float, moment: float, around: HullForcing, step_s: float = STEP_S) -> HullState:
    """Return the state `step_s` later under constant thrust (N) and steering moment (N m)."""
    first = _rates(state, thrust, moment, around)
    second = _rates(_moved(state, first, step_s / 2.0), thrust, moment, around)
    third = _rates(_moved(state, second, step_s / 2.0), thrust, moment, around)
    fourth = _rates(_moved(state, third, step_s), thrust, moment, around)
    mean = tuple((a + 2.0 * b + 2.0 * c + d) / 6.0 for a, b, c, d in zip(first, second, third, fourth, strict=True))
    return _moved(state, mean, step_s)


def _moved(state: HullState, rates: tuple[float, ...], seconds: float) -> HullState:
    east, north, heading, surge, sway, yaw = (x + seconds * dx for x, dx in zip(state, rates, strict=True))
    return east, north, heading, surge, sway, yaw


def _rates(state: HullState, thrust: float, moment: float, around: HullForcing) -> HullState:
    _, _, heading, surge, sway, yaw = state
    east, north = ground_velocity(state, around)
    air_surge, air_sway = _air_force(heading, around.wind[0] - east, around.wind[1] - north)
    head_on = 0.5 * (1.0 - math.cos(heading - around.wave_to_rad))
    waves = _WAVE_DRAG * around.wave_height_m**2 * head_on * min(abs(surge), 1.0)
    x_force = thrust - surge_drag(surge) + air_surge - math.copysign(waves, surge)
    y_force = air_sway - (_SWAY_DRAG[0] + _SWAY_DRAG[1] * abs(sway) + _KEEL_LIFT * abs(surge)) * sway
    munk = _MUNK_SHARE * (_SURGE_MASS - _SWAY_MASS) * surge * sway
    n_moment = moment + munk - (_YAW_DRAG[0] + _YAW_DRAG[1] * abs(yaw)) * yaw
    return (
        east,
        north,
        yaw,
        (x_force + _SWAY_MASS * sway * yaw) / _SURGE_MASS,
        (y_force - _SURGE_MASS * surge * yaw) / _SWAY_MASS,
        n_moment / YAW_INERTIA,
    )


def _air_force(heading: float, east: float, north: float) -> tuple[float, float]:
    ahead = east * math.sin(heading) + north * math.cos(heading)
    abeam = east * math.cos(heading) - north * math.sin(heading)
    speed = math.hypot(ahead, abeam)
    return _AIR_FORCE * _FRONT_M2 * speed * ahead, _AIR_FORCE * _SIDE_M2 * speed * abeam
