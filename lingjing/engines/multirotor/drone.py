"""One multirotor: its phase, motion, collisions and battery.

The ground is a support without a contact model: a grounded vehicle is held in place until its rotors carry it. Contact
with a solid, the ground or the water in flight ends the flight; the vehicle falls to the surface below and is dead.
With an empty battery (the reserve that flight controllers keep) it lands at its present place, possibly on a roof, and
is dead. A load needs more thrust and energy, and reduces the cruise speed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import ClassVar, Literal

from lingjing.engines.aircraft import DONE, Aircraft, AircraftEngine, FlightNotice, FlightPhase
from lingjing.engines.battery import Battery
from lingjing.engines.bodies import is_coarse
from lingjing.engines.flight_dynamics import STEP_S
from lingjing.engines.multirotor.airframe import LIFT_N, MASS_KG, QuadrotorAirframe
from lingjing.engines.multirotor.coarse_airframe import COARSE_PERIOD_S, PointMassAirframe
from lingjing.engines.multirotor.control import (
    BRAKE_MPS2,
    CLIMB_MPS,
    SINK_MPS,
    AttitudeSetPoint,
    PositionController,
    wanted_velocity,
)
from lingjing.engines.multirotor.power import RotorPower, hover_power
from lingjing.engines.multirotor.verbs import ATTITUDE, KIND, LAND, STEER, Situation, plan
from lingjing.engines.sea import GRAVITY
from lingjing.mission.footprint import stands
from lingjing.mission.instance import Entity, Vector, Weather
from lingjing.mission.vocabulary import BATTERY_EMPTY
from lingjing.plugins.engine import EngineSpec
from lingjing.plugins.requests import STOP, Refusal, number, optional_number
from lingjing.plugins.stock import Accounts, Stock
from lingjing.scene.blocks import Block
from lingjing.scene.terrain import Terrain
from lingjing.trace.records import DEAD, GROUNDED, Command

CRUISE_MPS = 12.0
"""Cruise speed of an entity without the property `cruise_mps`, m/s (chosen)."""

ENDURANCE_S = 1500.0
"""Time of hovering of an entity without the property `endurance_s`, seconds (chosen)."""

_SPINUP_S = 0.5
"""Time until the rotors carry the vehicle, seconds (chosen)."""

_PASSED_M = 1.5
"""Distance at which an intermediate point counts as passed, metres (chosen)."""

_ARRIVED_M = 1.0
"""Distance at which the last point counts as reached, metres (chosen)."""

_SLOW_MPS = 0.5
"""Speed below which a vehicle at its last point has arrived, m/s (chosen)."""
_RESERVE = 1.25
"""Least ratio of the largest thrust to the weight with which a vehicle may take off (chosen)."""
_TOUCH_M = 0.5
"""Height above the underside up to which a solid counts as landing surface and not as a wall, metres (chosen)."""

_DRIFTED_M = 3.0
"""Distance from the place that a vehicle holds beyond which it drifts, metres.

