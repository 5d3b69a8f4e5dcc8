"""One aeroplane: its phase, where it is bound, its fuel and what it runs into.

Touching a building, the ground, the water or another body ends the flight. Without fuel it glides on straight ahead
and comes to rest where it touches the ground.
"""

from __future__ import annotations

import math
from enum import Enum

from lingjing.engines.aloft import Notice
from lingjing.engines.fixed_wing import guidance
from lingjing.engines.fixed_wing.airframe import STEP_S, Airframe, Sample
from lingjing.engines.fixed_wing.control import PERIOD_S, Autopilot
from lingjing.engines.gust import Gust
from lingjing.engines.sea import GRAVITY, wind_velocity
from lingjing.mission.instance import Entity, Vector, Weather
from lingjing.plugins.neighbours import Neighbour
from lingjing.plugins.requests import Refusal
from lingjing.scene.outlines import compass
from lingjing.scene.terrain import Terrain
from lingjing.trace.records import BodyState

CRUISE_MPS = 40.0
ENDURANCE_S = 4.0 * 3600.0
"""What an entity without these properties gets."""

SLOWEST_MPS, FASTEST_MPS = 33.0, 60.0
"""Airspeeds that the airframe can hold."""

CRUISE_FLOW = 12.2 / 3600.0
"""Fuel flow in level flight at 40 m/s, kg/s, as JSBSim burns it: what a tank is sized with."""

REACH_M = 4.0
"""From the middle to where a wing would be torn off: how close is a collision."""

_STEPS = round(PERIOD_S / STEP_S)
_HALF_HEIGHT_M = 1.35
_AIRBORNE_M = 30.0
_LAUNCH_M = 60.0
_OVER_M, _LEVEL_M = 60.0, 15.0
_CLEARANCE_M = 30.0
_LEAST_FLOW_SHARE = 0.5
_TERMINAL_MPS = 60.0
_SPURT_MPS = 20.0


class Phase(Enum):
    """What the aeroplane is doing."""

    PARKED = "parked"
    FLYING = "flying"
    GLIDING = "gliding"
    FALLING = "falling"
    DEAD = "dead"


