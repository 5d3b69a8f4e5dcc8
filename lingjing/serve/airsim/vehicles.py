"""The vehicles of the episode: their kinematics and sensors, computed from the states that the engines report.

Sensors have no noise. Angular rates and accelerations are means over the last tick, because engines report neither.
"""

from __future__ import annotations

import math
from typing import Any

from lingjing.mission.instance import AgentSpec, Entity, Vector
from lingjing.scene.sight import SightLines
from lingjing.scene.terrain import Terrain
from lingjing.serve.airsim.arguments import CallError
from lingjing.serve.airsim.driving import Driver
from lingjing.serve.airsim.flight import Pilot, Sticks
from lingjing.serve.airsim.frames import (
    attitude,
    less,
    ned,
    pose,
    quaternion,
    quaternionr,
    to_body,
    vector3,
    wrapped,
)
from lingjing.trace.foxglove import geodetic
from lingjing.trace.records import GROUNDED, BodyState

GRAVITY_MPS2 = 9.80665
"""Standard gravity, m/s^2."""

_SEA_LEVEL_PA, _SEA_LEVEL_K, _LAPSE_K_M, _EXPONENT = 101_325.0, 288.15, 0.0065, 5.25588
"""The International Standard Atmosphere: pressure, temperature, lapse rate, exponent of the pressure."""
_GAS_J_KG_K = 287.05
"""Specific gas constant of dry air, J/(kg K)."""

_DIPOLE_NT = (-29_404.8, -1_450.9, 4_652.5)
"""The dipole of the earth's magnetic field: g10, g11, h11 of IGRF-13, epoch 2020, nT."""
_NT_GAUSS = 1e-5

_NEAR_M, RAY_RANGE_M = 0.2, 40.0
"""Range of the distance sensor, metres (AirSim's defaults)."""
_RAY_STEPS = 14
"""Halvings of the range of a ray: 40 m to 2 mm."""

_EPOCH_NS = 1_000_000_000
"""Time stamp of mission time 0, ns: not zero, which clients take for no data."""


class Vehicle:
    """A vehicle that clients fly or look at."""

    def __init__(self, entity: Entity, agent: AgentSpec, body: BodyState) -> None:
        self.entity, self.agent = entity, agent
        self.name = plain_name(entity.id)
        """Name for clients: the entity's id without brackets."""
        self.pilot = Pilot(entity.id)
        self.driver = Driver(entity.id)
        """The driver of a car. A multirotor has an idle driver, and a car has an idle pilot."""
        self.start = body.position
        """Place at boundary 0, (east, north, up): the origin of its own frame."""
        self.controlled = self.armed = False
        self.sticks: Sticks | None = None
        """The sticks of a remote control; None without one."""
        self.body = body
        self.collision: dict[str, Any] = _no_collision()
        self._rates: Vector = (0.0, 0.0, 0.0)
        self._acceleration: Vector = (0.0, 0.0, 0.0)

    @property
    def flies(self) -> bool:
        """True for a multirotor."""
        return self.entity.engine == "multirotor"

    def update(self, body: BodyState, passed_s: float) -> None:
        """Take over the state at a boundary, `passed_s` seconds after the one before."""
        if passed_s > 0.0:
            before, now = attitude(self.body), attitude(body)
            roll, pitch, yaw = (wrapped(b - a) / passed_s for a, b in zip(before, now, strict=True))
            (sr, cr), (sp, cp) = ((math.sin(angle), math.cos(angle)) for angle in now[:2])
            self._rates = (roll - sp * yaw, cr * pitch + cp * sr * yaw, -sr * pitch + cp * cr * yaw)
            x, y, z = (change / passed_s for change in less(ned(body.velocity), ned(self.body.velocity)))
            self._acceleration = (x, y, z)
        if body.status == GROUNDED and self.body.status != GROUNDED:
            self.pilot.landed()
        self.body = body

    def collide(self, other: str, time_s: float) -> None:
        """Note a collision."""
        self.collision = _no_collision() | {
            "has_collided": True,
            "position": vector3(self.local(self.body.position)),
            "impact_point": vector3(self.local(self.body.position)),
            "object_name": other,
            "object_id": 0,
            "time_stamp": stamp(time_s),
        }

    def local(self, place: Vector) -> Vector:
        """Return a place (east, north, up) in the vehicle's frame (north, east, down)."""
        return less(ned(place), ned(self.start))

    def world(self, local: Vector) -> Vector:
        """Return a place of the vehicle's frame as (east, north, up)."""
        east, north, up = ned(local)
        return east + self.start[0], north + self.start[1], up + self.start[2]

    def pose(self) -> dict[str, object]:
        """Return its pose in its own frame."""
        return pose(self.local(self.body.position), quaternion(*attitude(self.body)))

    def kinematics(self) -> dict[str, Any]:
        """Return a `KinematicsState`: velocity and acceleration in the world, the rates in the body's frame."""
        return {
            **self.pose(),
            "linear_velocity": vector3(ned(self.body.velocity)),
            "angular_velocity": vector3(self._rates),
            "linear_acceleration": vector3(self._acceleration),
            "angular_acceleration": vector3((0.0, 0.0, 0.0)),
        }

    def imu(self, time_s: float) -> dict[str, Any]:
        """Return an `ImuData`: the specific force in the body's frame; (0, 0, -9.8) at rest."""
        north, east, down = self._acceleration
        return {
            "time_stamp": stamp(time_s),
            "orientation": quaternionr(quaternion(*attitude(self.body))),
            "angular_velocity": vector3(self._rates),
            "linear_acceleration": vector3(to_body(attitude(self.body), (north, east, down - GRAVITY_MPS2))),
        }

    def magnetometer(self, time_s: float, origin: tuple[float, float]) -> dict[str, Any]:
        """Return a `MagnetometerData` in gauss, of the earth's dipole."""
        latitude, longitude = geodetic(origin, *self.body.position[:2])
        field = to_body(attitude(self.body), dipole_field(latitude, longitude))
        return {"time_stamp": stamp(time_s), "magnetic_field_body": vector3(field), "magnetic_field_covariance": []}


