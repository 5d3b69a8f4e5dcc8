"""The motion of a target: fixed, or adrift with current, wind and waves.

A drifting target wanders a little around its mean course and is never washed ashore.
"""

from __future__ import annotations

import math

from lingjing.engines import sea
from lingjing.mission.instance import Entity, Vector, Weather
from lingjing.mission.seeding import Stream
from lingjing.scene.terrain import Terrain

STEP_S = 0.1
"""Time step of the drift, seconds."""

_LEEWAY = 0.03
"""Leeway of a person in the water as a share of the wind's speed, a usual value of search planning."""
_WANDER = 0.25
"""Standard deviation of the wander as a share of the drift (chosen)."""
_WANDER_TIME_S = 30.0
"""Correlation time of the wander, seconds (chosen)."""


def body_of(entity: Entity, terrain: Terrain, weather: Weather, seed: int) -> TargetBody:
    """Return a drifting body for a target that drifts or stands on water, otherwise a fixed one (on a bridge, for
    example)."""
    x, y, _ = entity.position
    floating = "drift_mps" in entity.properties or entity.properties.get("on") == "water"
    level = terrain.water_level(x, y) if floating else None
    return TargetBody(entity.position) if level is None else _DriftingBody(entity, terrain, level, weather, seed)


class TargetBody:
    """The motion of a target; this base class does not move."""

    def __init__(self, position: Vector) -> None:
        self._position = position

    def set_weather(self, weather: Weather) -> None:
        """Take over the weather."""

    def step(self) -> None:
        """Move by `STEP_S`."""

    def pose(self, time_s: float, remainder_s: float) -> tuple[Vector, Vector]:
        """Return position and velocity at `time_s`, which is `remainder_s` after the last step."""
        return self._position, (0.0, 0.0, 0.0)


class _DriftingBody(TargetBody):
    """A drifting target. Its mean speed is the declared drift; its course is that of the current plus leeway."""

    def __init__(self, entity: Entity, terrain: Terrain, level_m: float, weather: Weather, seed: int) -> None:
        super().__init__(entity.position)
        self._speed = entity.number_or("drift_mps", 0.0)
        self._terrain = terrain
        self._level = level_m
        self._keep = math.exp(-STEP_S / _WANDER_TIME_S)
        self._kick = _WANDER * self._speed * math.sqrt(1.0 - self._keep**2)
        self._stream = Stream(seed, f"city/{entity.id}/drift")
        self._wander = (0.0, 0.0)
        self._velocity = (0.0, 0.0)
        self.set_weather(weather)

    def set_weather(self, weather: Weather) -> None:
        """Take over the waves and the mean course of the weather."""
        self._waves = sea.waves(weather)
        self._mean = _course(weather, self._speed)

    def step(self) -> None:
        """Drift by `STEP_S`. At the shore the target moves along the free axis only, or not at all."""
        if self._mean == (0.0, 0.0):
            self._velocity = (0.0, 0.0)
            return
        east, north = (self._keep * part + self._kick * self._stream.normal(0.0, 1.0) for part in self._wander)
        self._wander = (east, north)
        velocity = (self._mean[0] + east, self._mean[1] + north)
        for candidate in (velocity, (velocity[0], 0.0), (0.0, velocity[1])):
            x, y = self._position[0] + STEP_S * candidate[0], self._position[1] + STEP_S * candidate[1]
            if self._terrain.water_level(x, y) is not None:
                self._position, self._velocity = (x, y, self._level), candidate
                return
        self._velocity = (0.0, 0.0)

    def pose(self, time_s: float, remainder_s: float) -> tuple[Vector, Vector]:
        """Return position and velocity at `time_s`, which is `remainder_s` after the last step; the height follows the
        waves."""
        east, north = self._velocity
        x, y = self._position[0] + remainder_s * east, self._position[1] + remainder_s * north
        slope_east, slope_north = sea.slope(self._waves, x, y, time_s)
        rise = sea.rise(self._waves, x, y, time_s) + slope_east * east + slope_north * north
        return (x, y, self._level + sea.elevation(self._waves, x, y, time_s)), (east, north, rise)


def _course(weather: Weather, speed: float) -> tuple[float, float]:
    wind, current = sea.wind_velocity(weather), sea.current_velocity(weather)
    east, north = current[0] + _LEEWAY * wind[0], current[1] + _LEEWAY * wind[1]
    whole = math.hypot(east, north)
    if whole == 0.0:  # no current and no wind
        return 0.0, 0.0
    return speed * east / whole, speed * north / whole
