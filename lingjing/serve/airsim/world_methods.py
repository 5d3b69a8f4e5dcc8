"""The methods of the connection, of control, of time and of the world."""

from __future__ import annotations

import math
import re

import msgspec

from lingjing.mission.instance import Vector
from lingjing.serve.airsim.arguments import Arguments, CallError
from lingjing.serve.airsim.context import LATER, Context, Later, Method
from lingjing.serve.airsim.flight_methods import places
from lingjing.serve.airsim.frames import ned
from lingjing.serve.airsim.server import Call
from lingjing.serve.airsim.vehicles import Vehicle, geo_point, plain_name

VERSION = 4
"""Version of the API (`cosysairsim` 3.5.0)."""
LEAST_CLIENT = 1
"""Least version of clients: that of Microsoft's and Colosseum's client `airsim`."""
_LONGEST_PATTERN = 100
"""Most letters of a regular expression (chosen)."""

_SIGHT_DEG = 20.0
"""Largest distance in latitude and longitude to a point of a line of sight, degrees (chosen: `places` is exact to 0.001
degrees there)."""
_SIGHT_M = 50_000.0
"""Length of a line of sight that is examined, metres (chosen: no city is larger)."""


def _constant(value: object) -> Method:
    def answer(context: Context, call: Call, arguments: Arguments) -> object:
        arguments.end()
        return value

    return answer


def _enable(context: Context, call: Call, arguments: Arguments) -> None:
    on, vehicle = arguments.flag("is_enabled"), _vehicle(context, arguments)
    if not on:
        vehicle.pilot.cancel()
    vehicle.controlled = on


def _is_enabled(context: Context, call: Call, arguments: Arguments) -> bool:
    return _vehicle(context, arguments).controlled


def _arm(context: Context, call: Call, arguments: Arguments) -> bool:
    """Note that a vehicle is armed. False without control of it, and for a vehicle that is disarmed twice: scripts
    disarm after `reset`, which has taken the control from them, and AirSim's flight controller answers so."""
    on, vehicle = arguments.flag("arm"), _vehicle(context, arguments)
    if not vehicle.controlled or not (on or vehicle.armed):
        return False
    vehicle.armed = on
    return True


def _vehicles(context: Context, call: Call, arguments: Arguments) -> list[str]:
    arguments.end()
    return [vehicle.name for vehicle in context.fleet.vehicles]


def _settings(context: Context, call: Call, arguments: Arguments) -> str:
    """Return the vehicles and their cameras in the form of AirSim's settings.json."""
    arguments.end()
    vehicles = {vehicle.name: _settings_of(vehicle) for vehicle in context.fleet.vehicles}
    latitude, longitude = context.instance.scene.origin
    origin = {"Latitude": latitude, "Longitude": longitude, "Altitude": 0.0}
    settings = {"SettingsVersion": 2.0, "SimMode": "Multirotor", "OriginGeopoint": origin, "Vehicles": vehicles}
    return msgspec.json.encode(settings).decode()


def _settings_of(vehicle: Vehicle) -> dict[str, object]:
    north, east, down = ned(vehicle.start)
    cameras = {
        camera.name: {
            "CaptureSettings": [
                {"ImageType": 0, "Width": camera.width, "Height": camera.height, "FOV_Degrees": camera.hfov_deg}
            ]
        }
        for camera in vehicle.entity.cameras
    }
    kind = "SimpleFlight" if vehicle.flies else "PhysXCar"
    return {"VehicleType": kind, "X": north, "Y": east, "Z": down, "Cameras": cameras}


def _pause(context: Context, call: Call, arguments: Arguments) -> None:
    context.paused = arguments.flag("is_paused")
    arguments.end()


def _is_paused(context: Context, call: Call, arguments: Arguments) -> bool:
    arguments.end()
    return context.paused


def _continue_time(context: Context, call: Call, arguments: Arguments) -> Later:
    seconds = arguments.seconds("seconds")
    arguments.end()
    return _run(context, call, seconds)


def _continue_frames(context: Context, call: Call, arguments: Arguments) -> Later:
    frames = arguments.seconds("frames")
    arguments.end()
    return _run(context, call, frames * context.tick_s)


def _run(context: Context, call: Call, seconds: float) -> Later:
    if context.run_call is not None:
        raise CallError("another `simContinueForTime` runs")
    ticks = max(1, math.ceil(seconds / context.tick_s - 1e-6))
    context.run_until_s, context.run_call, context.paused = context.time_s + ticks * context.tick_s, call, True
    return LATER