def stamp(time_s: float) -> int:
    """Return mission time as a time stamp, ns."""
    return _EPOCH_NS + round(time_s * 1e9)


def plain_name(entity: str) -> str:
    """Return an entity's id without brackets: `uav[1]` is `uav1`."""
    return entity.replace("[", "").replace("]", "")


def geo_point(origin: tuple[float, float], place: Vector) -> dict[str, float]:
    """Return a `GeoPoint`; the altitude is the elevation over the scene's zero."""
    latitude, longitude = geodetic(origin, place[0], place[1])
    return {"latitude": latitude, "longitude": longitude, "altitude": place[2]}


def air(height_m: float) -> tuple[float, float, float]:
    """Return pressure (Pa), temperature (K) and density (kg/m^3) of the standard atmosphere."""
    temperature = _SEA_LEVEL_K - _LAPSE_K_M * height_m
    pressure = _SEA_LEVEL_PA * (temperature / _SEA_LEVEL_K) ** _EXPONENT
    return pressure, temperature, pressure / (_GAS_J_KG_K * temperature)


def dipole_field(latitude: float, longitude: float) -> Vector:
    """Return the field of the earth's dipole (north, east, down), gauss."""
    g10, g11, h11 = _DIPOLE_NT
    polar, along = math.radians(90.0 - latitude), math.radians(longitude)
    axis = g11 * math.cos(along) + h11 * math.sin(along)
    outward = 2.0 * (g10 * math.cos(polar) + axis * math.sin(polar))
    south = g10 * math.sin(polar) - axis * math.cos(polar)
    east = g11 * math.sin(along) - h11 * math.cos(along)
    return -south * _NT_GAUSS, east * _NT_GAUSS, -outward * _NT_GAUSS


class Surroundings:
    """Free lines and distances in the city."""

    def __init__(self, terrain: Terrain, sight: SightLines, bounds: tuple[float, float, float, float]) -> None:
        self._terrain, self._sight = terrain, sight
        self.bounds = bounds
        """West, south, east and north border of the city, metres."""

    def is_free(self, first: Vector, second: Vector) -> bool:
        """Return whether nothing of the city stands between two places (east, north, up)."""
        return self._sight.is_free(first, second) is not False

    def distance(self, place: Vector, direction: Vector) -> float:
        """Return the length of a ray until it meets the city or its water, metres, within the sensor's range."""
        low, high = 0.0, RAY_RANGE_M
        if self._is_clear(place, direction, high):
            return high
        for _ in range(_RAY_STEPS):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if self._is_clear(place, direction, middle) else (low, middle)
        return max(high, _NEAR_M)

    def _is_clear(self, place: Vector, direction: Vector, length: float) -> bool:
        x, y, z = (start + length * part for start, part in zip(place, direction, strict=True))
        level = self._terrain.water_level(x, y)
        return (level is None or z > level) and self.is_free(place, (x, y, z))


def distance_data(distance: float, time_s: float, turn: tuple[float, float, float, float]) -> dict[str, Any]:
    """Return a `DistanceSensorData`."""
    return {
        "time_stamp": stamp(time_s),
        "distance": distance,
        "min_distance": _NEAR_M,
        "max_distance": RAY_RANGE_M,
        "relative_pose": pose((0.0, 0.0, 0.0), turn),
    }


class Fleet:
    """The vehicles by name."""

    def __init__(self, vehicles: tuple[Vehicle, ...]) -> None:
        self.vehicles = vehicles
        self._named = {key: vehicle for vehicle in vehicles for key in (vehicle.entity.id, vehicle.name.lower())}

    def find(self, name: str) -> Vehicle:
        """Return the vehicle of a name; the first for "". Raises `CallError`."""
        vehicle = self.vehicles[0] if not name else self._named.get(name) or self._named.get(name.lower())
        if vehicle is None:
            known = ", ".join(each.name for each in self.vehicles)
            raise CallError(f"there is no vehicle `{name[:60]}`: {known}")
        return vehicle


def _no_collision() -> dict[str, Any]:
    nowhere = vector3((0.0, 0.0, 0.0))
    return {
        "has_collided": False,
        "normal": nowhere,
        "impact_point": nowhere,
        "position": nowhere,
        "penetration_depth": 0.0,
        "time_stamp": 0,
        "object_name": "",
        "object_id": -1,
    }
