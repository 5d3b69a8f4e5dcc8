"""What every aircraft does the same way, and the engine of a fleet of them.

An `Aircraft` stands, flies under the control of its kind, descends without power, falls after a collision, or is dead.
In flight it touches solids, other bodies, the ground and the water; its position is the trapezoidal integral of the
velocity that JSBSim says.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import ClassVar

from lingjing.engines.bodies import moved_on
from lingjing.engines.close_pairs import close_pairs
from lingjing.engines.flight_dynamics import STEP_S
from lingjing.engines.gust import Gust
from lingjing.engines.neighbours import Neighbour, Neighbours
from lingjing.engines.sea import GRAVITY
from lingjing.mission.instance import Entity, Vector, Weather
from lingjing.mission.kinds_format import EngineKind
from lingjing.mission.schedule import Schedule
from lingjing.mission.vocabulary import ARRIVED, COLLIDED
from lingjing.plugins.bodies import entity_size, solid_size, sunk_m
from lingjing.plugins.engine import EngineSpec
from lingjing.plugins.fleet import FleetEngine
from lingjing.plugins.requests import Refusal
from lingjing.plugins.stock import Accounts, booked
from lingjing.scene.blocks import Block
from lingjing.scene.city import City
from lingjing.scene.flight_floor import FlightFloor
from lingjing.scene.outlines import compass
from lingjing.scene.terrain import Terrain
from lingjing.trace.records import DEAD, BodyState, Command

PERIOD_S = 0.02
"""Control period: 50 Hz."""

STEPS = round(PERIOD_S / STEP_S)
"""Integration steps in a control period."""

_WATCHED_STEPS = 25
"""Control periods for which it is known at once which aircraft can meet."""


class FlightPhase(Enum):
    """What an aircraft is doing. In a descent it has no energy left and takes no commands."""

    GROUNDED = "grounded"
    SPINUP = "spinup"
    FLYING = "flying"
    DESCENDING = "descending"
    FALLING = "falling"
    DEAD = "dead"


DONE = "done"
"""What a notice says of a task that has come to its end."""


@dataclass(frozen=True, slots=True)
class FlightNotice:
    """Something that happened in a period: `done`, `battery_empty`, `fuel_empty`, or `collided` with `what`."""

    kind: str
    what: str = ""
    speed_mps: float = 0.0


class Aircraft(ABC):
    """One aircraft; `step` moves it by one control period."""

    launch_m: ClassVar[float]
    launch_drop_m: ClassVar[float]
    """Within `launch_m` of where it started, and no farther than this below it, it touches nothing."""
    terminal_mps: ClassVar[float]
    """The fastest that it falls."""
    spurt_mps: ClassVar[float]
    """What its speed may grow by in the next seconds."""
    energy: ClassVar[str]
    """What it runs out of: the reason of refusals."""
    kind: ClassVar[EngineKind]
    """The kind of its engine: its lowest point and the bounds of its commands."""

    def __init__(
        self, entity: Entity, terrain: Terrain, weather: Weather, origin: tuple[float, float], seed: int
    ) -> None:
        """Stand or fly where the mission says; `origin` is the scene's latitude and longitude."""
        size = entity_size(entity)
        self.id = entity.id
        self.solid = solid_size(entity) is not None
        self.radius_m = max(size.length_m, size.width_m) / 2.0
        """As wide as its type says, in whatever direction it points."""
        self.half_height_m = size.height_m / 2.0
        self._middle_m = self.half_height_m - sunk_m(entity)
        self.position = self._launch = entity.position
        self.velocity: Vector = (0.0, 0.0, 0.0)
        self.around: tuple[Neighbour, ...] = ()
        self.phase = FlightPhase.GROUNDED
        self.cruise_mps = 0.0
        self._attitude: Vector = (0.0, 0.0, math.radians(entity.heading_deg % 360.0))
        self._terrain = terrain
        assert self.kind.floor is not None  # that of every aircraft declares one
        self._floor = FlightFloor(terrain, entity, self.kind.floor)
        self._gust = Gust(weather, seed, f"{entity.engine}/{entity.id}/gust", PERIOD_S)
        self._legs: tuple[Vector, ...] = ()
        self._length = 0.0
        self._arrives = False

    @property
    @abstractmethod
    def status(self) -> str:
        """Its status word; `dead` once it takes no more commands."""

    @property
    @abstractmethod
    def resources(self) -> dict[str, float]:
        """What it has left and what is on board."""

    @property
    @abstractmethod
    def empty(self) -> bool:
        """Whether it has run out of energy."""

    @abstractmethod
    def start(self, command: Command) -> None:
        """Begin a command, or `Refusal`."""

    @abstractmethod
    def step(self, weather: Weather, now_s: float) -> FlightNotice | None:
        """Move by one control period, which ends at `now_s`, and say what happened."""

    @abstractmethod
    def touchdown(self, solids: Sequence[Block], low_m: float) -> bool:
        """Whether a descent goes on or ends well where its underside is at `low_m` amid `solids`."""

    def load(self, book: Accounts) -> None:  # noqa: B027 - most carry nothing
        """Take what the city's book says is on board."""

    @property
    def alive(self) -> bool:
        """Whether it still takes commands."""
        return self.phase in (FlightPhase.GROUNDED, FlightPhase.SPINUP, FlightPhase.FLYING)

    @property
    def flying(self) -> bool:
        """Whether it is in the air and whole."""
        return self.phase in (FlightPhase.FLYING, FlightPhase.DESCENDING)

    @property
    def fastest_mps(self) -> float:
        """What its speed does not exceed in the next seconds."""
        return max(self.cruise_mps, math.hypot(*self.velocity)) + self.spurt_mps

    @property
    def progress(self) -> float:
        """How much of the way is behind, 0..1."""
        if not self._legs or self._length <= 0.0:
            return 0.0
        return min(max(1.0 - path_length(self.position, self._legs) / self._length, 0.0), 1.0)

    @property
    def middle(self) -> Vector:
        """The middle of its body."""
        x, y, z = self.position
        return x, y, z + self._middle_m

    def finish(self) -> bool:
        """Give up or complete what is being done; whether reaching its end is an arrival."""
        self._legs = ()
        return self._arrives

    def strike(self, what: str) -> FlightNotice:
        """Hit something: the flight is over and the fall begins."""
        notice = FlightNotice(COLLIDED, what, math.hypot(*self.velocity))
        self.phase, self.velocity = FlightPhase.FALLING, (0.0, 0.0, 0.0)
        return notice

    def state(self, remainder_s: float) -> BodyState:
        """The aircraft `remainder_s` after its last step."""
        return BodyState(
            id=self.id,
            position=self._ahead(remainder_s),
            velocity=self.velocity,
            heading_deg=compass(math.degrees(self._attitude[2])),
            pitch_deg=math.degrees(self._attitude[1]),
            roll_deg=math.degrees(self._attitude[0]),
            status=self.status,
            resources=self.resources,
        )

    def _ahead(self, seconds: float) -> Vector:
        """Where it is some seconds later if it keeps its velocity."""
        return moved_on(self.position, self.velocity, seconds)

    def _begin(self, *legs: Vector, arrives: bool) -> None:
        self._legs, self._length, self._arrives = legs, path_length(self.position, legs), arrives

    def _move(self, velocity: Vector, attitude: Vector) -> None:
        """Take over what the flight dynamics say at the end of a period."""
        (x, y, z), (east, north, up), half = self.position, self.velocity, 0.5 * PERIOD_S
        self.position = (
            x + half * (east + velocity[0]),
            y + half * (north + velocity[1]),
            z + half * (up + velocity[2]),
        )
        self.velocity, self._attitude = velocity, attitude

    def _contact(self, now_s: float) -> FlightNotice | None:
        """What it hits, if anything."""
        x, y, z = self.position
        launched = math.hypot(x - self._launch[0], y - self._launch[1]) < self.launch_m
        if launched and z > self._launch[2] - self.launch_drop_m and self.phase is FlightPhase.FLYING:
            return None
        for other in self.around:
            if other.touches(self.middle, self.radius_m, self.half_height_m, now_s):
                return self.strike(other.id)
        low, high = z + self._middle_m - self.half_height_m, z + self._middle_m + self.half_height_m
        if low > self._terrain.ceiling_m(x, y):
            return None
        solids = self._terrain.solids_at(x, y, low, high, self.radius_m)
        if self.phase is FlightPhase.DESCENDING and self.touchdown(solids, low):
            return None
        if solids:
            return self.strike(solids[0].id)
        if low > self._terrain.surface(x, y):
            return None
        return self.strike("ground" if self._terrain.water_level(x, y) is None else "water")

    def _fall(self) -> None:
        x, y, z = self.position
        floor = self._terrain.support(x, y, z)
        sink = min(-self.velocity[2] + GRAVITY * PERIOD_S, self.terminal_mps)
        self.position, self.velocity = (x, y, max(floor, z - sink * PERIOD_S)), (0.0, 0.0, -sink)
        if self.position[2] <= floor:
            self._rest()

    def _rest(self) -> None:
        self.phase, self.velocity = FlightPhase.DEAD, (0.0, 0.0, 0.0)
        self._attitude = (0.0, 0.0, self._attitude[2])


