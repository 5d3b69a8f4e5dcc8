"""The force of the wind on robot dogs, for weather with `effects`.

The wind of a weather is that at 10 m above open country. At the height of a dog's trunk it is weaker by the logarithmic
wind profile. Gusts are those of `lingjing.engines.gust`, with a random stream for each dog.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

from lingjing.engines.gust import Gust
from lingjing.engines.quadruped.dog_model import DogState
from lingjing.engines.quadruped.gait import PERIOD_S
from lingjing.mission.instance import Vector, Weather

_TRUNK_M, _REFERENCE_M, _ROUGHNESS_M = 0.3, 10.0, 0.03
"""Height of a trunk, height of the reported wind, and roughness length of open country, metres (WMO-No. 8, chapter
5)."""

_WIND_SHARE = math.log(_TRUNK_M / _ROUGHNESS_M) / math.log(_REFERENCE_M / _ROUGHNESS_M)
"""Wind at the trunk as a share of the reported wind: 0.40."""

_HALF_DENSITY = 0.5 * 1.225
"""Half the density of air at sea level, kg/m^3 (ISO 2533)."""

_FRONT_M2, _SIDE_M2 = 1.1 * 0.6 * 0.31 * 0.40, 1.1 * 0.5 * 0.70 * 0.40
"""Drag areas from ahead and abeam, m^2: a drag coefficient of 1.1 (block; Hoerner, Fluid-Dynamic Drag, 1965) times the
solid part (0.6 and 0.5, chosen: there is air between the legs) of the outline of a standing Go2, by its data sheet
0.70 m by 0.31 m by 0.40 m."""


def wind_force(wind: Vector, velocity: Vector, yaw: float) -> tuple[float, float]:
    """Return the force of a reported wind (m/s) on a dog with a velocity (m/s) and a heading (rad anticlockwise from
    east): (east, north) newtons."""
    east, north = _WIND_SHARE * wind[0] - velocity[0], _WIND_SHARE * wind[1] - velocity[1]
    cosine, sine = math.cos(yaw), math.sin(yaw)
    ahead, abeam = east * cosine + north * sine, north * cosine - east * sine
    pressure = _HALF_DENSITY * math.hypot(ahead, abeam)
    along, across = pressure * _FRONT_M2 * ahead, pressure * _SIDE_M2 * abeam
    return along * cosine - across * sine, along * sine + across * cosine


class WindLoad:
    """The wind on all dogs of an episode."""

    def __init__(self, seed: int) -> None:
        self._seed = seed
        self._gusts: dict[str, Gust] = {}

    def forces(self, dogs: Iterable[tuple[str, DogState]], weather: Weather) -> list[tuple[float, float]]:
        """Return the force on each dog in the next control period, (east, north) newtons, in the same order."""
        return [wind_force(self._gust(name, weather).next(weather), here.velocity, here.yaw) for name, here in dogs]

    def _gust(self, name: str, weather: Weather) -> Gust:
        if name not in self._gusts:
            self._gusts[name] = Gust(weather, self._seed, f"quadruped/{name}/gust", PERIOD_S)
        return self._gusts[name]
