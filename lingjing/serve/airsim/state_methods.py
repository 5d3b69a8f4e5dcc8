"""The methods that read the state and the sensors of vehicles."""

from __future__ import annotations

import math
from typing import Any

from lingjing.mission.instance import Vector
from lingjing.serve.airsim.arguments import Arguments, CallError
from lingjing.serve.airsim.context import Context, Method
from lingjing.serve.airsim.frames import attitude, ned, pose, quaternion, to_body, vector3
from lingjing.serve.airsim.server import Call
from lingjing.serve.airsim.vehicles import GRAVITY_MPS2, RAY_RANGE_M, Vehicle, air, distance_data, geo_point, stamp
from lingjing.trace.records import GROUNDED

_QNH_HPA = 1013.25
"""Pressure at sea level of the standard atmosphere, hPa."""
_GPS_ERROR_M = 0.1
"""Horizontal and vertical error that the receiver reports, metres (AirSim's final value); the position has none."""
_FIX_3D = 3
"""AirSim's `GNSS_FIX_3D_FIX`."""
_DOWN_TURN = (0.7071067811865476, 0.0, -0.7071067811865476, 0.0)
_FORWARD_TURN = (1.0, 0.0, 0.0, 0.0)
"""Turns of the distance sensor in the body's frame: downwards and forwards."""


_LIDAR_CHANNELS, _LIDAR_POINTS = 8, 45
"""Rows of a lidar and points of each row (chosen: a picture of the lidar takes a second at most)."""
_LIDAR_UP_DEG, _LIDAR_DOWN_DEG = 10.0, -25.0
"""Elevations of the first and the last row, degrees (AirSim's default for drones is -15 to -25; this looks ahead)."""


def _rays() -> tuple[Vector, ...]:
    """Return the directions of a lidar: forward, right, down."""
    rays: list[Vector] = []
    for row in range(_LIDAR_CHANNELS):
        share = row / (_LIDAR_CHANNELS - 1)
        up = math.radians(_LIDAR_UP_DEG + share * (_LIDAR_DOWN_DEG - _LIDAR_UP_DEG))
        for column in range(_LIDAR_POINTS):
            turn = 2.0 * math.pi * column / _LIDAR_POINTS
            rays.append((math.cos(up) * math.cos(turn), math.cos(up) * math.sin(turn), -math.sin(up)))
    return tuple(rays)


_LIDAR_RAYS = _rays()


def _multirotor(context: Context, call: Call, arguments: Arguments) -> dict[str, Any]:
    vehicle = _of(context, arguments)
    return {
        "collision": vehicle.collision,
        "kinematics_estimated": vehicle.kinematics(),
        "gps_location": geo_point(context.instance.scene.origin, vehicle.body.position),
        "timestamp": stamp(context.time_s),
        "landed_state": 0 if vehicle.body.status == GROUNDED else 1,
        "rc_data": {"timestamp": 0, "is_initialized": False, "is_valid": False},
        "ready": True,
        "ready_message": "",
        "can_arm": True,
    }


def _car(context: Context, call: Call, arguments: Arguments) -> dict[str, Any]:
    vehicle = _of(context, arguments)
    forward, _, _ = to_body(attitude(vehicle.body), ned(vehicle.body.velocity))
    return {
        "speed": forward,
        "gear": 1 if forward > 0.0 else 0,
        "rpm": 0.0,
        "maxrpm": 0.0,
        "handbrake": False,
        "collision": vehicle.collision,
        "kinematics_estimated": vehicle.kinematics(),
        "timestamp": stamp(context.time_s),
    }


def _kinematics(context: Context, call: Call, arguments: Arguments) -> dict[str, Any]:
    return _of(context, arguments).kinematics()


def _environment(context: Context, call: Call, arguments: Arguments) -> dict[str, Any]:
    vehicle = _of(context, arguments)
    pressure, temperature, density = air(vehicle.body.position[2])
    return {
        "position": vector3(vehicle.local(vehicle.body.position)),
        "geo_point": geo_point(context.instance.scene.origin, vehicle.body.position),
        "gravity": vector3((0.0, 0.0, GRAVITY_MPS2)),
        "air_pressure": pressure,
        "temperature": temperature,
        "air_density": density,
    }


def _pose(context: Context, call: Call, arguments: Arguments) -> dict[str, object]:
    return _of(context, arguments).pose()


def _collision(context: Context, call: Call, arguments: Arguments) -> dict[str, Any]:
    return _of(context, arguments).collision


def _imu(context: Context, call: Call, arguments: Arguments) -> dict[str, Any]:
    return _sensed(context, arguments).imu(context.time_s)


