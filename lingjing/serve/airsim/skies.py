"""Weather and time of day of the pictures of a free flight, as clients set them.

As in AirSim, both change pictures alone: neither the wind nor the sea.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from datetime import UTC, datetime, timedelta

from lingjing.serve.airsim.arguments import CallError

RAIN, ROAD_WETNESS, SNOW, ROAD_SNOW, MAPLE_LEAF, ROAD_LEAF, DUST, FOG = range(8)
"""AirSim's `WeatherParameter`. The wetness of roads and leaves are noted, and not drawn."""

_THICK_M, _DUST_M = 30.0, 150.0
"""Visibility in the thickest fog and dust, metres (chosen)."""
_CLEAR_M = 10_000.0
"""Visibility at which fog and dust begin, metres: that of clear weather."""
_FLAKES = 0.3
"""Cover of snow from which the camera draws rain as snow (docs/weather.md)."""
_FORM = "%Y-%m-%d %H:%M:%S"
"""AirSim's form of a date and time."""
_J2000 = datetime(2000, 1, 1, 12, tzinfo=UTC)


@dataclass(frozen=True)
class SunClock:
    """A clock of the sun that was set at a mission time."""

    start: datetime
    """Time of the sun at `since_s`, UTC."""
    since_s: float
    """Mission time, seconds."""
    speed: float
    """Seconds of the sun's clock for each second of mission time."""
    step_s: float
    """Mission time between two moves of the sun, seconds."""

    def at(self, time_s: float) -> datetime:
        """Return the time of the sun, UTC."""
        passed = time_s - self.since_s
        if self.step_s > 0.0:
            passed = math.floor(passed / self.step_s + 1e-9) * self.step_s
        return self.start + timedelta(seconds=passed * self.speed)


@dataclass
class Skies:
    """The weather and the time of day that clients have set."""

    enabled: bool = False
    """True after `simEnableWeather(True)`: only then the levels count."""
    levels: dict[int, float] = field(default_factory=dict)
    """Level of each parameter, 0 to 1."""
    clock: SunClock | None = None
    """The clock of the sun; None for the mission's sun."""

    def arguments(self, origin: tuple[float, float], time_s: float) -> dict[str, float]:
        """Return the arguments of a `takePhoto` (`lingjing.scene.picture_weather.WEATHER_LIMITS`).

        `origin`: (latitude, longitude) in degrees.
        """
        changes: dict[str, float] = {}
        rain, snow, cover, fog, dust = (self._level(each) for each in (RAIN, SNOW, ROAD_SNOW, FOG, DUST))
        if max(rain, snow) > 0.0:
            changes["rain"] = changes["cloud"] = max(rain, snow)
        if snow > 0.0:
            cover = max(cover, _FLAKES)
        if cover > 0.0:
            changes["ice"] = cover
        if max(fog, dust) > 0.0:
            sights = ((fog, _THICK_M), (dust, _DUST_M))
            changes["visibility"] = min(_CLEAR_M * (least / _CLEAR_M) ** share for share, least in sights)
        if self.clock is not None:
            azimuth, elevation = sun_angles(origin, self.clock.at(time_s))
            changes |= {"sun_azimuth": azimuth, "sun_elevation": elevation}
        return changes

    def _level(self, parameter: int) -> float:
        return self.levels.get(parameter, 0.0) if self.enabled else 0.0


def local_time(text: str, longitude: float, *, summer: bool) -> datetime:
    """Return a date and time of a place in UTC. The place's zone is that of its longitude, in steps of 15 degrees.

    `summer`: the text is daylight saving time. Raises `CallError`.
    """
    try:
        moment = datetime.strptime(text, _FORM).replace(tzinfo=UTC)
        return moment - timedelta(hours=round(longitude / 15.0) + (1 if summer else 0))
    except (ValueError, OverflowError):
        raise CallError(f"`start_datetime` is a time like 2018-02-12 15:20:00, not `{text[:40]}`") from None


def sun_angles(origin: tuple[float, float], moment: datetime) -> tuple[float, float]:
    """Return azimuth (0 to 360, clockwise from north) and elevation of the sun in degrees, without refraction.

    `origin`: (latitude, longitude) in degrees. The formulas of the Astronomical Almanac for low precision (page C5) are
    exact to 0.01 degrees from 1950 to 2050.
    """
    days = (moment - _J2000).total_seconds() / 86_400.0
    anomaly = math.radians(357.528 + 0.9856003 * days)
    longitude = math.radians(280.460 + 0.9856474 * days + 1.915 * math.sin(anomaly) + 0.020 * math.sin(2.0 * anomaly))
    tilt = math.radians(23.439 - 4e-7 * days)
    ascension = math.atan2(math.cos(tilt) * math.sin(longitude), math.cos(longitude))
    declination = math.asin(math.sin(tilt) * math.sin(longitude))
    sidereal = math.radians((18.697374558 + 24.06570982441908 * days) % 24.0 * 15.0)
    hour = sidereal + math.radians(origin[1]) - ascension
    latitude = math.radians(origin[0])
    up = math.sin(latitude) * math.sin(declination) + math.cos(latitude) * math.cos(declination) * math.cos(hour)
    east = -math.cos(declination) * math.sin(hour)
    north = math.cos(latitude) * math.sin(declination) - math.sin(latitude) * math.cos(declination) * math.cos(hour)
    return math.degrees(math.atan2(east, north)) % 360.0, math.degrees(math.asin(min(max(up, -1.0), 1.0)))
