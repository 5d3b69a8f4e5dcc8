"""The wind at one vehicle: the mission's mean wind at the time and, if it says so, seeded gusts.

Gusts are a first-order (Dryden-like) process in each axis with the mean's turbulence intensity: standard deviation
`turbulence * wind_mps` horizontally and half of it vertically, over a length scale of 50 m at the mean wind's speed.
"""

from __future__ import annotations

import math

from lingjing.engines.sea import wind_velocity
from lingjing.mission.instance import Vector, Weather
from lingjing.mission.seeding import generator

_LENGTH_M = 50.0
_VERTICAL = 0.5
_BLOCK = 150
"""Normal numbers that are drawn at once; a call for each would cost more than the flight that they disturb."""


class Gust:
    """Wind velocity (east, north, up) in m/s, one value every `dt_s`. A change of weather changes the mean and the
    strength at once; the gust that is blowing fades as it would have."""

    def __init__(self, weather: Weather, seed: int, name: str, dt_s: float) -> None:
        self._dt_s = dt_s
        self._random = generator(seed, name)
        self._normals: list[float] = []
        self._offset = (0.0, 0.0, 0.0)
        self._set(weather)

    def next(self, weather: Weather) -> Vector:
        """The wind of the next interval in this weather."""
        if weather is not self._weather:
            self._set(weather)
        if self._sigma == 0.0 and self._offset == (0.0, 0.0, 0.0):
            return self._mean[0], self._mean[1], 0.0
        if not self._normals:
            self._normals = self._random.standard_normal(_BLOCK).tolist()
        keep, kick, draw = self._keep, self._kick, self._normals.pop
        east, north, up = self._offset
        east, north, up = keep * east + kick * draw(), keep * north + kick * draw(), keep * up + kick * draw()
        self._offset = (east, north, up)
        return self._mean[0] + east, self._mean[1] + north, _VERTICAL * up

    def _set(self, weather: Weather) -> None:
        self._weather = weather
        self._mean = wind_velocity(weather)
        self._sigma = max(weather.turbulence, 0.0) * weather.wind_mps
        self._keep = math.exp(-self._dt_s * max(weather.wind_mps, 1.0) / _LENGTH_M)
        self._kick = self._sigma * math.sqrt(1.0 - self._keep * self._keep)
