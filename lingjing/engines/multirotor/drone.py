"""One multirotor: its phase, its position, what it runs into and what is left in its battery.

The ground is a support and not a contact model: a grounded vehicle is held where it stands until its rotors carry it.
Touching a solid, the ground or the water in flight ends the flight: the vehicle falls to what is below and is dead.
An empty battery (the reserve that the flight controller keeps) makes it land where it is and ends it there, be that
on a roof. A load makes it heavier: it takes more thrust, so more energy, and cruises slower.
"""

from __future__ import annotations

import math
from enum import Enum

from lingjing.engines.aloft import Notice
from lingjing.engines.gust import Gust
from lingjing.engines.multirotor.airframe import LIFT_N, MASS_KG, STEP_S, Airframe, Sample
from lingjing.engines.multirotor.control import BRAKE_MPS2, PERIOD_S, Autopilot, Demand
from lingjing.engines.multirotor.power import Battery
from lingjing.engines.multirotor.verbs import Situation, Task, path_length
from lingjing.engines.sea import GRAVITY
from lingjing.mission.instance import Entity, Vector, Weather
from lingjing.plugins.neighbours import Neighbour
from lingjing.plugins.stock import Stock
from lingjing.scene.outlines import compass
from lingjing.scene.terrain import Terrain
from lingjing.trace.records import BodyState

CRUISE_MPS = 12.0
ENDURANCE_S = 1500.0
"""What an entity without these properties gets."""

_STEPS = round(PERIOD_S / STEP_S)
_SPINUP_PERIODS = 25
RADIUS_M = 0.3
"""From the centre to the rotors' tips, roughly: how close is a collision."""
_HALF_HEIGHT_M = 0.1
_AIRBORNE_M = 6.0
_LAUNCH_M = 1.5
_PASSED_M = 1.5
_ARRIVED_M = 1.0
_SLOW_MPS = 0.5
_TERMINAL_MPS = 20.0
_RESERVE = 1.25
"""Thrust in hand over the weight that it takes to fly."""
_TOUCH_M = 0.5
_SPURT_MPS = 5.0


class Phase(Enum):
    """What the vehicle is doing."""

    GROUNDED = "grounded"
    SPINUP = "spinup"
    FLYING = "flying"
    LANDING = "landing"
    FALLING = "falling"
    DEAD = "dead"


