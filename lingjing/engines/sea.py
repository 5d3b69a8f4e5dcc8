"""The surface of the sea as a function of weather, place and time.

Vessels ride on it, drifting bodies follow it and the camera draws it. The surface is a sum of a few linear deep-water
waves (Airy theory). It has no state and no random numbers, so the same weather gives the same sea in every process. The
components share the energy of the significant wave height, `sum(a^2) / 2 = (Hs / 4)^2`. Wavelengths follow the
dispersion relation `L = g T^2 / (2 pi)`. The waves travel downwind. Elevations are relative to still water; angles are
compass degrees, other units are metres and seconds.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from lingjing.mission.instance import Weather
from lingjing.sums import total

GRAVITY = 9.80665
"""Standard gravity, m/s^2."""

_SHAPE: tuple[tuple[float, float, float], ...] = (
    # Ratio to the peak period, share of the energy (the sum is 1), angle off the wind in degrees; chosen.
    (1.00, 0.46, 0.0),
    (0.83, 0.22, 19.0),
    (1.21, 0.15, -14.0),
    (0.66, 0.10, -33.0),
    (0.49, 0.07, 41.0),
)
"""The shape of the spectrum (chosen)."""

_GOLDEN_ANGLE = math.pi * (3.0 - math.sqrt(5.0))
"""Difference of the phases of two components, rad. Its multiples never coincide, so crests do not start together."""


@dataclass(frozen=True, slots=True)
class WaveComponent:
    """One regular wave."""

    amplitude_m: float
    """Amplitude, metres: half the height from trough to crest."""
    wavelength_m: float
    """Wavelength, metres."""
    direction_deg: float
    """Compass direction in which it travels, degrees."""
    phase_rad: float
    """Phase at the origin at time 0, rad."""
    period_s: float
    """Period, seconds."""

    @property
    def wave_vector(self) -> tuple[float, float]:
        """Wave numbers (east, north), rad/m."""
        number = 2.0 * math.pi / self.wavelength_m
        bearing = math.radians(self.direction_deg)
        return number * math.sin(bearing), number * math.cos(bearing)

    def angle(self, x: float, y: float, t: float) -> float:
        """Return the phase at a place and time, rad; the elevation is `amplitude_m * cos(angle)`."""
        east, north = self.wave_vector
        return east * x + north * y - 2.0 * math.pi * t / self.period_s + self.phase_rad


def waves(weather: Weather) -> tuple[WaveComponent, ...]:
    """Return the wave components of a weather, the main one first; empty without waves."""
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
    """Return the height of the surface over still water at (x, y) metres and t seconds."""
    return total(wave.amplitude_m * math.cos(wave.angle(x, y, t)) for wave in components)


def rise(components: Sequence[WaveComponent], x: float, y: float, t: float) -> float:
    """Return the vertical velocity of the surface, m/s: the time derivative of `elevation`."""
    return total(
        wave.amplitude_m * 2.0 * math.pi / wave.period_s * math.sin(wave.angle(x, y, t)) for wave in components
    )


def slope(components: Sequence[WaveComponent], x: float, y: float, t: float) -> tuple[float, float]:
    """Return the gradient of the surface (towards east, towards north), metres per metre."""
    east = north = 0.0
    for wave in components:
        steep = -wave.amplitude_m * math.sin(wave.angle(x, y, t))
        wave_east, wave_north = wave.wave_vector
        east += steep * wave_east
        north += steep * wave_north
    return east, north


def wind_velocity(weather: Weather) -> tuple[float, float]:
    """Return the velocity of the mean wind (east, north), m/s."""
    bearing = math.radians(weather.wind_from_deg)
    return -weather.wind_mps * math.sin(bearing), -weather.wind_mps * math.cos(bearing)


def current_velocity(weather: Weather) -> tuple[float, float]:
    """Return the velocity of the current (east, north), m/s."""
    bearing = math.radians(weather.current_to_deg)
    return weather.current_mps * math.sin(bearing), weather.current_mps * math.cos(bearing)