class Aeroplane:
    """An aircraft in flight or waiting for it; `step` moves it by one control period."""

    def __init__(
        self, entity: Entity, terrain: Terrain, weather: Weather, origin: tuple[float, float], seed: int
    ) -> None:
        self.id = entity.id
        self.position = self._launch = entity.position
        self.velocity: Vector = (0.0, 0.0, 0.0)
        self.goal: Vector | None = None
        self.around: tuple[Neighbour, ...] = ()
        self.cruise = min(max(_property(entity, "cruise_mps", CRUISE_MPS), SLOWEST_MPS), FASTEST_MPS)
        self.capacity_kg = self.fuel_kg = CRUISE_FLOW * _property(entity, "endurance_s", ENDURANCE_S)
        self._terrain = terrain
        self._gust = Gust(weather, seed, f"plane/{entity.id}/gust", PERIOD_S)
        wind = (*wind_velocity(weather), 0.0)
        self._airframe = Airframe(origin, entity.position[2], entity.heading_deg, self.cruise, wind)
        self._autopilot = Autopilot()
        self._sample: Sample = self._airframe.sample()
        self._attitude: Vector = (0.0, 0.0, math.radians(entity.heading_deg))
        self._radius = guidance.circle_radius(self.cruise)
        self._height = entity.position[2]
        self._length = 0.0
        self._circling = False
        self._straight: float | None = None
        self._centre = self._beside()
        self.phase = Phase.PARKED
        if entity.position[2] >= terrain.support(*entity.position) + _AIRBORNE_M:
            self._take_off()

    @property
    def flying(self) -> bool:
        """Whether it is in the air and in control."""
        return self.phase in (Phase.FLYING, Phase.GLIDING)

    @property
    def alive(self) -> bool:
        """Whether it still takes commands."""
        return self.phase in (Phase.PARKED, Phase.FLYING)

    @property
    def reach_mps(self) -> float:
        """A speed that it will not exceed in the next seconds."""
        return math.hypot(*self.velocity) + _SPURT_MPS

    @property
    def progress(self) -> float:
        """How much of the way is behind, 0..1."""
        if self.goal is None or self._length <= 0.0:
            return 0.0
        return min(max(1.0 - math.dist(self.position, self.goal) / self._length, 0.0), 1.0)

    def head_for(self, goal: Vector) -> None:
        """Fly to a place, or `Refusal`: `unreachable`, `fuel`."""
        self._check(goal)
        self.goal, self._height = goal, goal[2]
        self._length = max(math.dist(self.position, goal), 1.0)
        self._circling, self._straight = False, None
        if self.phase is Phase.PARKED:
            self._take_off()

    def hold(self) -> None:
        """Give up the destination and circle here."""
        self.goal, self._straight = None, None
        self._centre, self._height = self._beside(), self.position[2]

    def strike(self, what: str) -> Notice:
        """Hit something: the flight is over and the fall begins."""
        notice = Notice("collided", what, math.hypot(*self.velocity))
        self.phase, self.velocity = Phase.FALLING, (0.0, 0.0, 0.0)
        return notice

    def step(self, weather: Weather, now_s: float) -> Notice | None:
        """Move by one control period, which ends at `now_s`, and say what happened."""
        if self.phase is Phase.FALLING:
            self._fall()
        if not self.flying:
            return None
        self._fly(weather)
        return self._contact(now_s) or self._exhausted() or self._reached()

    def state(self, remainder_s: float) -> BodyState:
        """The aircraft `remainder_s` after its last step."""
        x, y, z = (here + remainder_s * rate for here, rate in zip(self.position, self.velocity, strict=True))
        return BodyState(
            id=self.id,
            position=(x, y, z),
            velocity=self.velocity,
            heading_deg=compass(math.degrees(self._attitude[2])),
            pitch_deg=math.degrees(self._attitude[1]),
            roll_deg=math.degrees(self._attitude[0]),
            status=self.status,
            resources={"fuel": self.fuel_kg / self.capacity_kg, "fuel_kg": self.fuel_kg},
        )

    @property
    def status(self) -> str:
        """`grounded`, `moving`, `loitering` or `dead`."""
        if self.phase is Phase.PARKED:
            return "grounded"
        if not self.alive:
            return "dead"
        return "loitering" if self.goal is None else "moving"

    def _take_off(self) -> None:
        self.phase = Phase.FLYING
        self.velocity = self._sample.velocity
        self._attitude = self._sample.attitude

    def _beside(self) -> tuple[float, float]:
        """The middle of the clockwise circle that it is on if it starts to turn now."""
        east, north = self.velocity[0], self.velocity[1]
        course = math.atan2(east, north) if math.hypot(east, north) > 1.0 else self._attitude[2]
        x, y, _ = self.position
        return x + self._radius * math.cos(course), y - self._radius * math.sin(course)

    def _fly(self, weather: Weather) -> None:
        powered = self.phase is Phase.FLYING
        climb = guidance.climb(self._height - self.position[2])
        demand = self._autopilot.fly(self._sample, self._bank(), climb, self.cruise, powered=powered)
        self._airframe.blow(*self._gust.next(weather))
        self._airframe.command(demand.aileron, demand.elevator, demand.throttle)
        self._airframe.step(_STEPS)
        sample = self._airframe.sample()
        x, y, z = (
            here + 0.5 * PERIOD_S * (before + now)
            for here, before, now in zip(self.position, self.velocity, sample.velocity, strict=True)
        )
        self.position, self.velocity, self._attitude, self._sample = (x, y, z), sample.velocity, sample.attitude, sample
        if powered:
            self.fuel_kg = max(0.0, self.fuel_kg - sample.fuel_flow * PERIOD_S)

    def _bank(self) -> float:
        if self.phase is Phase.GLIDING:
            return 0.0
        speed = math.hypot(self.velocity[0], self.velocity[1])
        course = math.atan2(self.velocity[0], self.velocity[1])
        if self.goal is not None and not self._circling:
            return guidance.turn(course, self._to(self.goal, course, speed))
        wanted, feed = guidance.around(self.position, self._centre, self._radius, speed)
        return guidance.turn(course, wanted, feed)

    def _to(self, goal: Vector, course: float, speed: float) -> float:
        if guidance.reachable(self.position, course, speed, goal):
            self._straight = None
            return guidance.bearing(self.position, goal)
        if self._straight is None:
            self._straight = course
        return self._straight

    def _reached(self) -> Notice | None:
        if self.goal is None or self.phase is not Phase.FLYING:
            return None
        if not self._circling and math.dist(self.position[:2], self.goal[:2]) < _OVER_M:
            self._circling, self._centre = True, (self.goal[0], self.goal[1])
        level = abs(self.position[2] - self.goal[2]) < _LEVEL_M
        return Notice("done") if self._circling and level else None

    def _contact(self, now_s: float) -> Notice | None:
        x, y, z = self.position
        if math.dist(self.position[:2], self._launch[:2]) < _LAUNCH_M and z > self._launch[2] - 1.0:
            return None
        for other in self.around:
            if other.touches(self.position, REACH_M, _HALF_HEIGHT_M, now_s):
                return self.strike(other.id)
        low = z - _HALF_HEIGHT_M
        if low > self._terrain.ceiling_m(x, y):
            return None
        solids = self._terrain.solids_at(x, y, low, z + _HALF_HEIGHT_M, REACH_M)
        if solids:
            return self.strike(solids[0].id)
        if low > self._terrain.surface(x, y):
            return None
        if self.phase is Phase.GLIDING:
            self._rest()
            return None
        return self.strike("ground" if self._terrain.water_level(x, y) is None else "water")

    def _exhausted(self) -> Notice | None:
        if self.phase is not Phase.FLYING or self.fuel_kg > 0.0:
            return None
        self.phase = Phase.GLIDING
        self._airframe.cut()
        return Notice("fuel_empty")

    def _fall(self) -> None:
        x, y, z = self.position
        floor = self._terrain.support(x, y, z)
        sink = min(-self.velocity[2] + GRAVITY * PERIOD_S, _TERMINAL_MPS)
        self.position, self.velocity = (x, y, max(floor, z - sink * PERIOD_S)), (0.0, 0.0, -sink)
        if self.position[2] <= floor:
            self._rest()

    def _rest(self) -> None:
        self.phase, self.velocity = Phase.DEAD, (0.0, 0.0, 0.0)
        self._attitude = (0.0, 0.0, self._attitude[2])

    def _check(self, goal: Vector) -> None:
        x, y, z = goal
        lowest = self._terrain.support(x, y, math.inf) + _CLEARANCE_M
        if z < lowest:
            raise Refusal("unreachable", f"({x:.1f}, {y:.1f}, {z:.1f}) is too low: at least z = {lowest:.1f} m")
        # A lower bound (fastest, on half the usual flow), so that nothing possible is refused.
        least = math.dist(self.position, goal) / FASTEST_MPS * CRUISE_FLOW * _LEAST_FLOW_SHARE
        if least > self.fuel_kg:
            raise Refusal("fuel", f"that needs at least {least:.1f} kg of fuel, {self.fuel_kg:.1f} kg are left")


def _property(entity: Entity, name: str, default: float) -> float:
    value = entity.properties.get(name, default)
    return float(value) if isinstance(value, int | float) else default
