"""Flight tasks and pilots: AirSim's commands as velocity set-points for the multirotor engine.

A task is asked at every boundary for an order. The pilot of a vehicle turns the order into a command if it differs from
the last one. Positions and velocities here are (east, north, up).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple, Protocol

from lingjing.engines.multirotor.airframe import LIFT_N, MASS_KG
from lingjing.engines.multirotor.verbs import ATTITUDE, LAND, STEER
from lingjing.engines.sea import GRAVITY
from lingjing.mission.instance import Vector
from lingjing.serve.airsim.arguments import YawMode
from lingjing.trace.records import DEAD, GROUNDED, Action, BodyState

_BRAKE_MPS2 = 1.5
"""Deceleration before the end of a path, m/s^2 (chosen: below the engine's limit of 3)."""
_GAIN = 1.0
"""Speed demanded for a distance near the end, 1/s (chosen)."""
_ARRIVED_M = 0.15
"""Distance at which a place counts as reached, metres (chosen)."""
_SLOW_MPS = 0.3
"""Speed at which a vehicle counts as at rest, m/s (chosen)."""
_LOOKAHEAD_S = 0.6
"""Time ahead on a path to which a vehicle flies (chosen: the lag of the engine's velocity loop)."""
_LEAST_LOOKAHEAD_M = 0.5
"""Least distance ahead on a path, metres (chosen)."""
_CLIMB_MPS, _SINK_MPS = 4.0, 3.0
"""Vertical limits of the engine, m/s (`lingjing.engines.multirotor.control`)."""
_LIFT_OFF_MPS = 1.0
"""Climb of a vehicle that is sent off from the ground without `takeoff`, m/s (chosen)."""
_MOST_TILT_DEG = 60.0
"""Limit of a demanded tilt, degrees (the engine's)."""
_STICK_TILT_DEG = 180.0 / 5.5
"""Tilt of a full stick, degrees (AirSim's simple_flight, level mode: pi / 5.5)."""
_COURSE_MPS = 0.2
"""Speed below which a course has no direction, m/s (chosen)."""
_YAW_RATE_DEG_S = 60.0
"""Largest rate at which a demanded heading turns, degrees a second (chosen: the engine turns by at most 68)."""


class Sticks(NamedTuple):
    """The sticks of a remote control, -1 to 1, and the throttle, 0 to 1."""

    roll: float = 0.0
    pitch: float = 0.0
    """Positive with the nose up: pulled."""
    yaw: float = 0.0
    throttle: float = 0.0


class Order(NamedTuple):
    """The order of a task for the next tick."""

    velocity: Vector = (0.0, 0.0, 0.0)
    """Velocity, m/s; zero holds the place."""
    heading_deg: float | None = None
    """Heading to turn to; None keeps it."""
    lands: bool = False
    """True to descend to the surface below."""
    done: bool | None = None
    """The result of the task if it has ended; None if it goes on."""
    attitude: dict[str, float] | None = None
    """The arguments of a tilt in place of a velocity; None for a velocity."""


HOLD = Order()
"""The order of a vehicle without a task."""


class FlightTask(Protocol):
    """A task of one vehicle."""

    def order(self, body: BodyState, time_s: float) -> Order:
        """Return the order at a boundary. Called once at every boundary from the task's first."""
        ...


class Heading:
    """The heading that a command demands: AirSim's drivetrain and yaw mode."""

    def __init__(self, mode: YawMode, *, forward: bool) -> None:
        self._mode, self._forward = mode, forward
        self._demand: float | None = None
        self._before_s = 0.0

    def at(self, body: BodyState, velocity: Vector, time_s: float) -> float | None:
        """Return the demanded heading, degrees; None to keep the present one."""
        if self._forward:
            if math.hypot(velocity[0], velocity[1]) < _COURSE_MPS:
                return None
            course = math.degrees(math.atan2(velocity[0], velocity[1]))
            return course + (0.0 if self._mode.is_rate else self._mode.value)
        if not self._mode.is_rate:
            return self._mode.value
        if self._mode.value == 0.0:
            return None
        rate = min(max(self._mode.value, -_YAW_RATE_DEG_S), _YAW_RATE_DEG_S)
        if self._demand is None:
            self._demand, self._before_s = body.heading_deg, time_s
        self._demand += rate * (time_s - self._before_s)
        self._before_s = time_s
        return self._demand


class FlyPath:
    """Fly along a path of straight lines and stop at its end."""

    def __init__(self, points: Sequence[Vector], speed_mps: float, heading: Heading, until_s: float) -> None:
        self._points, self._speed, self._heading, self._until_s = tuple(points), speed_mps, heading, until_s
        self._line: tuple[Vector, ...] = ()
        self._leg = 0

    def order(self, body: BodyState, time_s: float) -> Order:
        """Fly to a place ahead on the path."""
        if not self._line:
            self._line = (body.position, *self._points)
        left = math.dist(body.position, self._line[-1])
        last = self._leg == len(self._line) - 2
        if last and left < _ARRIVED_M and math.hypot(*body.velocity) < _SLOW_MPS and body.status != GROUNDED:
            return Order(done=True)
        if time_s >= self._until_s:
            return Order(done=False)
        ahead, left = self._ahead(body.position)
        speed = min(self._speed, _GAIN * left if left < _BRAKE_MPS2 else math.sqrt(_BRAKE_MPS2 * (2.0 * left - 1.5)))
        velocity = _limited(_towards(body.position, ahead, speed))
        if body.status == GROUNDED:
            velocity = (0.0, 0.0, max(velocity[2], _LIFT_OFF_MPS))
        return Order(velocity, self._heading.at(body, velocity, time_s))

    def _ahead(self, place: Vector) -> tuple[Vector, float]:
        """Return the place to fly to, and the length of the way that is left, metres."""
        reach = max(_LEAST_LOOKAHEAD_M, _LOOKAHEAD_S * self._speed)
        while True:
            start, end = self._line[self._leg], self._line[self._leg + 1]
            length = math.dist(start, end)
            along = _projected(place, start, end)
            if self._leg == len(self._line) - 2 or length - along > reach:
                break
            self._leg += 1
        share = min(1.0, (along + reach) / length) if length > 0.0 else 1.0
        a, b, c = (first + share * (second - first) for first, second in zip(start, end, strict=True))
        rest = sum(
            math.dist(*pair) for pair in zip(self._line[self._leg + 1 :], self._line[self._leg + 2 :], strict=False)
        )
        return (a, b, c), max(length - along, math.dist(place, end) if rest == 0.0 else 0.0) + rest


class FlyVelocity:
    """Fly at a velocity until a time."""

    def __init__(
        self, velocity: Callable[[BodyState], Vector], heading: Heading, until_s: float, height_m: float | None = None
    ) -> None:
        """`velocity` gives (east, north, up) in m/s. `height_m` is an elevation to keep instead of `up`."""
        self._velocity, self._heading, self._until_s, self._height_m = velocity, heading, until_s, height_m

    def order(self, body: BodyState, time_s: float) -> Order:
        """Fly at the velocity."""
        if time_s >= self._until_s:
            return Order(done=True)
        east, north, up = self._velocity(body)
        if self._height_m is not None:
            up = min(max(_GAIN * (self._height_m - body.position[2]), -_SINK_MPS), _CLIMB_MPS)
        if body.status == GROUNDED and up <= 0.0:
            east, north, up = 0.0, 0.0, 0.0
        return Order((east, north, up), self._heading.at(body, (east, north, up), time_s))


class FlyAttitude:
    """Hold a tilt, or turn it at a rate, with a throttle or at an elevation, until a time."""

    def __init__(
        self,
        roll_deg: float,
        pitch_deg: float,
        until_s: float,
        *,
        rates: bool = False,
        heading_deg: float | None = None,
        yaw_rate_deg_s: float = 0.0,
        throttle: float | None = None,
        height_m: float = 0.0,
    ) -> None:
        """Roll is positive to the right, pitch with the nose up; with `rates` both are degrees a second.

        `heading_deg`: None for a yaw rate. `throttle`: 0 to 1; None for the elevation `height_m`, metres.
        """
        self._tilt, self._rates, self._until_s = (roll_deg, pitch_deg), rates, until_s
        turn = {"yaw_rate": yaw_rate_deg_s} if heading_deg is None else {"heading": heading_deg % 360.0}
        self._rest = {**turn, **({"height": height_m} if throttle is None else {"throttle": throttle})}
        self._throttle, self._height_m = throttle, height_m
        self._reached: tuple[float, float] | None = None
        self._before_s = 0.0

    def order(self, body: BodyState, time_s: float) -> Order:
        """Hold the tilt. A rate moves the demanded tilt from the one at the start."""
        if time_s >= self._until_s:
            return Order(done=True)
        if body.status == GROUNDED and self._throttle is None and self._height_m <= body.position[2]:
            return HOLD
        roll, pitch = self._tilt
        if self._rates:
            if self._reached is None:
                self._reached, self._before_s = (body.roll_deg, body.pitch_deg), time_s
            passed, self._before_s = time_s - self._before_s, time_s
            self._reached = _bounded(self._reached[0] + roll * passed), _bounded(self._reached[1] + pitch * passed)
            roll, pitch = self._reached
        return Order(attitude={"roll": roll, "pitch": pitch, **self._rest})


class FlyManual:
    """Fly by the sticks of a remote control within limits of speed, until a time."""

    def __init__(
        self, sticks: Callable[[], Sticks], most: tuple[float, float], low_m: float, heading: Heading, until_s: float
    ) -> None:
        """`most`: speeds of full sticks forward and to the right, m/s. `low_m`: the lowest elevation, metres."""
        self._sticks, self._most, self._low_m = sticks, most, low_m
        self._heading, self._until_s = heading, until_s

    def order(self, body: BodyState, time_s: float) -> Order:
        """Fly as the sticks say."""
        if time_s >= self._until_s:
            return Order(done=True)
        sticks = self._sticks()
        ahead, right = -sticks.pitch * self._most[0], sticks.roll * self._most[1]
        sine, cosine = math.sin(math.radians(body.heading_deg)), math.cos(math.radians(body.heading_deg))
        up = _limited((0.0, 0.0, (2.0 * sticks.throttle - 1.0) * _CLIMB_MPS))[2]
        if body.position[2] <= self._low_m:
            up = max(up, 0.0)
        velocity = (ahead * sine + right * cosine, ahead * cosine - right * sine, up)
        if body.status == GROUNDED and up <= 0.0:
            return HOLD
        return Order(velocity, self._heading.at(body, velocity, time_s))


class FlySticks:
    """Fly by the sticks of a remote control as a flight controller's level mode does, until they are let go."""

    def __init__(self, sticks: Callable[[], Sticks | None]) -> None:
        """`sticks` returns None when they are let go."""
        self._sticks = sticks

    def order(self, body: BodyState, time_s: float) -> Order:
        """Hold the tilt of the sticks."""
        sticks = self._sticks()
        if sticks is None:
            return Order(done=True)
        if body.status == GROUNDED and sticks.throttle * LIFT_N <= MASS_KG * GRAVITY:
            return HOLD
        tilt = {"roll": sticks.roll * _STICK_TILT_DEG, "pitch": sticks.pitch * _STICK_TILT_DEG}
        return Order(attitude={**tilt, "yaw_rate": sticks.yaw * _YAW_RATE_DEG_S, "throttle": sticks.throttle})


class Turn:
    """Turn to a heading at the present place."""

    def __init__(self, heading_deg: float, margin_deg: float, until_s: float) -> None:
        self._heading, self._margin, self._until_s = heading_deg, margin_deg, until_s

    def order(self, body: BodyState, time_s: float) -> Order:
        """Turn until the heading is within the margin."""
        error = (self._heading - body.heading_deg + 180.0) % 360.0 - 180.0
        if abs(error) <= self._margin:
            return Order(heading_deg=self._heading, done=True)
        return Order(heading_deg=self._heading, done=False if time_s >= self._until_s else None)


class Hover:
    """Brake and hold the place."""

    def order(self, body: BodyState, time_s: float) -> Order:
        """Wait until the vehicle is slow."""
        return Order(done=True if math.hypot(*body.velocity) < _SLOW_MPS else None)


class Land:
    """Descend to the surface below."""

    def __init__(self, until_s: float) -> None:
        self._until_s = until_s

    def order(self, body: BodyState, time_s: float) -> Order:
        """Descend until the vehicle stands."""
        if body.status == GROUNDED:
            return Order(done=True)
        return Order(lands=True, done=False if time_s >= self._until_s else None)


class Pilot:
    """The pilot of one vehicle: its task, and the command that follows from the last order."""

    def __init__(self, resource: str) -> None:
        self.resource = resource
        self._task: FlightTask | None = None
        self._end: Callable[[bool], None] | None = None
        self._wanted, self._sent = HOLD, HOLD
        self._lands = False

    @property
    def busy(self) -> bool:
        """True with a task."""
        return self._task is not None

    def begin(self, task: FlightTask, end: Callable[[bool], None], body: BodyState, time_s: float) -> None:
        """Begin a task; the one before ends without success. `end` is called with the result."""
        self.cancel()
        self._task, self._end = task, end
        self.look(body, time_s)

    def cancel(self) -> None:
        """End the task without success, and hold the place."""
        self._finish(result=False)
        self._wanted = HOLD

    def look(self, body: BodyState, time_s: float) -> None:
        """Take the task's order at a boundary, or end the task."""
        if self._task is None:
            return
        order = Order(done=False) if body.status == DEAD else self._task.order(body, time_s)
        self._wanted = order if order.done is None else HOLD
        if order.done is not None:
            self._wanted = Order(heading_deg=order.heading_deg)
            self._finish(result=order.done)

    def action(self) -> Action | None:
        """Return the command for the next tick; None if the last one still holds."""
        if self._wanted == self._sent:
            return None
        self._sent = self._wanted
        if self._wanted.lands:
            return Action(verb=LAND, resource=self.resource)
        if self._wanted.attitude is not None:
            return Action(verb=ATTITUDE, resource=self.resource, arguments=dict(self._wanted.attitude))
        east, north, up = self._wanted.velocity
        arguments: dict[str, float] = {"east": east, "north": north, "up": up}
        if self._wanted.heading_deg is not None:
            arguments["heading"] = self._wanted.heading_deg % 360.0
        return Action(verb=STEER, resource=self.resource, arguments=dict(arguments))

    def landed(self) -> None:
        """Forget the last command: the engine has ended it."""
        self._sent = self._wanted = HOLD

    def _finish(self, *, result: bool) -> None:
        end, self._task, self._end = self._end, None, None
        if end is not None:
            end(result)


def _bounded(tilt_deg: float) -> float:
    return min(max(tilt_deg, -_MOST_TILT_DEG), _MOST_TILT_DEG)


def _projected(place: Vector, start: Vector, end: Vector) -> float:
    """Return how far along a line the nearest point to a place is, metres."""
    length = math.dist(start, end)
    if length == 0.0:
        return 0.0
    along = sum((p - a) * (b - a) for p, a, b in zip(place, start, end, strict=True)) / length
    return min(max(along, 0.0), length)


def _towards(place: Vector, goal: Vector, speed: float) -> Vector:
    away = math.dist(place, goal)
    if away < 1e-6:
        return 0.0, 0.0, 0.0
    east, north, up = ((b - a) / away * speed for a, b in zip(place, goal, strict=True))
    return east, north, up


def _limited(velocity: Vector) -> Vector:
    """Return a velocity of the same direction within the vertical limits."""
    east, north, up = velocity
    most = _CLIMB_MPS if up > 0.0 else _SINK_MPS
    scale = min(1.0, most / abs(up)) if up else 1.0
    return east * scale, north * scale, up * scale
