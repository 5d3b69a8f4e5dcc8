"""One vessel: where it is bound, whether there is land ahead, and how the sea lifts it."""

from __future__ import annotations

import math

from lingjing.engines import sea
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
"""Top speed through the water of an entity that does not say."""

_STOPPING_MPS2 = 0.4
_BERTH_M = 3.0
_KEEL_M = 0.5
_SUPERSTRUCTURE_M = 1.5
_STOPPED_MPS = 0.5
_RESPONSE = 0.8
_LIGHT_KG = 1600.0
"""Displacement without a load."""
_ADMIRALTY = 2.0 / 9.0
"""At the same power `v^3 * displacement^(2/3)` stays the same (the Admiralty coefficient)."""
_COMPASS_POINTS = ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))


class Boat:
    """A vessel under way or keeping its station; `step` moves it by `hull.STEP_S`."""

    def __init__(self, entity: Entity, terrain: Terrain, weather: Weather) -> None:
        x, y, _ = entity.position
        self.id = entity.id
        self.goal: Vector2 | None = None
        self.stopping = False
        self._terrain = terrain
        self.stock = Stock(entity)
        self._load_kg = 0.0
        self._weather = weather
        self._around = hull.HullForcing.of(weather)
        self._waves = sea.waves(weather)
        self._light_speed = entity.number_or("speed_mps", SPEED_MPS)
        self._pilot = Steering(self._light_speed, self._around)
        self.carry()
        self._state: hull.HullState = (x, y, math.radians(entity.heading_deg), 0.0, 0.0, 0.0)
        self._start: Vector2 = (x, y)
        self._station: Vector2 = (x, y)
        self._level = terrain.surface(x, y)
        self.aground = terrain.water_level(x, y) is None

    @property
    def position(self) -> Vector2:
        """(east, north) metres."""
        return self._state[0], self._state[1]

    @property
    def progress(self) -> float:
        """Share of the way to the goal that is behind, 0..1."""
        if self.goal is None:
            return 0.0
        whole = math.dist(self._start, self.goal) - ARRIVED_M
        left = math.dist(self.position, self.goal) - ARRIVED_M
        return 1.0 if whole <= 0.0 else min(max(1.0 - left / whole, 0.0), 1.0)

    def feel(self, weather: Weather) -> None:
        """Be in this weather from now on."""
        if weather is not self._weather:
            self._weather = weather
            self._around = hull.HullForcing.of(weather)
            self._waves = sea.waves(weather)
            self._pilot.around = self._around

    def carry(self) -> None:
        """Feel the load on board: the deeper hull is slower at the same power."""
        if self.stock.load_kg != self._load_kg:
            self._load_kg = self.stock.load_kg
            deeper = (_LIGHT_KG + self._load_kg) / _LIGHT_KG
            self._pilot.drive(self._light_speed * deeper**-_ADMIRALTY)

    def head_for(self, goal: Vector2) -> None:
        """Make for a point, or `Refusal` if the hull would not float there."""
        if not all(self._floats(goal[0] + _BERTH_M * dx, goal[1] + _BERTH_M * dy) for dx, dy in _COMPASS_POINTS):
            raise Refusal("unreachable", f"({goal[0]:.1f}, {goal[1]:.1f}) {self._hindrance(goal)}")
        self._start, self.goal, self.stopping = self.position, goal, False

    def halt(self) -> None:
        """Give up the goal and take the way off; the station to keep is where that ends."""
        self.goal, self.stopping = None, True

    def arrived(self) -> bool:
        """Whether the goal is reached; from then on it is the station to keep."""
        if self.goal is None or math.dist(self.position, self.goal) > ARRIVED_M:
            return False
        self._station, self.goal = self.goal, None
        return True

    def stopped(self) -> bool:
        """Whether a halt is done."""
        if not self.stopping or abs(self._state[3]) > _STOPPED_MPS:
            return False
        self._station, self.stopping = self.position, False
        return True

    def land_ahead(self) -> bool:
        """Whether the way in hand would carry the hull onto land or into a structure."""
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
        """Steer and move. A hull that has run aground stays where it is."""
        if self.aground:
            return
        if self.goal is not None:
            thrust, moment = self._pilot.follow(self._state, self._start, self.goal)
        elif self.stopping:
            thrust, moment = self._pilot.stop(self._state)
        else:
            thrust, moment = self._pilot.keep(self._state, self._station)
        moved = hull.advance(self._state, thrust, moment, self._around)
        if self._floats(moved[0], moved[1]):
            self._state = moved
        else:
            self.aground = True

    def state(self, time_s: float, remainder_s: float) -> BodyState:
        """The vessel at `time_s`, `remainder_s` after its last step."""
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
    def status(self) -> str:
        """`moving`, `idle` or `aground`."""
        if self.aground:
            return AGROUND
        return "idle" if self.goal is None and not self.stopping else "moving"

    def _hindrance(self, goal: Vector2) -> str:
        """Why the hull would not float at a place where it does not."""
        return "is on land or too close to it" if self._terrain.holds(*goal) else "lies outside of the scene's waters"

    def _floats(self, x: float, y: float) -> bool:
        level = self._terrain.water_level(x, y)
        if level is None:
            return False
        return not self._terrain.solids_at(x, y, level - _KEEL_M, level + _SUPERSTRUCTURE_M, 1.0)
