"""The autopilot: from a destination to roll, pitch, yaw rate and thrust, 50 times a second.

A cascade, as flight stacks have it: the distance left gives a speed that can still be braked away (linear near the
goal, a square root beyond), limited in acceleration; the speed error gives an acceleration (PI, with the drag of the
wanted speed fed forward); the acceleration gives tilt and thrust. The integral finds the wind by itself.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from lingjing.mission.instance import Vector
from lingjing.plugins.engines.multirotor.airframe import MASS_KG
from lingjing.plugins.engines.sea import GRAVITY

PERIOD_S = 0.02
"""Control period: 50 Hz."""

BRAKE_MPS2 = 2.0
"""Deceleration that the speed profile plans with."""

_ACCELERATE_MPS2 = 3.0
_CLIMB_MPS = 4.0
_SINK_MPS = 3.0
_LIFT_MPS2 = 2.0
_POSITION_GAIN = 1.0
_VELOCITY_GAIN = 2.0
_INTEGRAL_GAIN = 1.0
_MAX_TILT = math.radians(40.0)
_MAX_LIFT_MPS2 = 4.0
_YAW_GAIN = 1.5
_MAX_YAW_RATE = 1.2
_DRAG = 0.5 * 1.225 * 0.05


@dataclass(frozen=True, slots=True)
class Demand:
    """What the attitude loops are told: radians, radians per second, newtons."""

    roll: float
    pitch: float
    yaw_rate: float
    thrust_n: float


def braking_speed(distance: float, brake: float) -> float:
    """The speed from which `distance` metres suffice to stop, m/s; proportional within the last metres."""
    knee = brake / (_POSITION_GAIN * _POSITION_GAIN)
    if distance <= knee:
        return _POSITION_GAIN * distance
    return math.sqrt(2.0 * brake * (distance - 0.5 * knee))


def wanted_velocity(position: Vector, goal: Vector, cruise: float) -> Vector:
    """The velocity to have now on the way to `goal`; climbing and travelling end together."""
    east, north, up = (there - here for here, there in zip(position, goal, strict=True))
    level = math.hypot(east, north)
    limit = _CLIMB_MPS if up > 0.0 else _SINK_MPS
    speed = min(cruise, braking_speed(level, BRAKE_MPS2))
    if abs(up) > 1.0:
        speed = min(speed, max(level * limit / abs(up), _POSITION_GAIN * min(level, 1.0)))
    vertical = min(limit, braking_speed(abs(up), _LIFT_MPS2))
    if level > 5.0:
        vertical = min(vertical, max(abs(up) * cruise / level, _POSITION_GAIN * min(abs(up), 1.0)))
    scale = speed / level if level > 1e-9 else 0.0
    return east * scale, north * scale, math.copysign(vertical, up)


def tilt(east: float, north: float, up: float, heading: float) -> tuple[float, float]:
    """Roll and pitch (rad) that accelerate by (east, north) m/s^2 while lifting `up`, with the nose at `heading`."""
    forward = east * math.sin(heading) + north * math.cos(heading)
    right = east * math.cos(heading) - north * math.sin(heading)
    pitch = -math.atan2(forward, up + GRAVITY)
    return math.atan2(right * math.cos(pitch), up + GRAVITY), pitch


class Autopilot:
    """Controller state of one vehicle: the limited velocity demand and the wind it has learnt to lean against.
    `mass_kg` is what flies, the load included."""

    def __init__(self) -> None:
        self.mass_kg = MASS_KG
        self._demand: Vector = (0.0, 0.0, 0.0)
        self._trim: Vector = (0.0, 0.0, 0.0)

    def fly(
        self, position: Vector, velocity: Vector, attitude: Vector, goal: Vector, cruise: float, face: float
    ) -> Demand:
        """One period. `attitude` is (roll, pitch, heading) and `face` the heading wanted, in radians."""
        before = self._demand
        self._demand = self._limited(wanted_velocity(position, goal, cruise))
        error = tuple(want - have for want, have in zip(self._demand, velocity, strict=True))
        feed = tuple((now - old) / PERIOD_S for now, old in zip(self._demand, before, strict=True))
        speed = math.hypot(self._demand[0], self._demand[1])
        east, north, up = (
            _VELOCITY_GAIN * error[axis]
            + self._trim[axis]
            + feed[axis]
            + (_DRAG / self.mass_kg * speed * self._demand[axis] if axis < 2 else 0.0)
            for axis in range(3)
        )
        up = min(max(up, -_MAX_LIFT_MPS2), _MAX_LIFT_MPS2)
        level, most = math.hypot(east, north), (GRAVITY + up) * math.tan(_MAX_TILT)
        if level > most:  # leaning as far as allowed: do not wind up against what cannot be reached
            east, north = east * most / level, north * most / level
            self._learn((0.0, 0.0, error[2]))
        else:
            self._learn((error[0], error[1], error[2]))
        roll, pitch = tilt(east, north, up, attitude[2])
        thrust = self.mass_kg * (GRAVITY + up) / max(math.cos(attitude[0]) * math.cos(attitude[1]), 0.5)
        turn = (face - attitude[2] + math.pi) % (2.0 * math.pi) - math.pi
        return Demand(roll, pitch, min(max(_YAW_GAIN * turn, -_MAX_YAW_RATE), _MAX_YAW_RATE), thrust)

    def _limited(self, wanted: Vector) -> Vector:
        east, north = wanted[0] - self._demand[0], wanted[1] - self._demand[1]
        change, most = math.hypot(east, north), _ACCELERATE_MPS2 * PERIOD_S
        scale = min(1.0, most / change) if change > 0.0 else 0.0
        up = min(max(wanted[2] - self._demand[2], -most), most)
        return self._demand[0] + east * scale, self._demand[1] + north * scale, self._demand[2] + up

    def _learn(self, error: Vector) -> None:
        east, north, up = (
            trim + _INTEGRAL_GAIN * PERIOD_S * part for trim, part in zip(self._trim, error, strict=True)
        )
        self._trim = (east, north, min(max(up, -3.0), 3.0))
