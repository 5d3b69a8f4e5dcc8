"""One vessel: its destination, the check for land ahead, and its motion on the waves."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Literal

from lingjing.engines import sea
from lingjing.engines.gust import Gust
from lingjing.engines.vessel import hull
from lingjing.engines.vessel.steering import ARRIVED_M, Steering
from lingjing.mission.geometry2d import Vector2
from lingjing.mission.instance import Entity, Weather
from lingjing.plugins.requests import Refusal
from lingjing.plugins.stock import Stock
from lingjing.scene.outlines import compass
from lingjing.scene.terrain import Terrain
from lingjing.trace.records import AGROUND, BodyState

SPEED_MPS = 3.0
"""Top speed through the water of an entity without the property `speed_mps`, m/s (chosen)."""

_STOPPING_MPS2 = 0.4
"""Deceleration that the check for land ahead assumes, m/s^2 (chosen)."""

_BERTH_M = 3.0
"""Least distance between the hull and land, metres (chosen)."""

_KEEL_M = 0.5
"""Draught, metres (chosen)."""

_SUPERSTRUCTURE_M = 1.5
"""Height above the waterline, metres (chosen)."""

_STOPPED_MPS = 0.5
"""Speed below which a vessel counts as stopped, m/s (chosen)."""

_RESPONSE = 0.8
"""Heave, pitch and roll as a share of the wave motion (chosen)."""
_LIGHT_KG = 1600.0
"""Displacement without load, kg (chosen)."""
_ADMIRALTY = 2.0 / 9.0
"""Exponent of the displacement: at constant power `v^3 * displacement^(2/3)` is constant (Admiralty coefficient)."""
_COMPASS_POINTS = ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))
"""Points around a goal, in units of `_BERTH_M`, that must be water."""

BoatStatus = Literal["idle", "moving", "aground"]
"""The status words of a vessel; `kinds.json` lists them for the checker."""


class Boat:
    """A vessel under way or at its station; `step` moves it by `step_s`."""

    def __init__(
        self, entity: Entity, terrain: Terrain, weather: Weather, seed: int, step_s: float = hull.STEP_S
    ) -> None:
        x, y, _ = entity.position
        self.id = entity.id
        self._step_s = step_s
        self.goal: Vector2 | None = None
        self.stopping = False
        self._terrain = terrain
        self.stock = Stock(entity)
        self._load_kg = 0.0
        self._weather = weather
        self._around = hull.HullForcing.of(weather)
        self._waves = sea.waves(weather)
        self._light_speed = entity.number_or("speed_mps", SPEED_MPS)
        self._gust = Gust(weather, seed, f"{entity.engine}/{entity.id}/gust", step_s)
        self._pilot = Steering(self._light_speed, self._around, step_s)
        self.update_load()
        self._state: hull.HullState = (x, y, math.radians(entity.heading_deg), 0.0, 0.0, 0.0)
        self._start: Vector2 = (x, y)
        self._station: Vector2 = (x, y)
        self._level = terrain.surface(x, y)
        self.aground = terrain.water_level(x, y) is None
        self.struck_mps: float | None = None
        """Speed at which the hull ran aground, m/s; None before, and once it is reported."""

    @property
    def position(self) -> Vector2:
        """Position (east, north), metres."""
        return self._state[0], self._state[1]

    @property
    def progress(self) -> float:
        """Share of the way to the goal that is done, 0..1."""
        if self.goal is None:
            return 0.0
        whole = math.dist(self._start, self.goal) - ARRIVED_M
        left = math.dist(self.position, self.goal) - ARRIVED_M
        return 1.0 if whole <= 0.0 else min(max(1.0 - left / whole, 0.0), 1.0)

    def set_weather(self, weather: Weather) -> None:
        """Take over the weather."""
        if weather is not self._weather:
            self._weather = weather
            self._around = hull.HullForcing.of(weather)
            self._waves = sea.waves(weather)
            self._pilot.around = self._around

    def update_load(self) -> None:
        """Take over the load on board. A deeper hull is slower at the same power."""
        if self.stock.load_kg != self._load_kg:
            self._load_kg = self.stock.load_kg
            deeper = (_LIGHT_KG + self._load_kg) / _LIGHT_KG
            self._pilot.drive(self._light_speed * deeper**-_ADMIRALTY)

    def head_for(self, goal: Vector2) -> None:
        """Set a new goal. Raises `Refusal` with `unreachable` if the hull would not float there."""
        if not all(self._floats(goal[0] + _BERTH_M * dx, goal[1] + _BERTH_M * dy) for dx, dy in _COMPASS_POINTS):
            raise Refusal("unreachable", f"({goal[0]:.1f}, {goal[1]:.1f}) {self._hindrance(goal)}")
        self._start, self.goal, self.stopping = self.position, goal, False

    def halt(self) -> None:
        """Cancel the goal and stop. The vessel then keeps its station at the place where it stops."""
        self.goal, self.stopping = None, True

    def arrived(self) -> bool:
        """Return whether the goal is reached. It then becomes the station."""
        if self.goal is None or math.dist(self.position, self.goal) > ARRIVED_M:
            return False
        self._station, self.goal = self.goal, None
        return True

    def stopped(self) -> bool:
        """Return whether a halt is complete. The present place then becomes the station."""
        if not self.stopping or abs(self._state[3]) > _STOPPED_MPS:
            return False
        self._station, self.stopping = self.position, False
        return True

    def land_ahead(self) -> bool:
        """Return whether the present speed would carry the hull onto land or into a structure before it can stop."""
        east, north = hull.ground_velocity(self._state, self._around)
        speed = math.hypot(east, north)
        if speed < _STOPPED_MPS:
            return False
        reach = speed * speed / (2.0 * _STOPPING_MPS2) + hull.HALF_LENGTH_M + _BERTH_M
        steps = math.ceil(reach / hull.HALF_LENGTH_M)
        x, y = self.position
        return not all(
            self._floats(x + east / speed * reach * k / steps, y + north / speed * reach * k / steps)
            for k in range(1, steps + 1)
        )

    def step(self) -> None:
        """Steer and move. A hull that has run aground stays in place."""
        if self.aground:
            return
        if self._weather.effects:
            east, north, _ = self._gust.next(self._weather)
            self._around = self._pilot.around = replace(self._around, wind=(east, north))
        if self.goal is not None:
            thrust, moment = self._pilot.follow(self._state, self._start, self.goal)
        elif self.stopping:
            thrust, moment = self._pilot.stop(self._state)
        else:
            thrust, moment = self._pilot.keep(self._state, self._station)
        moved = hull.advance(self._state, thrust, moment, self._around, self._step_s)
        if self._floats(moved[0], moved[1]):
            self._state = moved
        else:
            self.aground, self.struck_mps = True, math.hypot(*hull.ground_velocity(moved, self._around))

    def state(self, time_s: float, remainder_s: float) -> BodyState:
        """Return the state at `time_s`, which is `remainder_s` after the last step."""
        east, north = (0.0, 0.0) if self.aground else hull.ground_velocity(self._state, self._around)
        x, y = self._state[0] + remainder_s * east, self._state[1] + remainder_s * north
        heading = self._state[2]
        slope_east, slope_north = sea.slope(self._waves, x, y, time_s)
        ahead = slope_east * math.sin(heading) + slope_north * math.cos(heading)
        abeam = slope_east * math.cos(heading) - slope_north * math.sin(heading)
        rise = sea.rise(self._waves, x, y, time_s) + slope_east * east + slope_north * north
        return BodyState(
            id=self.id,
            position=(x, y, self._level + _RESPONSE * sea.elevation(self._waves, x, y, time_s)),
            velocity=(east, north, _RESPONSE * rise),
            heading_deg=compass(math.degrees(heading)),
            pitch_deg=math.degrees(math.atan(_RESPONSE * ahead)),
            roll_deg=-math.degrees(math.atan(_RESPONSE * abeam)),
            status=self.status,
            resources=dict(self.stock.amounts),
        )

    @property
    def status(self) -> BoatStatus:
        """Present status word."""
        if self.aground:
            return AGROUND
        return "idle" if self.goal is None and not self.stopping else "moving"

    def _hindrance(self, goal: Vector2) -> str:
        """Return the reason, in words, that the hull would not float at a place."""
        return "is on land or too close to it" if self._terrain.holds(*goal) else "lies outside of the scene's waters"

    def _floats(self, x: float, y: float) -> bool:
        level = self._terrain.water_level(x, y)
        if level is None:
            return False
        return not self._terrain.solids_at(x, y, level - _KEEL_M, level + _SUPERSTRUCTURE_M, 1.0)
