"""The Earth below the orbits: its rotation, and the tangent frame of a scene. Vectors in kilometres, angles in radians.

Greenwich mean sidereal time (IAU 1982, as usual with SGP4) turns TEME into the Earth-fixed frame. Polar motion and
UT1-UTC, about 15 m together, are left out. Points on the ground lie on the WGS-84 ellipsoid.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from lingjing.engines.satellite.orbit import JulianDate, Orbit
from lingjing.mission.instance import Vector

_EQUATOR_KM, _FLATTENING = 6378.137, 1.0 / 298.257223563
"""Equatorial radius, km, and flattening of the Earth (WGS-84)."""
_ROTATION = 7.292115146706979e-5
"""Rotation rate of the Earth, rad/s."""
_J2000_JD = 2_451_545.0
"""Julian day of the epoch J2000.0."""


def sidereal(when: JulianDate) -> float:
    """Return Greenwich mean sidereal time, radians in [0, 2 pi)."""
    centuries = ((when.day - _J2000_JD) + when.fraction) / 36_525.0
    seconds = 67_310.54841 + centuries * (3_164_400_184.812866 + centuries * (0.093104 - 6.2e-6 * centuries))
    return math.radians(seconds / 240.0) % (2.0 * math.pi)


def earth_fixed(orbit: Orbit, when: JulianDate) -> tuple[Vector, Vector]:
    """Return position (km) and velocity (km/s) in the Earth-fixed frame."""
    (x, y, z), (vx, vy, vz) = orbit.at(when)
    angle = sidereal(when)
    cosine, sine = math.cos(angle), math.sin(angle)
    east, north = cosine * x + sine * y, cosine * y - sine * x
    return (
        (east, north, z),
        (cosine * vx + sine * vy + _ROTATION * north, cosine * vy - sine * vx - _ROTATION * east, vz),
    )


@dataclass(frozen=True, slots=True)
class Horizon:
    """The tangent frame of a place on the ellipsoid."""

    place: Vector
    """Earth-fixed position, km."""
    east: Vector
    """Unit vector towards east."""
    north: Vector
    """Unit vector towards north."""
    up: Vector
    """Unit vector upwards."""

    @classmethod
    def at(cls, latitude_deg: float, longitude_deg: float) -> Horizon:
        """Return the frame of a geodetic place (degrees) at height 0."""
        latitude, longitude = math.radians(latitude_deg), math.radians(longitude_deg)
        sp, cp, sl, cl = math.sin(latitude), math.cos(latitude), math.sin(longitude), math.cos(longitude)
        flat = _FLATTENING * (2.0 - _FLATTENING)
        radius = _EQUATOR_KM / math.sqrt(1.0 - flat * sp * sp)
        return cls(
            place=(radius * cp * cl, radius * cp * sl, radius * (1.0 - flat) * sp),
            east=(-sl, cl, 0.0),
            north=(-sp * cl, -sp * sl, cp),
            up=(cp * cl, cp * sl, sp),
        )

    def shifted(self, east_m: float, north_m: float) -> Horizon:
        """Return the frame at a point of its plane, metres away. Directions stay: 0.1 degrees correspond to 11 km."""
        east, north = east_m / 1000.0, north_m / 1000.0
        x, y, z = (p + east * e + north * n for p, e, n in zip(self.place, self.east, self.north, strict=True))
        return Horizon((x, y, z), self.east, self.north, self.up)

    def rotated(self, vector: Vector) -> Vector:
        """Return a direction or velocity in (east, north, up)."""
        return dot(vector, self.east), dot(vector, self.north), dot(vector, self.up)

    def relative(self, position: Vector) -> Vector:
        """Return an Earth-fixed position relative to this place in (east, north, up), km."""
        x, y, z = (p - q for p, q in zip(position, self.place, strict=True))
        return self.rotated((x, y, z))


def elevation_deg(relative: Vector) -> float:
    """Return the elevation above the horizon of a relative position in (east, north, up), degrees."""
    return math.degrees(math.atan2(relative[2], math.hypot(relative[0], relative[1])))


def off_track_km(position: Vector, velocity: Vector, place: Vector) -> float:
    """Return the distance of a place on the ground from the ground track, measured across it, km."""
    normal = _cross(position, velocity)
    share = dot(normal, place) / (math.sqrt(dot(normal, normal)) * math.sqrt(dot(place, place)))
    return _EQUATOR_KM * abs(math.asin(min(max(share, -1.0), 1.0)))


def dot(a: Vector, b: Vector) -> float:
    """Return the scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _cross(a: Vector, b: Vector) -> Vector:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]
