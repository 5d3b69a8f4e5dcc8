"""The motion of a target: fixed, adrift with current, wind and waves, or by itself.

A drifting target wanders a little around its mean course and is never washed ashore. A target with a behaviour moves on
its surface (`lingjing.engines.city.roaming`); one in the water rises and falls with the waves.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from lingjing.engines import sea
from lingjing.engines.city.roaming import MARGIN_M, GroundPlaces, Roaming
from lingjing.mission.instance import BehaviourSpec, Entity, Instance, Vector, Weather
from lingjing.mission.seeding import Stream
from lingjing.scene.city import City
from lingjing.scene.footing import HEAD_M
from lingjing.scene.terrain import Terrain

STEP_S = 0.1
"""Time step of the drift, seconds."""

COARSE_STEP_S = 0.5
"""Time step with coarse motion, seconds (chosen)."""

_LEEWAY = 0.03
"""Leeway of a person in the water as a share of the wind's speed, a usual value of search planning."""
_WANDER = 0.25
"""Standard deviation of the wander as a share of the drift (chosen)."""
_WANDER_TIME_S = 30.0
"""Correlation time of the wander, seconds (chosen)."""


class BodyMaker:
    """Makes the bodies of an instance's targets in one city."""

    def __init__(self, instance: Instance, city: City, terrain: Terrain, seed: int, step_s: float = STEP_S) -> None:
        self._step_s = step_s
        self._regions = {region.name: region.polygon for region in instance.regions}
        self._city = city
        self._terrain = terrain
        self._seed = seed
        self._ground: GroundPlaces | None = None

    def body(self, entity: Entity, weather: Weather) -> TargetBody:
        """A body that moves by itself if the target has a behaviour, a drifting one for a target that drifts or stands
        on water, otherwise a fixed one (on a bridge, for example)."""
        x, y, _ = entity.position
        floating = "drift_mps" in entity.properties or entity.properties.get("on") == "water"
        level = self._terrain.water_level(x, y) if floating else None
        if entity.behaviour is not None:
            return self._roaming(entity, entity.behaviour, level, weather)
        if level is None:
            return TargetBody(entity.position)
        return _DriftingBody(entity, self._terrain, level, weather, self._seed, self._step_s)

    def _roaming(self, entity: Entity, behaviour: BehaviourSpec, level_m: float | None, weather: Weather) -> TargetBody:
        stream = Stream(self._seed, f"city/{entity.id}/{behaviour.kind}")
        region = self._regions.get(behaviour.region, ())
        if level_m is not None:
            roaming = Roaming(behaviour, self._is_open_water, region, stream)
            return _SwimmingBody(entity, self._terrain, level_m, weather, self._seed, self._step_s, roaming)
        self._ground = self._ground or GroundPlaces(self._city, self._terrain)
        on_road = entity.properties.get("on") == "road"
        is_free = self._ground.is_free_road if on_road else self._ground.is_free
        return _WalkingBody(entity.position, self._ground, Roaming(behaviour, is_free, region, stream), self._step_s)

    def _is_open_water(self, x: float, y: float) -> bool:
        level_m = self._terrain.water_level(x, y) if self._terrain.holds(x, y) else None
        return level_m is not None and not self._terrain.solids_at(x, y, level_m, level_m + HEAD_M, MARGIN_M)


class TargetBody:
    """The motion of a target; this base class does not move."""

    def __init__(self, position: Vector) -> None:
        self._position = position
        self.heading_deg: float | None = None
        """The heading that its motion gives it; None if it keeps the declared one."""

    def set_weather(self, weather: Weather) -> None:
        """Take over the weather."""

    def look(self, places: Mapping[str, Vector]) -> None:
        """Take over the places of the present bodies, by id, at the beginning of a macro-step."""

    def halt(self) -> None:
        """End a motion of its own; what the water does to it goes on."""

    def step(self) -> None:
        """Move by one time step."""

    def pose(self, time_s: float, remainder_s: float) -> tuple[Vector, Vector]:
        """Return position and velocity at `time_s`, which is `remainder_s` after the last step."""
        return self._position, (0.0, 0.0, 0.0)