Chosen: three times the arrival distance. Measured over 120 s: the greatest distance is 2.1 m in a wind of 14 m/s with a
turbulence of 0.3, 16.9 m with 0.5, and 495 m in 25 m/s, which the vehicle cannot hold.
"""

DroneStatus = Literal["grounded", "hovering", "drifting", "moving", "dead"]
"""The status words of a drone; `kinds.json` lists them for the checker."""


class Drone(Aircraft):
    """A multirotor in flight or on the ground."""

    launch_m, launch_drop_m = 1.5, 0.3
    terminal_mps, spurt_mps = 20.0, 5.0
    energy, kind = "battery", KIND
    airframe: ClassVar[type[QuadrotorAirframe | PointMassAirframe]] = QuadrotorAirframe
    """The class of its airframe."""

    def __init__(
        self, entity: Entity, terrain: Terrain, weather: Weather, origin: tuple[float, float], seed: int
    ) -> None:
        super().__init__(entity, terrain, weather, origin, seed)
        self._battery = Battery.for_endurance(hover_power(), entity.number_or("endurance_s", ENDURANCE_S))
        self._power = RotorPower()
        self._stock = Stock(entity)
        self._full_cruise = self.cruise_mps = entity.number_or("cruise_mps", CRUISE_MPS)
        self._band_low_m = entity.number_or("band_low_m", -math.inf)
        self._origin = origin
        self._steps = round(self.period_s / STEP_S)
        self._spinup_periods = round(_SPINUP_S / self.period_s)
        self._airframe = self.airframe(origin, entity.position[2], entity.heading_deg)
        self._controller = PositionController(self.period_s)
        self._face = self._attitude[2]
        self._goal = entity.position
        self._spun = 0
        self._steered: Vector | None = None
        self._tilted: AttitudeSetPoint | None = None
        self._landing = False
        self._load_kg = 0.0
        self.load({})
        if not stands(entity, terrain.support(*entity.position)):
            for _ in range(self._spinup_periods):
                self._spin_up()

    @property
    def empty(self) -> bool:
        """True if the battery is empty."""
        return self._battery.empty

    @property
    def descends(self) -> bool:
        """True if contact with a surface below is a landing: without energy, or after `land`."""
        return self._landing or super().descends

    @property
    def status(self) -> DroneStatus:
        """Present status word."""
        if not self.alive:
            return DEAD
        if self.phase is FlightPhase.GROUNDED:
            return GROUNDED
        if self._legs or self._steered is not None or self._tilted is not None or self._landing:
            return "moving"
        return "drifting" if math.dist(self.position, self._goal) > _DRIFTED_M else "hovering"

    @property
    def resources(self) -> dict[str, float]:
        """Energy left (0..1 and watt-hours) and goods on board."""
        return {**self._battery.resources, **self._stock.amounts}

    def start(self, command: Command) -> None:
        """Begin a task. Raises `Refusal` with `overloaded`, `busy` or with a reason of `plan`."""
        if command.verb in (STEER, LAND, ATTITUDE):
            self._follow(command)
            return
        self._steered, self._tilted, self._landing = None, None, False
        if command.verb == STOP:
            self._brake()
            return
        grounded = self.phase in (FlightPhase.GROUNDED, FlightPhase.SPINUP)
        here = Situation(self.position, self._attitude[2], grounded, self._battery.left_wh, self._band_low_m)
        task = plan(command, here, self._terrain, self._floor)
        self._check_load()
        self._begin(*task.legs, arrives=task.arrives)
        self._goal = task.legs[0]
        if task.face_rad is not None:
            self._face = task.face_rad
        if self.phase is FlightPhase.GROUNDED:
            self.phase = FlightPhase.SPINUP

    def _check_load(self) -> None:
        if (MASS_KG + self._load_kg) * GRAVITY * _RESERVE > LIFT_N:
            raise Refusal("overloaded", f"`{self.id}` cannot lift {self._load_kg:g} kg")

    def _follow(self, command: Command) -> None:
        """Take over a set-point. Raises `Refusal`: `busy` beside a pending request, `grounded`, `overloaded`."""
        if self._legs:
            raise Refusal("busy", f"`{self.id}` is still busy; `stop` ends it")
        grounded = self.phase in (FlightPhase.GROUNDED, FlightPhase.SPINUP)
        if command.verb == ATTITUDE:
            self._tilt(_attitude_of(command), grounded=grounded)
            return
        tilted, self._tilted = self._tilted is not None, None
        if tilted:
            self._face = self._attitude[2]
        if command.verb == LAND:
            if not grounded:
                x, y, _ = self._ahead(math.hypot(*self.velocity) / (2.0 * BRAKE_MPS2))
                self._goal = (x, y, self._terrain.support(x, y, self.position[2]) - 2.0)
                self._steered, self._landing = None, True
            return
        if tilted and self._steered is None:
            self._steered = self.velocity  # so that a set-point of velocity 0 brakes
        self._steer((number(command, "east"), number(command, "north"), number(command, "up")), grounded=grounded)
        heading = optional_number(command, "heading")
        if heading is not None:
            self._face = math.radians(heading)

    def _tilt(self, point: AttitudeSetPoint, *, grounded: bool) -> None:
        if grounded and self.phase is FlightPhase.GROUNDED:
            weight = (MASS_KG + self._load_kg) * GRAVITY
            lifts = point.height_m > self.position[2] if point.throttle is None else point.throttle * LIFT_N > weight
            if not lifts:
                raise Refusal(GROUNDED, f"`{self.id}` is on the ground: neither its throttle nor its height lifts it")
            self._check_load()
            self.phase = FlightPhase.SPINUP
        self._steered, self._landing, self._tilted = None, False, point
        self._goal = self.position

    def _steer(self, velocity: Vector, *, grounded: bool) -> None:
        east, north, up = velocity
        if grounded and self.phase is FlightPhase.GROUNDED:
            if up <= 0.0:
                raise Refusal(GROUNDED, f"`{self.id}` is on the ground: it takes off with `up` > 0")
            self._check_load()
            self.phase = FlightPhase.SPINUP
        moving = any(velocity)
        if not moving and not grounded and (self._landing or self._steered is not None):
            self._brake()
            self._legs = ()  # a set-point is no request that would have to be completed
        self._landing = False
        scale = min(1.0, self.cruise_mps / max(math.hypot(east, north), 1e-9))
        clipped = east * scale, north * scale, min(max(up, -SINK_MPS), CLIMB_MPS)
        self._steered = clipped if moving else None

    def _brake(self) -> None:
        """Stop with the braking deceleration and hover there. A vehicle that is still on the ground stays there."""
        if self.phase in (FlightPhase.GROUNDED, FlightPhase.SPINUP):
            self.phase, self._spun = FlightPhase.GROUNDED, 0
            self._goal = self.position
        else:
            speed = math.hypot(*self.velocity)
            self._goal = self._ahead(speed / (2.0 * BRAKE_MPS2) + (1.0 / speed if speed > 2.0 else 0.0))
        self._begin(self._goal, arrives=False)

    def load(self, book: Accounts) -> None:
        """Take over the load on board. The same thrust margin leaves a lower cruise speed for a greater weight."""
        self._stock.read(book)
        if self._stock.load_kg != self._load_kg:
            self._load_kg = self._stock.load_kg
            self._controller.mass_kg = MASS_KG + self._load_kg
            self.cruise_mps = self._full_cruise * math.sqrt(MASS_KG / self._controller.mass_kg)
            self._airframe.set_load(self._load_kg)

    def step(self, weather: Weather, now_s: float) -> FlightNotice | None:
        """Move by one control period, which ends at `now_s`, and return what happened, if anything."""
        if self.phase is FlightPhase.FALLING:
            self._fall()
        elif self.phase is FlightPhase.GROUNDED:
            return FlightNotice(DONE) if self._legs else None
        elif self.phase is FlightPhase.SPINUP:
            self._spin_up()
        elif self.flying:
            self._fly(weather)
            return self._contact(now_s) or self._exhausted() or self._reached()
        return None

    def touchdown(self, solids: Sequence[Block], low_m: float) -> bool:
        """Rest if a landing has reached the surface below, possibly a roof; return False on contact with a wall."""
        x, y, _ = self.position
        if not all(solid.top_at(x, y) < low_m + _TOUCH_M for solid in solids):
            return False
        top = self._terrain.support(x, y, low_m + _TOUCH_M)
        if low_m <= top:
            afloat = self._terrain.water_level(x, y) is not None and top <= self._terrain.surface(x, y)
            if self._landing and not afloat and not self._battery.empty:
                self._settle(top + self.position[2] - low_m)
            else:
                self._rest()
        return True

    def _settle(self, z: float) -> None:
        """Stand at elevation `z` after a landing, with rotors at rest, ready for another take-off."""
        self._rest()
        self.position = self._launch = self._goal = (self.position[0], self.position[1], z)
        self.phase, self._spun, self._landing = FlightPhase.GROUNDED, 0, False
        self._airframe = self.airframe(self._origin, z, math.degrees(self._attitude[2]))
        self._airframe.set_load(self._load_kg)
        self._controller = PositionController(self.period_s)
        self._controller.mass_kg = MASS_KG + self._load_kg
        self._face = self._attitude[2]

    def _spin_up(self) -> None:
        self._airframe.command(0.0, 0.0, 0.0, self._controller.mass_kg * GRAVITY)
        self._airframe.step(self._steps)
        self._spun += 1
        if self._spun >= self._spinup_periods:
            self._airframe.release()
            self.phase = FlightPhase.FLYING

    def _fly(self, weather: Weather) -> None:
        airframe, fly = self._airframe, self._controller.fly
        if self._tilted is not None:
            demand = self._controller.hold(self._tilted, self.position[2], self.velocity, self._attitude)
        else:
            wanted = self._steered or wanted_velocity(self.position, self._goal, self.cruise_mps)
            demand = fly(self.velocity, self._attitude, wanted, self._face)
        airframe.set_wind(*self._gust.next(weather))
        airframe.command(*demand)
        airframe.step(self._steps)
        sample = airframe.sample()
        self._move(sample.velocity, sample.attitude)
        self._battery.drain(self._power.watts(sample), self.period_s)

    def _exhausted(self) -> FlightNotice | None:
        if self.phase is not FlightPhase.FLYING or not self._battery.empty:
            return None
        x, y, _ = self._ahead(math.hypot(*self.velocity) / (2.0 * BRAKE_MPS2))
        self.phase, self._steered, self._tilted, self._landing = FlightPhase.DESCENDING, None, None, False
        self._goal = (x, y, self._terrain.support(x, y, self.position[2]) - 2.0)
        return FlightNotice(BATTERY_EMPTY)

    def _reached(self) -> FlightNotice | None:
        if not self._legs or self.phase is not FlightPhase.FLYING:
            return None
        if len(self._legs) > 1:
            if math.dist(self.position, self._legs[0]) < _PASSED_M:
                self._legs = self._legs[1:]
                self._goal = self._legs[0]
            return None
        if math.dist(self.position, self._goal) < _ARRIVED_M and math.hypot(*self.velocity) < _SLOW_MPS:
            return FlightNotice(DONE)
        return None


def _attitude_of(command: Command) -> AttitudeSetPoint:
    """Return the set-point of a command. Raises `Refusal` with `bad_argument`."""
    heading, throttle = optional_number(command, "heading"), optional_number(command, "throttle")
    if throttle is not None and not 0.0 <= throttle <= 1.0:
        raise Refusal("bad_argument", f"`throttle` is a share from 0 to 1, not {throttle:g}")
    return AttitudeSetPoint(
        roll=math.radians(number(command, "roll")),
        pitch=math.radians(number(command, "pitch")),
        heading=None if heading is None else math.radians(heading),
        yaw_rate=math.radians(optional_number(command, "yaw_rate") or 0.0),
        throttle=throttle,
        height_m=number(command, "height") if throttle is None else 0.0,
    )


class CoarseDrone(Drone):
    """A multirotor with coarse motion: the same controller at 4 Hz on an airframe without attitude dynamics."""

    period_s = COARSE_PERIOD_S
    airframe = PointMassAirframe


class MultirotorEngine(AircraftEngine):
    """The engine of all multirotors of an episode."""

    aircraft = Drone
    at_once = (STEER, LAND, ATTITUDE)

    def aircraft_for(self, spec: EngineSpec) -> type[Aircraft]:
        """Return the class of the drones of an episode."""
        return CoarseDrone if is_coarse(spec) else Drone
