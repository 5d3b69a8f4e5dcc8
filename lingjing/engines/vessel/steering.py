"""Steering: line-of-sight guidance over ground, and control of heading and speed through the water.

A vessel follows the line from its start to its goal with a fixed lookahead. The velocity over ground beyond its own
surge is measured as drift (current, leeway, swing). The heading compensates this drift.
"""

from __future__ import annotations

import math

from lingjing.engines.vessel.hull import STEP_S, YAW_INERTIA, HullForcing, HullState, ground_velocity, surge_drag
from lingjing.mission.geometry2d import Vector2
from lingjing.scene.outlines import wrapped

ARRIVED_M = 5.0
"""Distance from the goal at which a move is complete, metres (chosen)."""

_LOOKAHEAD_M = 20.0
"""Lookahead of the guidance, metres (chosen)."""

_BRAKE_MPS2 = 0.3
"""Deceleration of the speed profile before the goal, m/s^2 (chosen)."""

_STANDOFF_M = 2.0
"""Distance from the goal at which the speed profile ends, metres (chosen)."""

_CREEP_MPS = 0.3
"""Least speed before the goal, m/s (chosen)."""

_THRUST_MARGIN = 1.8
"""Largest thrust as a multiple of the resistance at top speed (chosen)."""

_REVERSE = 0.5
"""Largest reverse thrust as a share of the largest thrust (chosen)."""

_MAX_HEADING_ERROR = 0.8
"""Limit of the heading error in the control law, rad (chosen)."""

_MAX_MOMENT = 2500.0
"""Limit of the steering moment, N m (chosen)."""

_DRIFT_TIME_S = 10.0
"""Time constant of the drift's measurement, seconds (chosen)."""

_IDLE_M = 2.5
"""Distance from the station within which the propeller rests, metres (chosen)."""

_STATION_MPS = 1.0
"""Largest speed back to the station, m/s (chosen)."""

# Gains, tuned by hand (chosen): N per m/s, 1/s^2, 1/s and 1/s.
_SURGE_GAIN = 1500.0
_HEADING_GAIN = 0.64
_YAW_DAMPING = 1.5
_STATION_GAIN = 0.3


class Steering:
    """The control of one hull of top speed `speed_mps` (through the water), with the drift that it has measured.

    `step_s` is the time between two calls, seconds.
    """

    def __init__(self, speed_mps: float, around: HullForcing, step_s: float = STEP_S) -> None:
        self.around = around
        self._drift_share = step_s / _DRIFT_TIME_S
        self._drift: Vector2 = around.current
        self.drive(speed_mps)

    def drive(self, speed_mps: float) -> None:
        """Set the top speed, and with it the largest thrust."""
        self._speed = speed_mps
        self._most = _THRUST_MARGIN * surge_drag(speed_mps)

    def follow(self, state: HullState, start: Vector2, goal: Vector2) -> tuple[float, float]:
        """Return thrust (N) and moment (N m) on the way along the line from `start` to `goal`."""
        self._measure(state)
        left = math.dist(state[:2], goal)
        speed = min(self._speed, math.sqrt(2.0 * _BRAKE_MPS2 * max(left - _STANDOFF_M, 0.0)) + _CREEP_MPS)
        return self._steer(state, line_of_sight(state[:2], start, goal), speed)

    def keep(self, state: HullState, station: Vector2) -> tuple[float, float]:
        """Return thrust and moment that hold the hull near a point with little power."""
        self._measure(state)
        left = math.dist(state[:2], station)
        if left < _IDLE_M:
            return self._surge(state, 0.0), self._turn(state, state[2])
        course = math.atan2(station[0] - state[0], station[1] - state[1])
        need = _STATION_GAIN * left + math.hypot(*self._drift)
        return self._steer(state, course, min(need, _STATION_MPS, self._speed))

    def stop(self, state: HullState) -> tuple[float, float]:
        """Return thrust and moment that stop the hull."""
        self._measure(state)
        return self._surge(state, 0.0), self._turn(state, state[2])

    def _steer(self, state: HullState, course: float, speed: float) -> tuple[float, float]:
        abeam = self._drift[0] * math.cos(course) - self._drift[1] * math.sin(course)
        heading = course - math.asin(min(max(abeam / max(speed, 0.1), -0.95), 0.95))
        off = wrapped(heading - state[2])
        return self._surge(state, speed * max(math.cos(off), 0.2)), self._turn(state, heading)

    def _surge(self, state: HullState, speed: float) -> float:
        return min(max(surge_drag(speed) + _SURGE_GAIN * (speed - state[3]), -_REVERSE * self._most), self._most)

    def _turn(self, state: HullState, heading: float) -> float:
        error = min(max(wrapped(heading - state[2]), -_MAX_HEADING_ERROR), _MAX_HEADING_ERROR)
        moment = YAW_INERTIA * (_HEADING_GAIN * error - _YAW_DAMPING * state[5])
        return min(max(moment, -_MAX_MOMENT), _MAX_MOMENT)

    def _measure(self, state: HullState) -> None:
        east, north = ground_velocity(state, self.around)
        share = self._drift_share
        self._drift = (
            self._drift[0] + share * (east - state[3] * math.sin(state[2]) - self._drift[0]),
            self._drift[1] + share * (north - state[3] * math.cos(state[2]) - self._drift[1]),
        )


def line_of_sight(here: Vector2, start: Vector2, goal: Vector2) -> float:
    """Return the course over ground (rad) that leads back to the line and along it; near the goal, straight to it."""
    along = math.atan2(goal[0] - start[0], goal[1] - start[1])
    if math.dist(here, goal) < _LOOKAHEAD_M or math.dist(start, goal) < _LOOKAHEAD_M:
        return math.atan2(goal[0] - here[0], goal[1] - here[1])
    east, north = here[0] - start[0], here[1] - start[1]
    passed = east * math.sin(along) + north * math.cos(along)
    if passed > math.dist(start, goal):
        return math.atan2(goal[0] - here[0], goal[1] - here[1])
    off = east * math.cos(along) - north * math.sin(along)
    return along - math.atan2(off, _LOOKAHEAD_M)