class _WalkingBody(TargetBody):
    """A target that moves on the ground by itself."""

    def __init__(self, position: Vector, ground: GroundPlaces, roaming: Roaming, step_s: float) -> None:
        super().__init__(position)
        self._step_s = step_s
        self._ground = ground
        self._roaming = roaming
        self._above_m = position[2] - ground.height(position[0], position[1])

    def look(self, places: Mapping[str, Vector]) -> None:
        """Take over the places of the present bodies."""
        self._roaming.look(places)

    def halt(self) -> None:
        """Stand still."""
        self._roaming.halt()

    def step(self) -> None:
        """Move by one time step."""
        x, y = self._roaming.step(self._position[0], self._position[1], self._step_s)
        if self._roaming.velocity != (0.0, 0.0):
            self._position = (x, y, self._ground.height(x, y) + self._above_m)
            self.heading_deg = _heading_deg(self._roaming.velocity)

    def pose(self, time_s: float, remainder_s: float) -> tuple[Vector, Vector]:
        """Return position and velocity. Between two steps it is still at the place of the last one."""
        return self._position, (*self._roaming.velocity, 0.0)


class _DriftingBody(TargetBody):
    """A drifting target. Its mean speed is the declared drift; its course is that of the current plus leeway."""

    def __init__(
        self, entity: Entity, terrain: Terrain, level_m: float, weather: Weather, seed: int, step_s: float
    ) -> None:
        super().__init__(entity.position)
        self._step_s = step_s
        self._speed = entity.number_or("drift_mps", 0.0)
        self._terrain = terrain
        self._level = level_m
        self._keep = math.exp(-step_s / _WANDER_TIME_S)
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
        """Drift by one time step. At the shore the target moves along the free axis only, or not at all."""
        if self._mean == (0.0, 0.0):
            self._velocity = (0.0, 0.0)
            return
        east, north = (self._keep * part + self._kick * self._stream.normal(0.0, 1.0) for part in self._wander)
        self._wander = (east, north)
        velocity = (self._mean[0] + east, self._mean[1] + north)
        for candidate in (velocity, (velocity[0], 0.0), (0.0, velocity[1])):
            x, y = self._position[0] + self._step_s * candidate[0], self._position[1] + self._step_s * candidate[1]
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


class _SwimmingBody(_DriftingBody):
    """A target that moves on the water by itself, against the current too."""

    def __init__(
        self,
        entity: Entity,
        terrain: Terrain,
        level_m: float,
        weather: Weather,
        seed: int,
        step_s: float,
        roaming: Roaming,
    ) -> None:
        super().__init__(entity, terrain, level_m, weather, seed, step_s)
        self._roaming = roaming

    def look(self, places: Mapping[str, Vector]) -> None:
        """Take over the places of the present bodies."""
        self._roaming.look(places)

    def halt(self) -> None:
        """Stand still in the plane."""
        self._roaming.halt()
        self._velocity = (0.0, 0.0)

    def step(self) -> None:
        """Move by one time step."""
        x, y = self._roaming.step(self._position[0], self._position[1], self._step_s)
        self._position, self._velocity = (x, y, self._level), self._roaming.velocity
        if self._velocity != (0.0, 0.0):
            self.heading_deg = _heading_deg(self._velocity)


def _heading_deg(velocity: tuple[float, float]) -> float:
    return math.degrees(math.atan2(velocity[0], velocity[1])) % 360.0


def _course(weather: Weather, speed: float) -> tuple[float, float]:
    wind, current = sea.wind_velocity(weather), sea.current_velocity(weather)
    east, north = current[0] + _LEEWAY * wind[0], current[1] + _LEEWAY * wind[1]
    whole = math.hypot(east, north)
    if whole == 0.0:  # no current and no wind
        return 0.0, 0.0
    return speed * east / whole, speed * north / whole
