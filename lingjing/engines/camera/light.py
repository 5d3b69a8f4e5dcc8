"""The weather at an instant → what lights a picture: sun, sky, haze, fog, night, rain, as uniform values.

By day (sun 10 degrees up or more) the sky is bright and blue or grey; below that the sun reddens and weakens, the sky
darkens through dusk, and at 8 degrees under the horizon it is night. Shadows then come from a sun kept 4 degrees up,
whose strength is nearly nothing.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, e, exp, log2, radians, sin

from lingjing.mission.appearance import LinearRgb
from lingjing.mission.instance import Weather

LOWEST_SUN_DEG = 4.0
DAY_DEG, NIGHT_DEG = 10.0, -8.0
LAMPS_DEG = 5.0
"""Below this sun elevation lamps are on."""
AIR_M = 1500.0
"""Thickness of the air that veils: from higher up the path through it grows no more."""

FOG_BANK_M = 1200.0
"""Where one sees farther than about this, the sky shows through the fog overhead."""

FROM_ORBIT = 0.25
"""Share of the veil that is left from orbit: pictures from there are corrected for it."""


@dataclass(frozen=True, slots=True)
class Light:
    """Uniforms of one picture; `dark` 0 by day … 1 at night, `lamps` whether they are on, `rain` 0..1, `gloom` what
    rain leaves of the sky's light, `clear` what fog leaves of the sight of the sky."""

    sun: LinearRgb
    sunlight: LinearRgb
    skylight: LinearRgb
    haze: LinearRgb
    dusk: LinearRgb
    fog: float
    cloud: float
    dark: float
    lamps: bool
    rain: float
    gloom: float
    clear: float


def light_of(weather: Weather, height_m: float) -> Light:
    """The light of a picture taken `height_m` over the ground."""
    cloud = min(max(weather.cloud, 0.0), 1.0)
    dark = _smooth(DAY_DEG - 4.0, NIGHT_DEG, weather.sun_elevation_deg)
    low = 1.0 - _smooth(-3.0, DAY_DEG, weather.sun_elevation_deg)
    sun = sun_direction(weather)
    strength = (1.0 - 0.8 * cloud) * min(1.0, 0.25 + 1.1 * sun[2]) * (1.0 - dark) ** 2
    dusk = 0.55 * low * (1.0 - 0.75 * cloud) * (1.0 - _smooth(0.0, -14.0, weather.sun_elevation_deg))
    sky_share = (1.0 - dark) ** 1.5
    night_sky = 0.085 * dark
    clear, grey = (0.407, 0.517, 0.614), (0.459, 0.489, 0.519)
    day_haze = [c * (1.0 - cloud) + g * cloud for c, g in zip(clear, grey, strict=True)]
    glow = (0.75 * dusk, 0.36 * dusk, 0.14 * dusk)
    night_haze = (0.020, 0.024, 0.034)
    gloom = 1.0 - 0.38 * rain_of(weather)
    haze = [d * (1.0 - dark) * gloom + n * dark + 0.7 * g for d, n, g in zip(day_haze, night_haze, glow, strict=True)]
    thin = min(1.0, AIR_M / max(height_m, 1.0)) * (1.0 - (1.0 - FROM_ORBIT) * _smooth(5e3, 5e4, height_m))
    return Light(
        sun=sun,
        sunlight=(1.30 * strength, 1.22 * strength * (1.0 - 0.30 * low), 1.08 * strength * (1.0 - 0.62 * low)),
        skylight=((0.34 + 0.14 * cloud) * sky_share * gloom + night_sky,
                  (0.40 + 0.12 * cloud) * sky_share * gloom + night_sky,
                  (0.48 + 0.08 * cloud) * sky_share * gloom + 1.25 * night_sky),
        haze=(haze[0], haze[1], haze[2]),
        dusk=glow,
        fog=3.912 * log2(e) / max(weather.visibility_m, 1.0) * thin,
        cloud=cloud,
        dark=dark,
        lamps=weather.sun_elevation_deg < LAMPS_DEG,
        rain=rain_of(weather),
        gloom=gloom,
        clear=1.0 - exp(-((max(weather.visibility_m, 1.0) / (FOG_BANK_M * thin)) ** 2)),
    )  # fmt: skip


def sun_direction(weather: Weather) -> LinearRgb:
    """Unit vector to the light that casts shadows."""
    azimuth, elevation = radians(weather.sun_azimuth_deg), radians(max(weather.sun_elevation_deg, LOWEST_SUN_DEG))
    return sin(azimuth) * cos(elevation), cos(azimuth) * cos(elevation), sin(elevation)


def rain_of(weather: Weather) -> float:
    """How hard it rains, 0..1."""
    return min(max(weather.rain, 0.0), 1.0)


def _smooth(start: float, end: float, at: float) -> float:
    """0 before `start`, 1 past `end` (which may be smaller), smooth between."""
    t = min(max((at - start) / (end - start), 0.0), 1.0)
    return t * t * (3.0 - 2.0 * t)
