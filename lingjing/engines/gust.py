"""Wind at one vehicle: the mean wind of the weather and, if it is turbulent, seeded gusts.

Gusts are a first-order process (an approximation of the Dryden model) in each axis. Their standard deviation is
`turbulence * wind_mps` horizontally and half of that vertically. Their length scale is 50 m at the speed of the mean
wind.
"""

from __future__ import annotations

import math

from lingjing.engines.sea import wind_velocity
from lingjing.mission.instance import Vector, Weather
from lingjing.mission.seeding import generator

_LENGTH_M = 50.0
"""Length scale of gusts, metres (chosen)."""

_VERTICAL = 0.5
"""Vertical gusts as a share of horizontal ones (chosen)."""
_BLOCK = 150
"""Count of normal numbers drawn at once. A call for each number would take more time than the flight itself."""


class Gust:
    """Wind velocity (east, north, up) in m/s, one value every `dt_s`.

    A change of weather changes the mean and the standard deviation at once. The present gust decays as before.
    """

    def __init__(self, weather: Weather, seed: int, name: str, dt_s: float) -> None:
        self._dt_s = dt_s
        self._random = generator(seed, name)
        self._normals: list[float] = []
        self._offset = (0.0, 0.0, 0.0)
        self._set(weather)

    def next(self, weather: Weather) -> Vector:
        """Return the wind of the next interval in this weather."""
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
