"""The methods that fly multirotors."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

from lingjing.mission.instance import Vector
from lingjing.serve.airsim.arguments import Arguments, CallError, YawMode
from lingjing.serve.airsim.context import LATER, Context, Later, Method
from lingjing.serve.airsim.flight import (
    FlightTask,
    FlyAttitude,
    FlyManual,
    FlyPath,
    FlySticks,
    FlyVelocity,
    Heading,
    Hover,
    Land,
    Sticks,
    Turn,
)
from lingjing.serve.airsim.frames import ned
from lingjing.serve.airsim.server import Call
from lingjing.serve.airsim.vehicles import Vehicle
from lingjing.trace.foxglove import geodetic
from lingjing.trace.records import DEAD, GROUNDED, BodyState

_TAKEOFF_M = 3.0
"""Height of a take-off above the ground, metres (AirSim's flight controller: z = -3)."""
_TAKEOFF_MPS = 2.0
"""Climb rate of a take-off, m/s (chosen)."""
_HOME_MPS = 5.0
"""Speed of `goHome`, m/s (chosen)."""
_MOST_POINTS = 10_000
"""Most points of a path (chosen)."""
_KEEP = YawMode(is_rate=True, value=0.0)
"""The yaw mode that keeps the heading."""


def _takeoff(context: Context, call: Call, arguments: Arguments) -> Later:
    until = context.time_s + arguments.seconds("timeout_sec")
    vehicle = _vehicle(context, arguments)
    x, y, z = vehicle.body.position
    if vehicle.body.status != GROUNDED:
        return _begin(context, call, vehicle, Hover())
    return _begin(context, call, vehicle, FlyPath([(x, y, z + _TAKEOFF_M)], _TAKEOFF_MPS, _kept(), until))


def _land(context: Context, call: Call, arguments: Arguments) -> Later:
    until = context.time_s + arguments.seconds("timeout_sec")
    return _begin(context, call, _vehicle(context, arguments), Land(until))


def _home(context: Context, call: Call, arguments: Arguments) -> Later:
    until = context.time_s + arguments.seconds("timeout_sec")
    vehicle = _vehicle(context, arguments)
    goal = vehicle.start  # as AirSim's: to the origin of the vehicle, its height included
    return _begin(context, call, vehicle, FlyPath([goal], _HOME_MPS, _kept(), until))


def _hover(context: Context, call: Call, arguments: Arguments) -> Later:
    return _begin(context, call, _vehicle(context, arguments), Hover())


def _position(context: Context, call: Call, arguments: Arguments) -> Later:
    local = (arguments.number("x"), arguments.number("y"), arguments.number("z"))
    return _along(context, call, arguments, lambda vehicle: [vehicle.world(local)])


def _path(context: Context, call: Call, arguments: Arguments) -> Later:
    points = arguments.vectors("path", _MOST_POINTS)
    return _along(context, call, arguments, lambda vehicle: [vehicle.world(point) for point in points])


def _gps(context: Context, call: Call, arguments: Arguments) -> Later:
    latitude, longitude = arguments.number("latitude"), arguments.number("longitude")
    altitude = arguments.number("altitude")
    east, north = places(context.instance.scene.origin, latitude, longitude)
    return _along(context, call, arguments, lambda vehicle: [(east, north, altitude)])


def _along(context: Context, call: Call, arguments: Arguments, points: Callable[[Vehicle], list[Vector]]) -> Later:
    speed, until = _speed(arguments), context.time_s + arguments.seconds("timeout_sec")
    heading = _heading(arguments)
    arguments.number("lookahead"), arguments.number("adaptive_lookahead")
    vehicle = _vehicle(context, arguments)
    return _begin(context, call, vehicle, FlyPath(points(vehicle), speed, heading, until))


def _height(context: Context, call: Call, arguments: Arguments) -> Later:
    z, speed = arguments.number("z"), _speed(arguments)
    until = context.time_s + arguments.seconds("timeout_sec")
    heading = Heading(arguments.yaw_mode("yaw_mode"), forward=False)
    arguments.number("lookahead"), arguments.number("adaptive_lookahead")
    vehicle = _vehicle(context, arguments)
    x, y, _ = vehicle.body.position
    return _begin(context, call, vehicle, FlyPath([(x, y, vehicle.start[2] - z)], speed, heading, until))


def _velocity(*, body_frame: bool, holds_z: bool) -> Method:
    """Return the method of a velocity: in the world's or the body's frame, with a climb rate or an elevation."""

    def fly(context: Context, call: Call, arguments: Arguments) -> Later:
        vx, vy = arguments.number("vx"), arguments.number("vy")
        third = arguments.number("z" if holds_z else "vz")
        until = context.time_s + arguments.seconds("duration")
        heading = _heading(arguments)
        vehicle = _vehicle(context, arguments)
        down = 0.0 if holds_z else third

        def wanted(body: BodyState) -> Vector:
            yaw = math.radians(body.heading_deg) if body_frame else 0.0
            north = vx * math.cos(yaw) - vy * math.sin(yaw)
            return ned((north, vx * math.sin(yaw) + vy * math.cos(yaw), down))

        height = vehicle.start[2] - third if holds_z else None
        return _begin(context, call, vehicle, FlyVelocity(wanted, heading, until, height))

    return fly


def _yaw(context: Context, call: Call, arguments: Arguments) -> Later:
    yaw, until = arguments.number("yaw"), context.time_s + arguments.seconds("timeout_sec")
    margin = max(arguments.number("margin"), 0.1)
    return _begin(context, call, _vehicle(context, arguments), Turn(yaw, margin, until))


def _yaw_rate(context: Context, call: Call, arguments: Arguments) -> Later:
    heading = Heading(YawMode(is_rate=True, value=arguments.number("yaw_rate")), forward=False)
    until = context.time_s + arguments.seconds("duration")
    vehicle = _vehicle(context, arguments)
    task = FlyVelocity(lambda body: (0.0, 0.0, 0.0), heading, until)
    return _begin(context, call, vehicle, task)


def _attitude(*, rates: bool, yaw_rate: bool, throttle: bool) -> Method:
    """Return the method of a tilt (or of its rates), with a heading or a yaw rate, a throttle or an elevation."""

    def fly(context: Context, call: Call, arguments: Arguments) -> Later:
        roll = math.degrees(arguments.number("roll_rate" if rates else "roll"))
        pitch = math.degrees(arguments.number("pitch_rate" if rates else "pitch"))
        yaw = math.degrees(arguments.number("yaw_rate" if yaw_rate else "yaw"))
        last = arguments.number("throttle" if throttle else "z")
        if throttle and not 0.0 <= last <= 1.0:
            raise CallError(f"`throttle` is a share from 0 to 1, not {last:g}")
        until = context.time_s + arguments.seconds("duration")
        vehicle = _vehicle(context, arguments)
        task = FlyAttitude(
            roll, pitch, until, rates=rates,
            heading_deg=None if yaw_rate else yaw, yaw_rate_deg_s=yaw if yaw_rate else 0.0,
            throttle=last if throttle else None, height_m=0.0 if throttle else vehicle.start[2] - last,
        )  # fmt: skip
        return _begin(context, call, vehicle, task)

    return fly


def _remote_control(context: Context, call: Call, arguments: Arguments) -> None:
    """Take over the sticks. Valid ones fly the vehicle; others let it hold its place."""
    data = arguments.record("rcdata")
    vehicle = _vehicle(context, arguments)
    sticks = Sticks(*(_stick(data, name, low) for name, low in _STICKS))
    vehicle.sticks = sticks if data.get("is_valid") else None
    if vehicle.sticks is not None and not vehicle.pilot.busy:
        vehicle.pilot.begin(FlySticks(lambda: vehicle.sticks), lambda _: None, vehicle.body, context.time_s)


_STICKS = (("roll", -1.0), ("pitch", -1.0), ("yaw", -1.0), ("throttle", 0.0))
"""The sticks with their lowest values; the highest is 1."""


def _stick(data: Mapping[str, object], name: str, low: float) -> float:
    value = data.get(name, 0.0)
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise CallError(f"`{name}` of the remote control is a number, not {value!r}")
    return min(max(float(value), low), 1.0)


def _manual(context: Context, call: Call, arguments: Arguments) -> Later:
    most = arguments.number("vx_max"), arguments.number("vy_max")
    low, until = arguments.number("z_min"), context.time_s + arguments.seconds("duration")
    heading = _heading(arguments)
    vehicle = _vehicle(context, arguments)
    if vehicle.sticks is None:
        raise CallError("no remote control is connected: send valid sticks with `moveByRC` first")
    task = FlyManual(lambda: vehicle.sticks or Sticks(throttle=0.5), most, vehicle.start[2] - low, heading, until)
    return _begin(context, call, vehicle, task)


def _cancel(context: Context, call: Call, arguments: Arguments) -> None:
    _named(context, arguments).pilot.cancel()


def _begin(context: Context, call: Call, vehicle: Vehicle, task: FlightTask) -> Later:
    def end(result: bool) -> None:
        if context.flying.get(vehicle.name) is call:
            del context.flying[vehicle.name]
        call.succeed(result)

    if vehicle.body.status == DEAD:
        raise CallError(f"`{vehicle.name}` has crashed: `reset` begins again")
    vehicle.pilot.cancel()
    context.flying[vehicle.name] = call
    vehicle.pilot.begin(task, end, vehicle.body, context.time_s)
    return LATER


def _vehicle(context: Context, arguments: Arguments) -> Vehicle:
    """Return the multirotor of the last argument, which the client must control."""
    vehicle = _named(context, arguments)
    if not vehicle.controlled:
        raise CallError(f"API control of `{vehicle.name}` is off: call `enableApiControl` first")
    return vehicle


def _named(context: Context, arguments: Arguments) -> Vehicle:
    vehicle = context.fleet.find(arguments.text("vehicle_name", ""))
    arguments.end()
    if not vehicle.flies:
        raise CallError(f"`{vehicle.name}` is no multirotor")
    return vehicle


def _heading(arguments: Arguments) -> Heading:
    drivetrain = arguments.number("drivetrain")
    if drivetrain not in (0.0, 1.0):
        raise CallError("`drivetrain` must be 0 (MaxDegreeOfFreedom) or 1 (ForwardOnly)")
    return Heading(arguments.yaw_mode("yaw_mode"), forward=drivetrain == 1.0)


def _kept() -> Heading:
    return Heading(_KEEP, forward=False)


def _speed(arguments: Arguments) -> float:
    speed = arguments.number("velocity")
    if speed <= 0.0:
        raise CallError(f"`velocity` is a speed above 0 m/s, not {speed:g}")
    return speed


def places(
    origin: tuple[float, float], latitude: float, longitude: float, most_deg: float = 1.0
) -> tuple[float, float]:
    """Return (east, north) of a geographic place, by a few Newton steps of `geodetic`.

    Raises `CallError` for a place more than `most_deg` degrees from the origin.
    """
    if abs(latitude - origin[0]) > most_deg or abs(longitude - origin[1]) > most_deg:
        raise CallError(f"({latitude:g}, {longitude:g}) lies outside the city around ({origin[0]:g}, {origin[1]:g})")
    per_north = geodetic(origin, 0.0, 1.0)[0] - origin[0]
    per_east = geodetic(origin, 1.0, 0.0)[1] - origin[1]
    east = north = 0.0
    for _ in range(8):
        reached = geodetic(origin, east, north)
        north += (latitude - reached[0]) / per_north
        east += (longitude - reached[1]) / per_east
    return east, north


FLIGHT: dict[str, Method] = {
    "takeoff": _takeoff,
    "land": _land,
    "goHome": _home,
    "hover": _hover,
    "moveToPosition": _position,
    "moveOnPath": _path,
    "moveToGPS": _gps,
    "moveToZ": _height,
    "moveByVelocity": _velocity(body_frame=False, holds_z=False),
    "moveByVelocityZ": _velocity(body_frame=False, holds_z=True),
    "moveByVelocityBodyFrame": _velocity(body_frame=True, holds_z=False),
    "moveByVelocityZBodyFrame": _velocity(body_frame=True, holds_z=True),
    "moveByRollPitchYawZ": _attitude(rates=False, yaw_rate=False, throttle=False),
    "moveByRollPitchYawrateZ": _attitude(rates=False, yaw_rate=True, throttle=False),
    "moveByRollPitchYawThrottle": _attitude(rates=False, yaw_rate=False, throttle=True),
    "moveByRollPitchYawrateThrottle": _attitude(rates=False, yaw_rate=True, throttle=True),
    "moveByAngleRatesZ": _attitude(rates=True, yaw_rate=True, throttle=False),
    "moveByAngleRatesThrottle": _attitude(rates=True, yaw_rate=True, throttle=True),
    "moveByRC": _remote_control,
    "moveByManual": _manual,
    "rotateToYaw": _yaw,
    "rotateByYawRate": _yaw_rate,
    "cancelLastTask": _cancel,
}
"""The methods by name."""
