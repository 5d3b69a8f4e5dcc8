"""The sea's surface as a function of weather, place and time: what boats ride, people bob on and the camera draws.

A sum of a few linear deep-water waves (Airy theory): same weather, same sea, in every process and engine, with no
state and no random numbers. Component amplitudes share the energy of the significant wave height
(`sum(a^2) / 2 = (Hs / 4)^2`), wavelengths follow the dispersion relation `L = g T^2 / (2 pi)`. The sea runs with the
wind. Elevations are relative to the still water level; angles are compass degrees, metres and seconds elsewhere.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from lingjing.mission.instance import Weather

GRAVITY = 9.80665
"""Standard gravity, m/s^2."""

_SHAPE: tuple[tuple[float, float, float], ...] = (
    # period ratio, share of the energy, angle off the wind (deg)
    (1.00, 0.46, 0.0),
    (0.83, 0.22, 19.0),
    (1.21, 0.15, -14.0),
    (0.66, 0.10, -33.0),
    (0.49, 0.07, 41.0),
)
_GOLDEN_ANGLE = math.pi * (3.0 - math.sqrt(5.0))


@dataclass(frozen=True, slots=True)
class WaveComponent:
    """One regular wave. `direction_deg` is where it travels *to*; the first component is the main one."""

    amplitude_m: float
    wavelength_m: float
    direction_deg: float
    phase_rad: float
    period_s: float

    @property
    def wave_vector(self) -> tuple[float, float]:
        """(east, north) wave numbers, rad/m."""
        number = 2.0 * math.pi / self.wavelength_m
        bearing = math.radians(self.direction_deg)
        return number * math.sin(bearing), number * math.cos(bearing)

    def angle(self, x: float, y: float, t: float) -> float:
        """The wave's phase at a place and time, rad: elevation is `amplitude * cos(angle)`."""
        east, north = self.wave_vector
        return east * x + north * y - 2.0 * math.pi * t / self.period_s + self.phase_rad


def waves(weather: Weather) -> tuple[WaveComponent, ...]:
    """The components of this weather's sea, the main one first; empty when there are no waves."""
    if weather.wave_height_m <= 0.0 or weather.wave_period_s <= 0.0:
        return ()
    energy = 2.0 * (weather.wave_height_m / 4.0) ** 2
    downwind = weather.wind_from_deg + 180.0
    return tuple(
        WaveComponent(
            amplitude_m=math.sqrt(share * energy),
            wavelength_m=GRAVITY * (ratio * weather.wave_period_s) ** 2 / (2.0 * math.pi),
            direction_deg=(downwind + offset) % 360.0,
            phase_rad=index * _GOLDEN_ANGLE,
            period_s=ratio * weather.wave_period_s,
        )
        for index, (ratio, share, offset) in enumerate(_SHAPE)
    )


def elevation(components: Sequence[WaveComponent], x: float, y: float, t: float) -> float:
    """Height of the surface over still water at (x, y) metres and t seconds."""
    return sum(wave.amplitude_m * math.cos(wave.angle(x, y, t)) for wave in components)


def rise(components: Sequence[WaveComponent], x: float, y: float, t: float) -> float:
    """Vertical velocity of the surface, m/s: the time derivative of `elevation`."""
    return sum(wave.amplitude_m * 2.0 * math.pi / wave.period_s * math.sin(wave.angle(x, y, t)) for wave in components)


def slope(components: Sequence[WaveComponent], x: float, y: float, t: float) -> tuple[float, float]:
    """The surface's gradient (towards east, towards north), metres per metre."""
    east = north = 0.0
    for wave in components:
        steep = -wave.amplitude_m * math.sin(wave.angle(x, y, t))
        wave_east, wave_north = wave.wave_vector
        east += steep * wave_east
        north += steep * wave_north
    return east, north


def wind_velocity(weather: Weather) -> tuple[float, float]:
    """Where the mean wind blows *to*, (east, north) m/s."""
    bearing = math.radians(weather.wind_from_deg)
    return -weather.wind_mps * math.sin(bearing), -weather.wind_mps * math.cos(bearing)


def current_velocity(weather: Weather) -> tuple[float, float]:
    """Where the water flows to, (east, north) m/s."""
    bearing = math.radians(weather.current_to_deg)
    return weather.current_mps * math.sin(bearing), weather.current_mps * math.cos(bearing)
