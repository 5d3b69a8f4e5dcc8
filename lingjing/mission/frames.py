"""Coordinate frames of `resetScenario` documents, to and from the world frame (east, north, elevation in metres).

- Unreal, as Cesium for Unreal places it: left-handed centimetres, X east, Y **south**, Z up. So east = X/100,
  north = -Y/100, elevation = Z/100; `yaw` turns clockwise from X, so the compass heading is 90 deg + yaw.
- WGS84 `lon`/`lat`/`alt`: transverse Mercator about the scene's origin with scale 1 on its meridian (Krüger's series to
  the fourth power of n; its own error is below a micrometre within 100 km). World coordinates are by definition this
  projection; against a plane tangent at the origin it differs by 1 mm at 5 km. `alt` is taken as elevation as it is:
  the geoid's undulation is not applied.
"""

from __future__ import annotations

import math

from lingjing.sums import total

EQUATOR_M = 6_378_137.0
"""Semi-major axis of WGS84, metres (NIMA TR8350.2)."""
FLATTENING = 1.0 / 298.257223563
"""Flattening of WGS84 (NIMA TR8350.2)."""

_N = FLATTENING / (2.0 - FLATTENING)
_RECTIFYING_M = EQUATOR_M / (1.0 + _N) * (1.0 + _N**2 / 4.0 + _N**4 / 64.0)
_ECCENTRICITY = math.sqrt(FLATTENING * (2.0 - FLATTENING))
# Krüger (1912), as printed by Karney, "Transverse Mercator with an accuracy of a few nanometers" (2011), eqs. 35, 36.
_ALPHA = (
    _N / 2 - 2 * _N**2 / 3 + 5 * _N**3 / 16 + 41 * _N**4 / 180,
    13 * _N**2 / 48 - 3 * _N**3 / 5 + 557 * _N**4 / 1440,
    61 * _N**3 / 240 - 103 * _N**4 / 140,
    49561 * _N**4 / 161280,
)
_BETA = (
    _N / 2 - 2 * _N**2 / 3 + 37 * _N**3 / 96 - _N**4 / 360,
    _N**2 / 48 + _N**3 / 15 - 437 * _N**4 / 1440,
    17 * _N**3 / 480 - 37 * _N**4 / 840,
    4397 * _N**4 / 161280,
)


def from_unreal(x: float, y: float, z: float) -> tuple[float, float, float]:
    """Unreal centimetres to east, north, elevation in metres."""
    return _shifted(x, -2), _shifted(-y, -2), _shifted(z, -2)


def to_unreal(east: float, north: float, elevation: float) -> tuple[float, float, float]:
    """East, north, elevation in metres to Unreal centimetres.

    `from_unreal` gives the metres back exactly if they have at most 15 significant digits.
    """
    return _shifted(east, 2), _shifted(-north, 2), _shifted(elevation, 2)


def compass_from_yaw(yaw_deg: float) -> float:
    """Unreal's yaw to a compass heading in [0, 360)."""
    return (90.0 + yaw_deg) % 360.0


def from_geodetic(latitude: float, longitude: float, origin: tuple[float, float]) -> tuple[float, float]:
    """Degrees to (east, north) in metres about `origin` (latitude, longitude)."""
    easting, northing = _project(latitude, longitude - origin[1])
    return easting, northing - _project(origin[0], 0.0)[1]


def to_geodetic(east: float, north: float, origin: tuple[float, float]) -> tuple[float, float]:
    """(east, north) in metres about `origin` to (latitude, longitude) in degrees."""
    xi = (north + _project(origin[0], 0.0)[1]) / _RECTIFYING_M
    eta = east / _RECTIFYING_M
    xi0 = xi - total(b * math.sin(2 * j * xi) * math.cosh(2 * j * eta) for j, b in enumerate(_BETA, start=1))
    eta0 = eta - total(b * math.cos(2 * j * xi) * math.sinh(2 * j * eta) for j, b in enumerate(_BETA, start=1))
    conformal = math.sin(xi0) / math.hypot(math.sinh(eta0), math.cos(xi0))
    longitude = math.degrees(math.atan2(math.sinh(eta0), math.cos(xi0)))
    return math.degrees(math.atan(_geodetic_tangent(conformal))), (origin[1] + longitude + 180.0) % 360.0 - 180.0


def _project(latitude: float, longitude: float) -> tuple[float, float]:
    """Easting and northing from the equator and the central meridian."""
    tangent = _conformal_tangent(math.tan(math.radians(latitude)))
    difference = math.radians((longitude + 180.0) % 360.0 - 180.0)
    xi = math.atan2(tangent, math.cos(difference))
    eta = math.asinh(math.sin(difference) / math.hypot(tangent, math.cos(difference)))
    northing = xi + total(a * math.sin(2 * j * xi) * math.cosh(2 * j * eta) for j, a in enumerate(_ALPHA, start=1))
    easting = eta + total(a * math.cos(2 * j * xi) * math.sinh(2 * j * eta) for j, a in enumerate(_ALPHA, start=1))
    return easting * _RECTIFYING_M, northing * _RECTIFYING_M


def _conformal_tangent(tangent: float) -> float:
    sine = tangent / math.hypot(1.0, tangent)
    sigma = math.sinh(_ECCENTRICITY * math.atanh(_ECCENTRICITY * sine))
    return tangent * math.hypot(1.0, sigma) - sigma * math.hypot(1.0, tangent)


def _geodetic_tangent(conformal: float) -> float:
    """Newton's method on the conformal latitude (Karney, eqs. 19 to 21): three steps reach the last bit."""
    squeeze = 1.0 - _ECCENTRICITY**2
    tangent = conformal / squeeze
    for _ in range(5):
        guess = _conformal_tangent(tangent)
        step = (conformal - guess) / math.hypot(1.0, guess)
        tangent += step * (1.0 + squeeze * tangent**2) / (squeeze * math.hypot(1.0, tangent))
    return tangent


def _shifted(value: float, places: int) -> float:
    """Move the decimal point. Dividing by 100 would round a second time: 95137.1 / 100 is not 951.371."""
    digits = repr(value + 0.0)  # + 0.0: no negative zero
    return value * 10.0**places if "e" in digits else float(f"{digits}e{places}")