class AircraftEngine(FleetEngine):
    """Steps every aircraft at 50 Hz (100 Hz inside JSBSim). Two that touch, one of them in flight, both crash."""

    step_s = PERIOD_S
    aircraft: ClassVar[type[Aircraft]]

    def build(self, spec: EngineSpec, city: City, seed: int) -> None:
        """Load one airframe an aircraft and put them at their start."""
        terrain = Terrain(city)
        self._schedule = Schedule(spec.instance)
        self._neighbours = Neighbours(spec.instance)
        weather = self._schedule.weather(0.0)
        self._fleet = {one.id: self.aircraft(one, terrain, weather, city.origin, seed) for one in spec.owned()}
        self._pairs: list[tuple[Aircraft, Aircraft]] = []

    def start(self, command: Command) -> None:
        """Begin a command, or `Refusal`: `dead`, `battery` or `fuel`, and those of the aircraft."""
        aircraft = self._fleet[command.resource]
        if not aircraft.alive:
            if aircraft.empty:
                raise Refusal(aircraft.energy, _exhausted(aircraft))
            raise Refusal(DEAD, f"`{aircraft.id}` has crashed")
        aircraft.start(command)

    def look(self, mirrors: Sequence[BodyState]) -> None:
        """Who is near each aircraft, and what is on board."""
        self._neighbours.look(mirrors, self.clock.time_s)
        book = booked(mirrors)
        for aircraft in self._fleet.values():
            aircraft.load(book)
            flying, radius = aircraft.flying, aircraft.radius_m
            aircraft.around = self._neighbours.near(aircraft.middle, aircraft.fastest_mps, radius) if flying else ()

    def step(self) -> None:
        """One control period of every aircraft."""
        now = self.clock.now_s
        weather = self._schedule.weather(now - self.step_s)
        for aircraft in self._fleet.values():
            notice = aircraft.step(weather, now)
            if notice is not None:
                self._report(aircraft, notice)
        if self.clock.done % _WATCHED_STEPS == 1:
            self._pairs = self._meeting()
        if self._pairs:
            self._collide()

    def states(self) -> Iterable[BodyState]:
        """Every aircraft."""
        return (aircraft.state(self.clock.remainder_s) for aircraft in self._fleet.values())

    def progress(self) -> Mapping[str, float]:
        """How much of each way is behind."""
        return {aircraft.id: aircraft.progress for aircraft in self._fleet.values()}

    def _meeting(self) -> list[tuple[Aircraft, Aircraft]]:
        """The solid ones that may touch each other before this is asked again."""
        solid = [one for one in self._fleet.values() if one.solid]
        ahead_s = _WATCHED_STEPS * PERIOD_S
        reaches = (math.hypot(one.radius_m, one.half_height_m) + ahead_s * one.fastest_mps for one in solid)
        close = close_pairs([one.middle for one in solid], 2.0 * max(reaches, default=0.0))
        return [(solid[first], solid[second]) for first, second in close]

    def _collide(self) -> None:
        """One in flight and one that it touches both crash; each is reported once."""
        whole = {one.id for pair in self._pairs for one in pair if one.alive or one.flying}
        for one, other in self._pairs:
            if one.id in whole and other.id in whole and (one.flying or other.flying) and _touch(one, other):
                self._report(one, one.strike(other.id))
                self._report(other, other.strike(one.id))

    def _report(self, aircraft: Aircraft, notice: FlightNotice) -> None:
        now, arrives = self.clock.now_s, aircraft.finish()
        if notice.kind == DONE:
            self.requests.complete(aircraft.id, now)
            if arrives:
                self.emit(ARRIVED, aircraft.id)
        elif notice.kind == COLLIDED:
            self.requests.fail(aircraft.id, now, COLLIDED, f"`{aircraft.id}` hit `{notice.what}`")
            self.emit(COLLIDED, aircraft.id, notice.what, speed_mps=notice.speed_mps)
        else:
            self.requests.fail(aircraft.id, now, aircraft.energy, _exhausted(aircraft))
            self.emit(notice.kind, aircraft.id)


def _touch(one: Aircraft, other: Aircraft) -> bool:
    """Whether two upright cylinders of their measures are in touch."""
    (x, y, z), (east, north, up) = one.middle, other.middle
    if abs(z - up) >= one.half_height_m + other.half_height_m:
        return False
    return math.hypot(x - east, y - north) < one.radius_m + other.radius_m


def path_length(start: Vector, legs: Sequence[Vector]) -> float:
    """Length of the way from `start` through all `legs`, metres."""
    return sum(math.dist(a, b) for a, b in zip((start, *legs), legs, strict=False))


def _exhausted(aircraft: Aircraft) -> str:
    if aircraft.energy == "battery":
        return f"the battery of `{aircraft.id}` is empty"
    return f"`{aircraft.id}` has no fuel left"
