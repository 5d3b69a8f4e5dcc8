"""The weather of one picture: values of a `takePhoto` that replace those of the mission's weather.

It changes the picture alone. Wind, waves and the effects on bodies are the mission's.
"""

from __future__ import annotations

from collections.abc import Mapping

import msgspec

from lingjing.decoding import converted
from lingjing.mission.instance import Weather

WEATHER_LIMITS: dict[str, tuple[str, float, float]] = {
    "visibility": ("m", 1.0, 1e6),
    "rain": ("", 0.0, 1.0),
    "ice": ("", 0.0, 1.0),
    "cloud": ("", 0.0, 1.0),
    "sun_azimuth": ("deg", 0.0, 360.0),
    "sun_elevation": ("deg", -90.0, 90.0),
}
"""Argument of a `takePhoto` that replaces a value of the weather → its unit, least and largest value."""


class PictureWeather(msgspec.Struct, frozen=True, kw_only=True):
    """Values of `lingjing.mission.instance.Weather` for one picture; None keeps the mission's value."""

    visibility_m: float | None = None
    rain: float | None = None
    """Intensity of rain, 0 (dry) to 1 (downpour). It falls as snow if `ice` is 30 % or more."""
    ice: float | None = None
    """Cover of snow, 0 to 1."""
    cloud: float | None = None
    """Covered share of the sky, 0 to 1."""
    sun_azimuth_deg: float | None = None
    sun_elevation_deg: float | None = None

    @classmethod
    def of_arguments(cls, arguments: Mapping[str, object]) -> PictureWeather | None:
        """The values in the arguments of a `takePhoto`; None without any."""
        present = [(name, unit) for name, (unit, _, _) in WEATHER_LIMITS.items() if name in arguments]
        values = {f"{name}_{unit}" if unit else name: arguments[name] for name, unit in present}
        return converted(values, cls) if values else None

    def over(self, weather: Weather) -> Weather:
        """The weather with these values. Snow is drawn for weather with effects only, so `ice` switches them on."""
        values = {name: value for name, value in msgspec.structs.asdict(self).items() if value is not None}
        return msgspec.structs.replace(weather, **values, effects=weather.effects or self.ice is not None)
