"""Light and air of a picture, from the weather: sun, sky, haze, fog, night and rain as uniform values.

With the sun at 10 degrees or more, the sky is bright and blue or grey. Below that the sun becomes red and weak and the
sky darkens. At 8 degrees below the horizon it is night. Shadows then come from a sun that is held 4 degrees above the
horizon, with almost no strength.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, e, exp, log2, radians, sin

from lingjing.mission.appearance import LinearRgb
from lingjing.mission.instance import Weather

LOWEST_SUN_DEG = 4.0
"""Least elevation of the sun that casts shadows, degrees (chosen)."""

DAY_DEG, NIGHT_DEG = 10.0, -8.0
"""Sun elevations of full day and of full night, degrees (chosen)."""

LAMPS_DEG = 5.0
"""Sun elevation below which lamps are on, degrees (chosen)."""
AIR_M = 1500.0
"""Thickness of the hazy air, metres (chosen). From a greater height the path through it is not longer."""

FOG_BANK_M = 1200.0
"""Visibility from which the sky shows through fog overhead, metres (chosen)."""

FROM_ORBIT = 0.25
"""Share of the haze in pictures from orbit, which are usually corrected for it (chosen)."""


@dataclass(frozen=True, slots=True)
class Light:
    """The light of one picture."""

    sun: LinearRgb
    """Unit vector towards the sun."""
    sunlight: LinearRgb
    """Linear colour of sunlight."""
    skylight: LinearRgb
    """Linear colour of light from the sky."""
    haze: LinearRgb
    """Linear colour of the haze."""
    dusk: LinearRgb
    """Linear colour of the glow at dusk."""
    fog: float
    """Extinction of the fog, 1/m, for base 2."""
    cloud: float
    """Cloud cover, 0..1."""
    dark: float
    """Darkness: 0 by day, 1 at night."""
    lamps: bool
    """True if lamps are on."""
    rain: float
    """Rain, 0..1."""
    gloom: float
    """Share of the sky's light that rain leaves."""
    clear: float
    """Share of the sky's sight that fog leaves."""
    snow: float
    """Cover of snow on the ground, 0..1."""

    @property
    def wet(self) -> bool:
        """True if rain or snow lies on the surfaces."""
        return self.rain > 0.0 or self.snow > 0.0


def light_of(weather: Weather, height_m: float) -> Light:
    """Return the light of a picture from `height_m` over the ground."""
    cloud = min(max(weather.cloud, 0.0), 1.0)
    dark = _smooth(DAY_DEG - 4.0, NIGHT_DEG, weather.sun_elevation_deg)
    low = 1.0 - _smooth(-3.0, DAY_DEG, weather.sun_elevation_deg)
    sun = sun_direction(weather)
    strength = (1.0 - 0.8 * cloud) * min(1.0, 0.25 + 1.1 * sun[2]) * (1.0 - dark) ** 2
    dusk = 0.80 * low * (1.0 - 0.75 * cloud) * (1.0 - _smooth(0.0, -14.0, weather.sun_elevation_deg))
    sky_share = (1.0 - dark) ** 1.5
    night_sky = 0.085 * dark
    clear, grey = (0.407, 0.517, 0.614), (0.459, 0.489, 0.519)
    day_haze = [c * (1.0 - cloud) + g * cloud for c, g in zip(clear, grey, strict=True)]
    glow = (0.90 * dusk, 0.37 * dusk, 0.09 * dusk)
    night_haze = (0.020, 0.024, 0.034)
    gloom = 1.0 - 0.38 * _rain_of(weather)
    haze = [
        d * (1.0 - dark) * gloom * (1.0 - 0.35 * low) + n * dark + 0.30 * g
        for d, n, g in zip(day_haze, night_haze, glow, strict=True)
    ]
    thin = min(1.0, AIR_M / max(height_m, 1.0)) * (1.0 - (1.0 - FROM_ORBIT) * _smooth(5e3, 5e4, height_m))
    return Light(
        sun=sun,
        sunlight=(1.30 * strength, 1.22 * strength * (1.0 - 0.38 * low), 1.08 * strength * (1.0 - 0.74 * low)),
        skylight=((0.34 + 0.14 * cloud) * sky_share * gloom + night_sky,
                  (0.40 + 0.12 * cloud) * sky_share * gloom + night_sky,
                  (0.48 + 0.08 * cloud) * sky_share * gloom + 1.25 * night_sky),
        haze=(haze[0], haze[1], haze[2]),
        dusk=glow,
        fog=3.912 * log2(e) / max(weather.visibility_m, 1.0) * thin,
        cloud=cloud,
        dark=dark,
        lamps=weather.sun_elevation_deg < LAMPS_DEG,
        rain=_rain_of(weather),
        gloom=gloom,
        snow=min(max(weather.ice, 0.0), 1.0) if weather.effects else 0.0,
        clear=1.0 - exp(-((max(weather.visibility_m, 1.0) / (FOG_BANK_M * thin)) ** 2)),
    )  # fmt: skip


def sun_direction(weather: Weather) -> LinearRgb:
    """Return the unit vector to the light that casts shadows."""
    azimuth, elevation = radians(weather.sun_azimuth_deg), radians(max(weather.sun_elevation_deg, LOWEST_SUN_DEG))
    return sin(azimuth) * cos(elevation), cos(azimuth) * cos(elevation), sin(elevation)


def _rain_of(weather: Weather) -> float:
    """Return the strength of the rain, 0..1."""
    return min(max(weather.rain, 0.0), 1.0)


def _smooth(start: float, end: float, at: float) -> float:
    """Return a smooth step: 0 before `start`, 1 past `end`, which may be smaller than `start`."""
    t = min(max((at - start) / (end - start), 0.0), 1.0)
    return t * t * (3.0 - 2.0 * t)