def _reset(context: Context, call: Call, arguments: Arguments) -> Later:
    arguments.end()
    context.resets = True
    return LATER


def _objects(context: Context, call: Call, arguments: Arguments) -> list[str]:
    pattern = arguments.text("name_regex", ".*")
    arguments.end()
    if len(pattern) > _LONGEST_PATTERN or re.search(r"[+*}]\)?[+*{]|\\[1-9]", pattern):
        raise CallError("`name_regex` must be a short pattern without nested repetitions")
    try:
        matcher = re.compile(pattern)
    except re.error as error:
        raise CallError(f"`name_regex` is no regular expression: {error}") from None
    return [name for name in map(plain_name, context.objects) if matcher.fullmatch(name)]


def _sight(context: Context, call: Call, arguments: Arguments) -> bool:
    place = _geo(context, arguments.record("point"))
    vehicle = _vehicle(context, arguments)
    return context.surroundings.is_free(vehicle.body.position, _near(vehicle.body.position, place))


def _sight_between(context: Context, call: Call, arguments: Arguments) -> bool:
    first, second = _geo(context, arguments.record("point1")), _geo(context, arguments.record("point2"))
    arguments.end()
    return context.surroundings.is_free(_near(second, first), _near(first, second))


def _near(first: Vector, second: Vector) -> Vector:
    """Return the second point, or the point of the line to it at which every city has ended."""
    share = min(1.0, _SIGHT_M / max(math.dist(first, second), 1.0))
    x, y, z = (a + share * (b - a) for a, b in zip(first, second, strict=True))
    return x, y, z


def _extents(context: Context, call: Call, arguments: Arguments) -> list[dict[str, float]]:
    """Return the south-western and the north-eastern corner of the city, at elevation 0."""
    arguments.end()
    west, south, east, north = context.surroundings.bounds
    origin = context.instance.scene.origin
    return [geo_point(origin, (west, south, 0.0)), geo_point(origin, (east, north, 0.0))]


def _geo(context: Context, record: dict[str, object]) -> Vector:
    values = Arguments("GeoPoint", [record.get(name) for name in ("latitude", "longitude", "altitude")])
    latitude, longitude = values.number("latitude"), values.number("longitude")
    east, north = places(context.instance.scene.origin, latitude, longitude, _SIGHT_DEG)
    return east, north, values.number("altitude")


def _mark(context: Context, call: Call, arguments: Arguments) -> None:
    """Accept a marker without drawing it, so that scripts that plot fly. The call is in the trace."""


def _log(context: Context, call: Call, arguments: Arguments) -> bool:
    """Accept a message: the calls are in the trace, so that it is recorded."""
    arguments.text("message")
    return True


def _vehicle(context: Context, arguments: Arguments) -> Vehicle:
    vehicle = context.fleet.find(arguments.text("vehicle_name", ""))
    arguments.end()
    return vehicle


_MARKERS = (
    "simFlushPersistentMarkers",
    "simPlotPoints",
    "simPlotLineStrip",
    "simPlotLineList",
    "simPlotArrows",
    "simPlotStrings",
    "simPlotTransforms",
    "simPlotTransformsWithNames",
)
"""The methods that draw markers in AirSim."""

WORLD: dict[str, Method] = {
    "ping": _constant(True),
    "getServerVersion": _constant(VERSION),
    "getMinRequiredClientVersion": _constant(LEAST_CLIENT),
    "enableApiControl": _enable,
    "isApiControlEnabled": _is_enabled,
    "armDisarm": _arm,
    "listVehicles": _vehicles,
    "getSettingsString": _settings,
    "simPause": _pause,
    "simIsPaused": _is_paused,
    "simContinueForTime": _continue_time,
    "simContinueForFrames": _continue_frames,
    "reset": _reset,
    "simListSceneObjects": _objects,
    "simTestLineOfSightToPoint": _sight,
    "simTestLineOfSightBetweenPoints": _sight_between,
    "simGetWorldExtents": _extents,
    "simPrintLogMessage": _log,
    **dict.fromkeys(_MARKERS, _mark),
    "isRecording": _constant(True),
    "startRecording": _constant(None),
}
"""The methods by name. The trace records every episode, so that `isRecording` is always true."""
