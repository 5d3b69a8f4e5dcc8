"""One aeroplane: its phase, destination, fuel and collisions.

Contact with a building, the ground, the water or another body ends the flight. Without fuel the aircraft glides
straight ahead and comes to rest where it touches the ground.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Literal

from lingjing.engines.aircraft import DONE, PERIOD_S, STEPS, Aircraft, AircraftEngine, FlightNotice, FlightPhase
from lingjing.engines.fixed_wing import guidance
from lingjing.engines.fixed_wing.airframe import PlaneAirframe
from lingjing.engines.fixed_wing.control import Autopilot
from lingjing.engines.sea import wind_velocity
from lingjing.mission.footprint import stands
from lingjing.mission.instance import Entity, Vector, Weather
from lingjing.mission.kinds import builtin_engines
from lingjing.mission.kinds_format import TopSpeed
from lingjing.mission.vocabulary import FUEL_EMPTY
from lingjing.plugins.requests import STOP, Refusal, number
from lingjing.scene.blocks import Block
from lingjing.scene.terrain import Terrain
from lingjing.trace.records import DEAD, GROUNDED, Command

CRUISE_MPS = 40.0
"""Airspeed of an entity without the property `cruise_mps`, m/s (chosen)."""

ENDURANCE_S = 4.0 * 3600.0
"""Endurance of an entity without the property `endurance_s`, seconds (chosen)."""

CRUISE_FLOW = 12.2 / 3600.0
"""Fuel flow in level flight at 40 m/s, kg/s, measured in JSBSim. The size of a tank follows from it."""

KIND = builtin_engines()["plane"]
"""The declared kind of this engine."""

_SPEED = KIND.top_speed or TopSpeed(property="cruise_mps")

_OVER_M = 60.0
"""Horizontal distance at which a destination counts as reached, metres (chosen)."""

_LEVEL_M = 15.0
"""Difference in height at which a destination counts as reached, metres (chosen)."""

_LEAST_FLOW_SHARE = 0.5
"""Least fuel flow of any flight as a share of that in cruise: a bound for refusals (chosen)."""

AeroplaneStatus = Literal["grounded", "moving", "loitering", "dead"]
"""The status words of an aeroplane; `kinds.json` lists them for the checker."""


class Aeroplane(Aircraft):
    """A fixed-wing aircraft, in flight or before its launch."""

    launch_m, launch_drop_m = 60.0, 1.0
    terminal_mps, spurt_mps = 60.0, 20.0
    energy, kind = "fuel", KIND

    def __init__(
        self, entity: Entity, terrain: Terrain, weather: Weather, origin: tuple[float, float], seed: int
    ) -> None:
        super().__init__(entity, terrain, weather, origin, seed)
        self.cruise_mps = _SPEED.held(entity.number_or("cruise_mps", CRUISE_MPS))
        self._capacity_kg = self._fuel_kg = CRUISE_FLOW * entity.number_or("endurance_s", ENDURANCE_S)
        wind = (*wind_velocity(weather), 0.0)
        self._airframe = PlaneAirframe(origin, entity.position[2], entity.heading_deg, self.cruise_mps, wind)
        self._autopilot = Autopilot()
        self._sample = self._airframe.sample()
        self._radius = guidance.circle_radius(self.cruise_mps)
        self._height = entity.position[2]
        self._circling = self._holds = False
        self._straight: float | None = None
        self._centre = self._beside()
        if not stands(entity, terrain.support(*entity.position)):
            self._take_off()

    @property
    def empty(self) -> bool:
        """True if the tank is empty."""
        return self._fuel_kg <= 0.0

    @property
    def status(self) -> AeroplaneStatus:
        """Present status word."""
        if self.phase is FlightPhase.GROUNDED:
            return GROUNDED
        if not self.alive:
            return DEAD
        return "moving" if self._legs else "loitering"

    @property
    def resources(self) -> dict[str, float]:
        """Fuel left, as a share 0..1 (`fuel`) and in kilograms (`fuel_kg`)."""
        return {"fuel": self._fuel_kg / self._capacity_kg, "fuel_kg": self._fuel_kg}

    def start(self, command: Command) -> None:
        """Begin a flight. Raises `Refusal` with `fuel`, `unknown_verb`, `bad_argument` or `unreachable`."""
        if command.verb == STOP:
            self._hold()
        elif command.verb == "setDestination":
            self._head_for((number(command, "x"), number(command, "y"), number(command, "z")))
        else:
            raise Refusal("unknown_verb", f"an aeroplane has no verb `{command.verb}`")

    def step(self, weather: Weather, now_s: float) -> FlightNotice | None:
        """Move by one control period, which ends at `now_s`, and return what happened, if anything."""
        notice = FlightNotice(DONE) if self._holds else None
        self._holds = False
        if self.phase is FlightPhase.FALLING:
            self._fall()
        if not self.flying:
            return notice
        self._fly(weather)
        return self._contact(now_s) or self._exhausted() or self._reached() or notice

    def touchdown(self, solids: Sequence[Block], low_m: float) -> bool:
        """Rest if a glide has reached the ground or the water; return whether it did."""
        if solids or low_m > self._terrain.surface(*self.position[:2]):
            return False
        self._rest()
        return True

    def _head_for(self, goal: Vector) -> None:
        """Fly to a place. Raises `Refusal` with `unreachable` or `fuel`."""
        self._check(goal)
        self._begin(goal, arrives=True)
        self._length, self._height = max(self._length, 1.0), goal[2]
        self._circling, self._straight = False, None
        if self.phase is FlightPhase.GROUNDED:
            self._take_off()

    def _hold(self) -> None:
        """Cancel the destination and circle at the present place."""
        self._begin(arrives=False)
        self._straight, self._holds = None, True
        self._centre, self._height = self._beside(), self.position[2]

    def _take_off(self) -> None:
        self.phase = FlightPhase.FLYING
        self.velocity = self._sample.velocity
        self._attitude = self._sample.attitude

    def _beside(self) -> tuple[float, float]:
        """Return the centre of the clockwise circle that a turn begun now would follow."""
        east, north = self.velocity[0], self.velocity[1]
        course = math.atan2(east, north) if math.hypot(east, north) > 1.0 else self._attitude[2]
        x, y, _ = self.position
        return x + self._radius * math.cos(course), y - self._radius * math.sin(course)

    def _fly(self, weather: Weather) -> None:
        powered = self.phase is FlightPhase.FLYING
        climb = guidance.climb(self._height - self.position[2])
        demand = self._autopilot.fly(self._sample, self._bank(), climb, self.cruise_mps, powered=powered)
        self._airframe.set_wind(*self._gust.next(weather))
        self._airframe.command(*demand)
        self._airframe.step(STEPS)
        self._sample = sample = self._airframe.sample()
        self._move(sample.velocity, sample.attitude)
        if powered:
            self._fuel_kg = max(0.0, self._fuel_kg - sample.fuel_flow * PERIOD_S)

    def _bank(self) -> float:
        if self.phase is FlightPhase.DESCENDING:
            return 0.0
        speed = math.hypot(self.velocity[0], self.velocity[1])
        course = math.atan2(self.velocity[0], self.velocity[1])
        if self._legs and not self._circling:
            return guidance.turn(course, self._to(self._legs[0], course, speed))
        wanted, feed = guidance.around(self.position, self._centre, self._radius, speed)
        return guidance.turn(course, wanted, feed)

    def _to(self, goal: Vector, course: float, speed: float) -> float:
        if guidance.reachable(self.position, course, speed, goal):
            self._straight = None
            return guidance.bearing(self.position, goal)
        if self._straight is None:
            self._straight = course
        return self._straight

    def _reached(self) -> FlightNotice | None:
        if not self._legs or self.phase is not FlightPhase.FLYING:
            return None
        (goal,) = self._legs
        if not self._circling and math.dist(self.position[:2], goal[:2]) < _OVER_M:
            self._circling, self._centre = True, (goal[0], goal[1])
        level = abs(self.position[2] - goal[2]) < _LEVEL_M
        return FlightNotice("done") if self._circling and level else None

    def _exhausted(self) -> FlightNotice | None:
        if self.phase is not FlightPhase.FLYING or self._fuel_kg > 0.0:
            return None
        self.phase = FlightPhase.DESCENDING
        self._airframe.cut()
        return FlightNotice(FUEL_EMPTY)

    def _check(self, goal: Vector) -> None:
        x, y, z = goal
        lowest = self._floor.at(x, y)
        if z < lowest:
            raise Refusal("unreachable", f"({x:.1f}, {y:.1f}, {z:.1f}) is too low: at least z = {lowest:.1f} m")
        # A lower bound (top speed, least fuel flow): no destination that can be reached is refused.
        least = math.dist(self.position, goal) / _SPEED.held(math.inf) * CRUISE_FLOW * _LEAST_FLOW_SHARE
        if least > self._fuel_kg:
            raise Refusal("fuel", f"that needs at least {least:.1f} kg of fuel, {self._fuel_kg:.1f} kg are left")


class PlaneEngine(AircraftEngine):
    """The engine of all fixed-wing aircraft of an episode."""

    aircraft = Aeroplane
