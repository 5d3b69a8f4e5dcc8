"""The controller: roll, pitch, yaw rate and thrust towards a destination or at a wanted velocity, 50 times a second.

It is a cascade, as in common flight controllers. The remaining distance gives a speed that can still be braked away:
linear near the goal, a square root farther out. The acceleration of this demand is limited. The speed error gives an
acceleration (PI, with the drag at the demanded speed fed forward). The acceleration gives tilt and thrust. The integral
compensates the wind.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from lingjing.engines.aircraft import PERIOD_S
from lingjing.engines.multirotor.airframe import LIFT_N, MASS_KG
from lingjing.engines.sea import GRAVITY
from lingjing.mission.instance import Vector

BRAKE_MPS2 = 2.0
"""Deceleration of the speed profile, m/s^2 (chosen)."""

_ACCELERATE_MPS2 = 3.0
"""Limit of the change of the demanded velocity, m/s^2 (chosen)."""

CLIMB_MPS = 4.0
"""Largest climb rate, m/s (chosen)."""

SINK_MPS = 3.0
"""Largest sink rate, m/s (chosen)."""

_LIFT_MPS2 = 2.0
"""Vertical deceleration of the speed profile, m/s^2 (chosen)."""

_MAX_LIFT_MPS2 = 4.0
"""Limit of the vertical acceleration, m/s^2 (chosen)."""

_MAX_TILT = math.radians(40.0)
"""Limit of the tilt, rad (chosen)."""

_MAX_YAW_RATE = 1.2
"""Limit of the yaw rate, rad/s (chosen)."""

DRAG = 0.5 * 1.225 * 0.05
"""Drag per speed squared, kg/m: half the density of air times the drag area of the airframe (0.05 m^2)."""

# Gains of the loops, 1/s (integral: 1/s^2), tuned by hand in flights of the airframe (chosen).
_POSITION_GAIN = 1.0
_VELOCITY_GAIN = 2.0
_INTEGRAL_GAIN = 1.0
_YAW_GAIN = 1.5


_MAX_HELD_TILT = math.radians(60.0)
"""Limit of a tilt that a set-point demands, rad (chosen: beyond it no thrust of this airframe carries it)."""


class AttitudeSetPoint(NamedTuple):
    """A tilt that is held until the next set-point."""

    roll: float
    """Rad, positive to the right."""
    pitch: float
    """Rad, positive with the nose up."""
    heading: float | None
    """Heading to turn to, rad; None with a yaw rate."""
    yaw_rate: float
    """Rad/s; without meaning beside a heading."""
    throttle: float | None
    """Share of the largest thrust, 0 to 1; None with a height."""
    height_m: float
    """Elevation to keep, metres; without meaning beside a throttle."""


class _AttitudeDemand(NamedTuple):
    """Demands on the attitude loops."""

    roll: float
    """Roll, rad."""
    pitch: float
    """Pitch, rad."""
    yaw_rate: float
    """Yaw rate, rad/s."""
    thrust_n: float
    """Thrust, newtons."""


def _braking_speed(distance: float, brake: float) -> float:
    """Return the speed from which `distance` metres suffice to stop, m/s; it is proportional within the last metres."""
    knee = brake / (_POSITION_GAIN * _POSITION_GAIN)
    if distance <= knee:
        return _POSITION_GAIN * distance
    return math.sqrt(2.0 * brake * (distance - 0.5 * knee))


def wanted_velocity(position: Vector, goal: Vector, cruise: float) -> Vector:
    """Return the velocity demand on the way to `goal`; the climb and the horizontal motion end together."""
    east, north, up = goal[0] - position[0], goal[1] - position[1], goal[2] - position[2]
    level = math.hypot(east, north)
    limit = CLIMB_MPS if up > 0.0 else SINK_MPS
    speed = min(cruise, _braking_speed(level, BRAKE_MPS2))
    if abs(up) > 1.0:
        speed = min(speed, max(level * limit / abs(up), _POSITION_GAIN * min(level, 1.0)))
    vertical = min(limit, _braking_speed(abs(up), _LIFT_MPS2))
    if level > 5.0:
        vertical = min(vertical, max(abs(up) * cruise / level, _POSITION_GAIN * min(abs(up), 1.0)))
    scale = speed / level if level > 1e-9 else 0.0
    return east * scale, north * scale, math.copysign(vertical, up)


def tilt(east: float, north: float, up: float, heading: float) -> tuple[float, float]:
    """Return roll and pitch (rad) that accelerate by (east, north) and `up`, m/s^2, with the nose at `heading`."""
    forward = east * math.sin(heading) + north * math.cos(heading)
    right = east * math.cos(heading) - north * math.sin(heading)
    pitch = -math.atan2(forward, up + GRAVITY)
    return math.atan2(right * math.cos(pitch), up + GRAVITY), pitch


class PositionController:
    """Controller state of one vehicle: the limited velocity demand, and the integral that holds against the wind.

    `mass_kg` is the mass in flight, the load included. `period_s` is the time between two calls of `fly`, seconds.
    """

    def __init__(self, period_s: float = PERIOD_S) -> None:
        self.mass_kg = MASS_KG
        self._period_s = period_s
        self._demand: Vector = (0.0, 0.0, 0.0)
        self._trim: Vector = (0.0, 0.0, 0.0)

    def fly(self, velocity: Vector, attitude: Vector, wanted: Vector, face: float) -> _AttitudeDemand:
        """Return the demands of one period for a wanted velocity, m/s.

        `attitude` is (roll, pitch, heading), `face` the demanded heading; rad.
        """
        before = self._demand
        demand = self._demand = self._limited(wanted)
        error = (demand[0] - velocity[0], demand[1] - velocity[1], demand[2] - velocity[2])
        trim, drag = self._trim, DRAG / self.mass_kg * math.hypot(demand[0], demand[1])
        east = _VELOCITY_GAIN * error[0] + trim[0] + (demand[0] - before[0]) / self._period_s + drag * demand[0]
        north = _VELOCITY_GAIN * error[1] + trim[1] + (demand[1] - before[1]) / self._period_s + drag * demand[1]
        up = _VELOCITY_GAIN * error[2] + trim[2] + (demand[2] - before[2]) / self._period_s
        up = min(max(up, -_MAX_LIFT_MPS2), _MAX_LIFT_MPS2)
        level, most = math.hypot(east, north), (GRAVITY + up) * math.tan(_MAX_TILT)
        if level > most:  # at the tilt limit the integral stops growing (anti-windup)
            east, north = east * most / level, north * most / level
            self._learn((0.0, 0.0, error[2]))
        else:
            self._learn(error)
        roll, pitch = tilt(east, north, up, attitude[2])
        thrust = self.mass_kg * (GRAVITY + up) / max(math.cos(attitude[0]) * math.cos(attitude[1]), 0.5)
        turn = (face - attitude[2] + math.pi) % (2.0 * math.pi) - math.pi
        return _AttitudeDemand(roll, pitch, min(max(_YAW_GAIN * turn, -_MAX_YAW_RATE), _MAX_YAW_RATE), thrust)

    def hold(self, point: AttitudeSetPoint, height_m: float, velocity: Vector, attitude: Vector) -> _AttitudeDemand:
        """Return the demands of one period for a tilt. `height_m` is the present elevation, metres.

        A later velocity demand starts from the velocity that the tilt has led to.
        """
        self._demand = velocity
        roll = min(max(point.roll, -_MAX_HELD_TILT), _MAX_HELD_TILT)
        pitch = min(max(point.pitch, -_MAX_HELD_TILT), _MAX_HELD_TILT)
        if point.throttle is not None:
            thrust = point.throttle * LIFT_N
        else:
            climb = min(max(_POSITION_GAIN * (point.height_m - height_m), -SINK_MPS), CLIMB_MPS)
            up = min(max(_VELOCITY_GAIN * (climb - velocity[2]), -_MAX_LIFT_MPS2), _MAX_LIFT_MPS2)
            thrust = self.mass_kg * (GRAVITY + up) / max(math.cos(attitude[0]) * math.cos(attitude[1]), 0.5)
        rate = point.yaw_rate
        if point.heading is not None:
            rate = _YAW_GAIN * ((point.heading - attitude[2] + math.pi) % (2.0 * math.pi) - math.pi)
        return _AttitudeDemand(roll, pitch, min(max(rate, -_MAX_YAW_RATE), _MAX_YAW_RATE), min(thrust, LIFT_N))

    def _limited(self, wanted: Vector) -> Vector:
        east, north = wanted[0] - self._demand[0], wanted[1] - self._demand[1]
        change, most = math.hypot(east, north), _ACCELERATE_MPS2 * self._period_s
        scale = min(1.0, most / change) if change > 0.0 else 0.0
        up = min(max(wanted[2] - self._demand[2], -most), most)
        return self._demand[0] + east * scale, self._demand[1] + north * scale, self._demand[2] + up

    def _learn(self, error: Vector) -> None:
        east, north, up = self._trim
        share = _INTEGRAL_GAIN * self._period_s
        up += share * error[2]
        self._trim = (east + share * error[0], north + share * error[1], min(max(up, -3.0), 3.0))