class Drone:
    """A vehicle in flight or on the ground; `step` moves it by one control period."""

    def __init__(
        self, entity: Entity, terrain: Terrain, weather: Weather, origin: tuple[float, float], seed: int
    ) -> None:
        self.id = entity.id
        self.position = entity.position
        self.velocity: Vector = (0.0, 0.0, 0.0)
        self.task: Task | None = None
        self.battery = Battery.lasting(_property(entity, "endurance_s", ENDURANCE_S))
        self.stock = Stock(entity)
        self.around: tuple[Neighbour, ...] = ()
        self._full_cruise = self._cruise = _property(entity, "cruise_mps", CRUISE_MPS)
        self._terrain = terrain
        self._gust = Gust(weather, seed, f"multirotor/{entity.id}/gust", PERIOD_S)
        self._airframe = Airframe(*origin, entity.position[2], entity.heading_deg)
        self._autopilot = Autopilot()
        self._attitude: Vector = (0.0, 0.0, math.radians(entity.heading_deg % 360.0))
        self._face = self._attitude[2]
        self._launch = entity.position
        self._goal = entity.position
        self._legs: tuple[Vector, ...] = ()
        self._length = 0.0
        self._spun = 0
        self._load_kg = 0.0
        self.phase = Phase.GROUNDED
        self.carry()
        if entity.position[2] > terrain.support(*entity.position) + _AIRBORNE_M:
            self._start_airborne()

    @property
    def situation(self) -> Situation:
        """What planning a command needs to know."""
        grounded = self.phase in (Phase.GROUNDED, Phase.SPINUP)
        return Situation(self.position, self._attitude[2], grounded, self.battery.left_wh)

    @property
    def alive(self) -> bool:
        """Whether the vehicle still takes commands."""
        return self.phase in (Phase.GROUNDED, Phase.SPINUP, Phase.FLYING)

    @property
    def flying(self) -> bool:
        """Whether the vehicle is in the air and in control."""
        return self.phase in (Phase.FLYING, Phase.LANDING)

    @property
    def reach_mps(self) -> float:
        """A speed that it will not exceed in the next seconds."""
        return max(self._cruise, math.hypot(*self.velocity)) + _SPURT_MPS

    @property
    def overloaded(self) -> bool:
        """Whether the load is more than the rotors can fly with."""
        return (MASS_KG + self._load_kg) * GRAVITY * _RESERVE > LIFT_N

    @property
    def progress(self) -> float:
        """How much of the task's way is behind, 0..1."""
        if self.task is None or self._length <= 0.0:
            return 0.0
        return min(max(1.0 - path_length(self.position, self._legs) / self._length, 0.0), 1.0)

    def begin(self, task: Task) -> None:
        """Start a task."""
        self.task = task
        self._legs = task.legs
        self._length = path_length(self.position, task.legs)
        self._goal = task.legs[0]
        if task.face_rad is not None:
            self._face = task.face_rad
        if self.phase is Phase.GROUNDED:
            self.phase = Phase.SPINUP

    def brake(self) -> None:
        """Stop as soon as the brakes allow and hover there; a vehicle that has not left the ground stays."""
        if self.phase in (Phase.GROUNDED, Phase.SPINUP):
            self.phase, self._spun = Phase.GROUNDED, 0
            self.begin_here()
            return
        speed = math.hypot(*self.velocity)
        ahead = speed / (2.0 * BRAKE_MPS2) + (1.0 / speed if speed > 2.0 else 0.0)
        self._goal = self._point_ahead(ahead)
        self.task = Task(legs=(self._goal,), arrives=False)
        self._legs, self._length = self.task.legs, path_length(self.position, self.task.legs)

    def carry(self) -> None:
        """Feel the load on board: the same thrust margin leaves less speed for a greater weight."""
        if self.stock.load_kg != self._load_kg:
            self._load_kg = self.stock.load_kg
            self._autopilot.mass_kg = MASS_KG + self._load_kg
            self._cruise = self._full_cruise * math.sqrt(MASS_KG / self._autopilot.mass_kg)
            self._airframe.carry(self._load_kg)

    def strike(self, what: str) -> Notice:
        """Hit something: the flight is over and the fall begins."""
        notice = Notice("collided", what, math.hypot(*self.velocity))
        self.phase, self.velocity = Phase.FALLING, (0.0, 0.0, 0.0)
        return notice

    def begin_here(self) -> None:
        """A task that is done at once."""
        self.task = Task(legs=(self.position,), arrives=False)
        self._legs, self._length, self._goal = self.task.legs, 0.0, self.position

    def step(self, weather: Weather, now_s: float) -> Notice | None:
        """Move by one control period, which ends at `now_s`, and say what happened."""
        if self.phase is Phase.FALLING:
            self._fall()
            return None
        if self.phase is Phase.DEAD:
            return None
        if self.phase is Phase.GROUNDED:
            return Notice("done") if self.task is not None else None
        if self.phase is Phase.SPINUP:
            self._spin_up()
            return None
        self._fly(weather)
        return self._contact(now_s) or self._exhausted() or self._reached()

    def state(self, remainder_s: float) -> BodyState:
        """The vehicle `remainder_s` after its last step."""
        x, y, z = (here + remainder_s * rate for here, rate in zip(self.position, self.velocity, strict=True))
        return BodyState(
            id=self.id,
            position=(x, y, z),
            velocity=self.velocity,
            heading_deg=compass(math.degrees(self._attitude[2])),
            pitch_deg=math.degrees(self._attitude[1]),
            roll_deg=math.degrees(self._attitude[0]),
            status=self.status,
            resources={"battery": self.battery.share, "battery_wh": self.battery.left_wh, **self.stock.amounts},
        )

    @property
    def status(self) -> str:
        """`grounded`, `hovering`, `moving` or `dead`."""
        if not self.alive:
            return "dead"
        if self.phase is Phase.GROUNDED:
            return "grounded"
        return "moving" if self.task is not None else "hovering"

    def _start_airborne(self) -> None:
        for _ in range(_SPINUP_PERIODS):
            self._spin_up()

    def _spin_up(self) -> None:
        self._airframe.command(0.0, 0.0, 0.0, self._autopilot.mass_kg * GRAVITY)
        self._airframe.step(_STEPS)
        self._spun += 1
        if self._spun >= _SPINUP_PERIODS:
            self._airframe.release()
            self.phase = Phase.FLYING

    def _fly(self, weather: Weather) -> None:
        demand = self._autopilot.fly(self.position, self.velocity, self._attitude, self._goal, self._cruise, self._face)
        self._airframe.blow(*self._gust.next(weather))
        self._apply(demand)
        sample = self._airframe.sample()
        self._move(sample)
        self.battery.drain(sample, PERIOD_S)

    def _apply(self, demand: Demand) -> None:
        self._airframe.command(demand.roll, demand.pitch, demand.yaw_rate, demand.thrust_n)
        self._airframe.step(_STEPS)

    def _move(self, sample: Sample) -> None:
        (x, y, z), (east, north, up), now, half = self.position, self.velocity, sample.velocity, 0.5 * PERIOD_S
        self.position = (x + half * (east + now[0]), y + half * (north + now[1]), z + half * (up + now[2]))
        self.velocity = now
        self._attitude = (sample.roll, sample.pitch, sample.heading)

    def _contact(self, now_s: float) -> Notice | None:
        if self._at_launch():
            return None
        for other in self.around:
            if other.touches(self.position, RADIUS_M, _HALF_HEIGHT_M, now_s):
                return self.strike(other.id)
        x, y, z = self.position
        low = z - _HALF_HEIGHT_M
        if low > self._terrain.ceiling_m(x, y):
            return None
        solids = self._terrain.solids_at(x, y, low, z + _HALF_HEIGHT_M, RADIUS_M)
        if self.phase is Phase.LANDING and all(solid.top_at(x, y) < low + _TOUCH_M for solid in solids):
            if low <= self._terrain.support(x, y, low + _TOUCH_M):
                self._rest()
            return None
        if solids:
            return self.strike(solids[0].id)
        if low > self._terrain.surface(x, y):
            return None
        return self.strike("ground" if self._terrain.water_level(x, y) is None else "water")

    def _at_launch(self) -> bool:
        x, y, z = self._launch
        near = math.hypot(self.position[0] - x, self.position[1] - y) < _LAUNCH_M
        return near and self.position[2] > z - RADIUS_M and self.phase is Phase.FLYING

    def _exhausted(self) -> Notice | None:
        if self.phase is not Phase.FLYING or not self.battery.empty:
            return None
        x, y, _ = self._point_ahead(math.hypot(*self.velocity) / (2.0 * BRAKE_MPS2))
        self.phase = Phase.LANDING
        self._goal = (x, y, self._terrain.support(x, y, self.position[2]) - 2.0)
        return Notice("battery_empty")

    def _reached(self) -> Notice | None:
        if self.task is None or self.phase is not Phase.FLYING:
            return None
        if len(self._legs) > 1:
            if math.dist(self.position, self._legs[0]) < _PASSED_M:
                self._legs = self._legs[1:]
                self._goal = self._legs[0]
            return None
        if math.dist(self.position, self._goal) < _ARRIVED_M and math.hypot(*self.velocity) < _SLOW_MPS:
            return Notice("done")
        return None

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

    def _point_ahead(self, seconds: float) -> Vector:
        x, y, z = (here + seconds * rate for here, rate in zip(self.position, self.velocity, strict=True))
        return x, y, z


def _property(entity: Entity, name: str, default: float) -> float:
    value = entity.properties.get(name, default)
    return float(value) if isinstance(value, int | float) else default
