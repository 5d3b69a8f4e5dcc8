"""Orbits by SGP4: from elements to positions in the equatorial frame of date (TEME). Only this module imports sgp4.

Hoots and Roehrich, Spacetrack Report No. 3, in the revision of Vallado et al. (2006) that the library implements.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from datetime import UTC, datetime

from sgp4.api import SGP4_ERRORS, WGS72, Satrec

from lingjing.errors import InfrastructureError, UsageError
from lingjing.mission.elements import epoch_fault, line_fault
from lingjing.mission.instance import Vector

DAY_S = 86_400.0
"""Length of a day, seconds."""

_J1949_JD = 2_433_281.5
"""Julian day of 1949 December 31, 00:00 UTC, from which sgp4 counts epochs."""

_UNIX_JD = 2_440_587.5
"""Julian day of 1970 January 1, 00:00 UTC."""

_EARTH_KM, _EARTH_MU = 6378.135, 398_600.8
"""Radius of the Earth, km, and its gravitational parameter, km^3/s^2 (WGS-72, the constants of SGP4)."""


@dataclass(frozen=True, slots=True)
class JulianDate:
    """A UTC instant."""

    day: float
    """Julian day; it ends in .5, so it stands for midnight."""
    fraction: float
    """Fraction of a day since then."""

    def later(self, seconds: float) -> JulianDate:
        """Return the instant some seconds later."""
        return JulianDate(self.day, self.fraction + seconds / DAY_S)


def instant(text: str) -> JulianDate:
    """Return the instant of an ISO 8601 text, UTC if it names no zone. Raises `UsageError` for any other text."""
    message, hint = epoch_fault(text)
    if message:
        raise UsageError(f"`{text}` {message}", hint=hint)
    moment = datetime.fromisoformat(text)
    moment = moment if moment.tzinfo else moment.replace(tzinfo=UTC)
    seconds = (moment - datetime(1970, 1, 1, tzinfo=UTC)).total_seconds()
    whole = math.floor(seconds / DAY_S)
    return JulianDate(_UNIX_JD + whole, (seconds - whole * DAY_S) / DAY_S)


class Orbit:
    """The orbit of one satellite; `epoch` is the instant of its elements."""

    def __init__(self, name: str, record: Satrec) -> None:
        self._name = name
        self._record = record
        self.epoch = JulianDate(record.jdsatepoch, record.jdsatepochF)

    def at(self, when: JulianDate) -> tuple[Vector, Vector]:
        """Return position (km) and velocity (km/s) in TEME. Raises `InfrastructureError` if the orbit has decayed."""
        error, position, velocity = self._record.sgp4(when.day, when.fraction)
        if error:
            raise InfrastructureError(f"the elements of `{self._name}` give no orbit here: {SGP4_ERRORS[error]}")
        return position, velocity


def from_lines(name: str, line1: str, line2: str) -> Orbit:
    """Return the orbit of two-line elements. Raises `UsageError` if the lines are no such elements."""
    for number, line in enumerate((line1.strip(), line2.strip()), start=1):
        message, hint = line_fault(number, line)
        if message:
            raise UsageError(f"line {number} of the elements of `{name}` {message}", hint=hint)
    try:
        return Orbit(name, Satrec.twoline2rv(line1.strip(), line2.strip()))
    except ValueError as error:
        raise UsageError(f"the elements of `{name}` cannot be read: {error}", hint="copy both lines again") from error


def circular(name: str, epoch: JulianDate, height_km: float, inclination: float, node: float, anomaly: float) -> Orbit:
    """Return a circular orbit; angles are in radians at `epoch`."""
    record = Satrec()
    motion = 60.0 * circular_rate(height_km)
    days = epoch.day - _J1949_JD + epoch.fraction
    record.sgp4init(WGS72, "i", 0, days, 0.0, 0.0, 0.0, 0.0, 0.0, inclination, anomaly, motion, node)
    return Orbit(name, record)


def circular_rate(height_km: float) -> float:
    """Return the mean motion of a circular orbit, rad/s."""
    return math.sqrt(_EARTH_MU / (_EARTH_KM + height_km) ** 3)