def _barometer(context: Context, call: Call, arguments: Arguments) -> dict[str, Any]:
    height = _sensed(context, arguments).body.position[2]
    return {"time_stamp": stamp(context.time_s), "altitude": height, "pressure": air(height)[0], "qnh": _QNH_HPA}


def _magnetometer(context: Context, call: Call, arguments: Arguments) -> dict[str, Any]:
    return _sensed(context, arguments).magnetometer(context.time_s, context.instance.scene.origin)


def _gps(context: Context, call: Call, arguments: Arguments) -> dict[str, Any]:
    vehicle = _sensed(context, arguments)
    return {
        "time_stamp": stamp(context.time_s),
        "gnss": {
            "geo_point": geo_point(context.instance.scene.origin, vehicle.body.position),
            "eph": _GPS_ERROR_M,
            "epv": _GPS_ERROR_M,
            "velocity": vector3(ned(vehicle.body.velocity)),
            "fix_type": _FIX_3D,
            "time_utc": stamp(context.time_s) // 1000,
        },
        "is_valid": True,
    }


def _distance(context: Context, call: Call, arguments: Arguments) -> dict[str, Any]:
    down = "down" in arguments.text("distance_sensor_name", "").lower()
    vehicle = _of(context, arguments)
    direction = _down(vehicle) if down else _forward(vehicle)
    length = context.surroundings.distance(vehicle.body.position, direction)
    return distance_data(length, context.time_s, _DOWN_TURN if down else _FORWARD_TURN)


def _lidar(context: Context, call: Call, arguments: Arguments) -> dict[str, Any]:
    """Return the points of the city around a vehicle, in its own frame: forward, right, down."""
    vehicle = _sensed(context, arguments)
    angles = attitude(vehicle.body)
    axes = [to_body(angles, axis) for axis in _AXES]  # the body's parts of north, east and down
    points: list[float] = []
    for direction in _LIDAR_RAYS:
        north, east, down = (sum(a * b for a, b in zip(axis, direction, strict=True)) for axis in axes)
        reach = context.surroundings.distance(vehicle.body.position, ned((north, east, down)))
        if reach < RAY_RANGE_M:
            points += [reach * part for part in direction]
    return {
        "point_cloud": points,
        "time_stamp": stamp(context.time_s),
        "pose": vehicle.pose(),
        "groundtruth": "",
    }


def _down(vehicle: Vehicle) -> Vector:
    """Return the body's down axis, (east, north, up)."""
    angles = attitude(vehicle.body)
    north, east, down = (to_body(angles, axis)[2] for axis in _AXES)
    return ned((north, east, down))


def _forward(vehicle: Vehicle) -> Vector:
    """Return the body's forward axis, (east, north, up)."""
    angles = attitude(vehicle.body)
    north, east, down = (to_body(angles, axis)[0] for axis in _AXES)
    return ned((north, east, down))


_AXES: tuple[Vector, ...] = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))


def _home(context: Context, call: Call, arguments: Arguments) -> dict[str, float]:
    return geo_point(context.instance.scene.origin, _of(context, arguments).start)


def _object_pose(context: Context, call: Call, arguments: Arguments) -> dict[str, object]:
    name = arguments.text("object_name")
    if arguments.left and not arguments.flag("ned"):
        raise CallError("`simGetObjectPose` answers in north, east, down only: pass ned=True")
    arguments.end()
    for entity in context.objects:
        if name in (entity, entity.replace("[", "").replace("]", "")):
            body = context.states[entity]
            return pose(ned(body.position), quaternion(*attitude(body)))
    nan = float("nan")  # AirSim's answer for an object that does not exist
    return pose((nan, nan, nan), (nan, nan, nan, nan))


def _of(context: Context, arguments: Arguments) -> Vehicle:
    vehicle = context.fleet.find(arguments.text("vehicle_name", ""))
    arguments.end()
    return vehicle


def _sensed(context: Context, arguments: Arguments) -> Vehicle:
    arguments.text("sensor_name", "")
    return _of(context, arguments)


STATE: dict[str, Method] = {
    "getMultirotorState": _multirotor,
    "getCarState": _car,
    "simGetGroundTruthKinematics": _kinematics,
    "simGetPhysicsRawKinematics": _kinematics,
    "simGetGroundTruthEnvironment": _environment,
    "simGetVehiclePose": _pose,
    "simGetCollisionInfo": _collision,
    "simGetObjectPose": _object_pose,
    "getImuData": _imu,
    "getBarometerData": _barometer,
    "getMagnetometerData": _magnetometer,
    "getGpsData": _gps,
    "getDistanceSensorData": _distance,
    "getHomeGeoPoint": _home,
    "getLidarData": _lidar,
}
"""The methods by name."""
