"""The behaviour that all aircraft share, and the engine of a fleet of aircraft.

An `Aircraft` stands, flies under the control of its subclass, descends without power, falls after a collision, or is
dead. In flight it can touch solids, other bodies, the ground and the water. Its position is the trapezoidal integral of
JSBSim's velocity.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import ClassVar

from lingjing.engines.bodies import extrapolate
from lingjing.engines.close_pairs import close_pairs
from lingjing.engines.flight_dynamics import STEP_S
from lingjing.engines.gust import Gust
from lingjing.engines.neighbours import Neighbour, Neighbours
from lingjing.engines.sea import GRAVITY
from lingjing.mission.instance import Entity, Vector, Weather
from lingjing.mission.kinds_format import EngineKind
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
from lingjing.sums import total
from lingjing.trace.records import DEAD, BodyState, Command

PERIOD_S = 0.02
"""Control period: 50 Hz (chosen)."""

STEPS = round(PERIOD_S / STEP_S)
"""Integration steps of JSBSim in a control period."""

_WATCHED_S = 0.5
"""Time between two searches for pairs of aircraft that can meet, seconds (chosen)."""


class FlightPhase(Enum):
    """The phase of an aircraft. A descending aircraft has no energy left and takes no commands."""

    GROUNDED = "grounded"
    SPINUP = "spinup"
    FLYING = "flying"
    DESCENDING = "descending"
    FALLING = "falling"
    DEAD = "dead"


DONE = "done"
"""Kind of a notice of a completed task."""


@dataclass(frozen=True, slots=True)
class FlightNotice:
    """An event of one control period."""

    kind: str
    """`done`, `battery_empty`, `fuel_empty` or `collided`."""
    what: str = ""
    """Thing that the aircraft hit: the id of a body or solid, `ground` or `water`; empty without a collision."""
    speed_mps: float = 0.0
    """Speed at a collision, m/s; 0 otherwise."""


class Aircraft(ABC):
    """One aircraft; `step` moves it by one control period."""

    launch_m: ClassVar[float]
    """Horizontal radius around the start, metres, within which a flying aircraft touches nothing."""
    launch_drop_m: ClassVar[float]
    """Depth below the start, metres, to which the exemption of `launch_m` extends."""
    terminal_mps: ClassVar[float]
    """Limit of the speed of a fall, m/s."""
    spurt_mps: ClassVar[float]
    """Largest increase of the speed in the next seconds, m/s."""
    energy: ClassVar[str]
    """Name of the energy store, `battery` or `fuel`: the reason of refusals when it is empty."""
    kind: ClassVar[EngineKind]
    """The kind of its engine, with its lowest point and the bounds of its commands."""
    period_s: ClassVar[float] = PERIOD_S
    """Control period, seconds: the time of one `step`."""

    def __init__(
        self, entity: Entity, terrain: Terrain, weather: Weather, origin: tuple[float, float], seed: int
    ) -> None:
        """Create the aircraft at its declared place; `origin` is the scene's latitude and longitude in degrees."""
        size = entity_size(entity)
        self.id = entity.id
        self.solid = solid_size(entity) is not None
        self.radius_m = max(size.length_m, size.width_m) / 2.0
        """Radius of the upright cylinder that stands for its body in any heading."""
        self.half_height_m = size.height_m / 2.0
        self._middle_m = self.half_height_m - sunk_m(entity)
        self.position = self._launch = entity.position
        self.velocity: Vector = (0.0, 0.0, 0.0)
        self.around: tuple[Neighbour, ...] = ()
        self.phase = FlightPhase.GROUNDED
        self.cruise_mps = 0.0
        self._attitude: Vector = (0.0, 0.0, math.radians(entity.heading_deg % 360.0))
        self._terrain = terrain
        assert self.kind.floor is not None  # every kind of aircraft declares a floor
        self._floor = FlightFloor(terrain, entity, self.kind.floor)
        self._gust = Gust(weather, seed, f"{entity.engine}/{entity.id}/gust", self.period_s)
        self._legs: tuple[Vector, ...] = ()
        self._length = 0.0
        self._arrives = False

    @property
    @abstractmethod
    def status(self) -> str:
        """Status word; `dead` if the aircraft takes no more commands."""

    @property
    @abstractmethod
    def resources(self) -> dict[str, float]:
        """Energy left and goods on board, by name."""

    @property
    @abstractmethod
    def empty(self) -> bool:
        """True if the energy is used up."""

    @abstractmethod
    def start(self, command: Command) -> None:
        """Begin a command; raises `Refusal` if it cannot be carried out."""

    @abstractmethod
    def step(self, weather: Weather, now_s: float) -> FlightNotice | None:
        """Move by one control period, which ends at `now_s`, and return what happened, if anything."""

    @abstractmethod
    def touchdown(self, solids: Sequence[Block], low_m: float) -> bool:
        """Return whether a descent continues or ends well with the underside at `low_m`, in contact with `solids`."""

    def load(self, book: Accounts) -> None:  # noqa: B027 - most kinds carry nothing
        """Take over the goods on board from the city's accounts."""

    @property
    def alive(self) -> bool:
        """True if the aircraft still takes commands."""
        return self.phase in (FlightPhase.GROUNDED, FlightPhase.SPINUP, FlightPhase.FLYING)

    @property
    def flying(self) -> bool:
        """True if the aircraft is in the air and undamaged."""
        return self.phase in (FlightPhase.FLYING, FlightPhase.DESCENDING)

    @property
    def descends(self) -> bool:
        """True if contact with a surface below is a landing and no collision."""
        return self.phase is FlightPhase.DESCENDING

    @property
    def fastest_mps(self) -> float:
        """Upper bound of the speed in the next seconds, m/s."""
        return max(self.cruise_mps, math.hypot(*self.velocity)) + self.spurt_mps

    @property
    def progress(self) -> float:
        """Share of the way that is done, 0..1."""
        if not self._legs or self._length <= 0.0:
            return 0.0
        return min(max(1.0 - path_length(self.position, self._legs) / self._length, 0.0), 1.0)

    @property
    def middle(self) -> Vector:
        """Centre of the body, (east, north, up) metres."""
        x, y, z = self.position
        return x, y, z + self._middle_m

    def finish(self) -> bool:
        """End the current task, and return whether its completion counts as an arrival."""
        self._legs = ()
        return self._arrives

    def strike(self, what: str) -> FlightNotice:
        """End the flight with a collision and begin the fall."""
        notice = FlightNotice(COLLIDED, what, math.hypot(*self.velocity))
        self.phase, self.velocity = FlightPhase.FALLING, (0.0, 0.0, 0.0)
        return notice

    def state(self, remainder_s: float) -> BodyState:
        """Return the state of the aircraft `remainder_s` seconds after its last step."""
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
        """Return the position some seconds later at the present velocity."""
        return extrapolate(self.position, self.velocity, seconds)

    def _begin(self, *legs: Vector, arrives: bool) -> None:
        self._legs, self._length, self._arrives = legs, path_length(self.position, legs), arrives

    def _move(self, velocity: Vector, attitude: Vector) -> None:
        """Take over velocity and attitude at the end of a period, and integrate the position."""
        (x, y, z), (east, north, up), half = self.position, self.velocity, 0.5 * self.period_s
        self.position = (
            x + half * (east + velocity[0]),
            y + half * (north + velocity[1]),
            z + half * (up + velocity[2]),
        )
        self.velocity, self._attitude = velocity, attitude

    def _contact(self, now_s: float) -> FlightNotice | None:
        """Return the notice of a collision, if there is one."""
        x, y, z = self.position
        launched = math.hypot(x - self._launch[0], y - self._launch[1]) < self.launch_m
        near_start = launched and z > self._launch[2] - self.launch_drop_m
        if near_start and self.phase is FlightPhase.FLYING and not self.descends:
            return None
        for other in self.around:
            if other.touches(self.middle, self.radius_m, self.half_height_m, now_s):
                return self.strike(other.id)
        low, high = z + self._middle_m - self.half_height_m, z + self._middle_m + self.half_height_m
        if low > self._terrain.ceiling_m(x, y):
            return None
        solids = self._terrain.solids_at(x, y, low, high, self.radius_m)
        if self.descends and self.touchdown(solids, low):
            return None
        if solids:
            return self.strike(solids[0].id)
        if low > self._terrain.surface(x, y):
            return None
        return self.strike("ground" if self._terrain.water_level(x, y) is None else "water")

    def _fall(self) -> None:
        x, y, z = self.position
        floor = self._terrain.support(x, y, z)
        sink = min(-self.velocity[2] + GRAVITY * self.period_s, self.terminal_mps)
        self.position, self.velocity = (x, y, max(floor, z - sink * self.period_s)), (0.0, 0.0, -sink)
        if self.position[2] <= floor:
            self._rest()

    def _rest(self) -> None:
        self.phase, self.velocity = FlightPhase.DEAD, (0.0, 0.0, 0.0)
        self._attitude = (0.0, 0.0, self._attitude[2])


class AircraftEngine(FleetEngine):
    """The engine of all aircraft of one kind, at 50 Hz (JSBSim runs at 100 Hz) or with coarse motion.

    Two aircraft that touch both crash if at least one of them is in flight.
    """

    aircraft: ClassVar[type[Aircraft]]

    def build(self, spec: EngineSpec, city: City, seed: int) -> None:
        """Load one airframe for each aircraft at its declared place."""
        kind = self.aircraft_for(spec)
        self.step_s = kind.period_s
        self._watched_steps = round(_WATCHED_S / kind.period_s)
        terrain = Terrain(city)
        self._schedule = spec.schedule
        self._neighbours = Neighbours(spec.instance)
        weather = self._schedule.weather(0.0)
        self._fleet = {entity.id: kind(entity, terrain, weather, city.origin, seed) for entity in spec.owned()}
        self._pairs: list[tuple[Aircraft, Aircraft]] = []

    def aircraft_for(self, spec: EngineSpec) -> type[Aircraft]:
        """Return the class of the aircraft of an episode."""
        return self.aircraft

    def start(self, command: Command) -> None:
        """Begin a command. Raises `Refusal` with `dead`, `battery` or `fuel`, or with a reason of the aircraft."""
        aircraft = self._fleet[command.resource]
        if not aircraft.alive:
            if aircraft.empty:
                raise Refusal(aircraft.energy, _exhausted(aircraft))
            raise Refusal(DEAD, f"`{aircraft.id}` has crashed")
        aircraft.start(command)

    def look(self, mirrors: Sequence[BodyState]) -> None:
        """Take over the mirrors: the bodies near each aircraft, and the goods on board."""
        self._neighbours.look(mirrors, self.clock.time_s)
        book = booked(mirrors)
        for aircraft in self._fleet.values():
            aircraft.load(book)
            flying, radius = aircraft.flying, aircraft.radius_m
            aircraft.around = self._neighbours.near(aircraft.middle, aircraft.fastest_mps, radius) if flying else ()

    def step(self) -> None:
        """Move every aircraft by one control period."""
        now = self.clock.now_s
        weather = self._schedule.weather(now - self.step_s)
        for aircraft in self._fleet.values():
            notice = aircraft.step(weather, now)
            if notice is not None:
                self._report(aircraft, notice)
        if self.clock.done % self._watched_steps == 1:
            self._pairs = self._meeting()
        if self._pairs:
            self._collide()

    def states(self) -> Iterable[BodyState]:
        """Return the states of all aircraft."""
        return (aircraft.state(self.clock.remainder_s) for aircraft in self._fleet.values())

    def progress(self) -> Mapping[str, float]:
        """Return the share of the way that each aircraft has done, by id."""
        return {aircraft.id: aircraft.progress for aircraft in self._fleet.values()}

    def _meeting(self) -> list[tuple[Aircraft, Aircraft]]:
        """Return the pairs of solid aircraft that may touch before the next search."""
        solid = [aircraft for aircraft in self._fleet.values() if aircraft.solid]
        ahead_s = self._watched_steps * self.step_s
        reaches = (
            math.hypot(aircraft.radius_m, aircraft.half_height_m) + ahead_s * aircraft.fastest_mps for aircraft in solid
        )
        close = close_pairs([aircraft.middle for aircraft in solid], 2.0 * max(reaches, default=0.0))
        return [(solid[first], solid[second]) for first, second in close]

    def _collide(self) -> None:
        """Crash both aircraft of each pair that touches with one in flight; each aircraft is reported once."""
        whole = {aircraft.id for pair in self._pairs for aircraft in pair if aircraft.alive or aircraft.flying}
        for first, second in self._pairs:
            whole_pair = first.id in whole and second.id in whole
            if whole_pair and (first.flying or second.flying) and _touch(first, second):
                self._report(first, first.strike(second.id))
                self._report(second, second.strike(first.id))

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


def _touch(first: Aircraft, second: Aircraft) -> bool:
    """Return whether the upright cylinders of two aircraft touch."""
    (x, y, z), (east, north, up) = first.middle, second.middle
    if abs(z - up) >= first.half_height_m + second.half_height_m:
        return False
    return math.hypot(x - east, y - north) < first.radius_m + second.radius_m


def path_length(start: Vector, legs: Sequence[Vector]) -> float:
    """Return the length of the way from `start` through all `legs`, metres."""
    return total(math.dist(a, b) for a, b in zip((start, *legs), legs, strict=False))


def _exhausted(aircraft: Aircraft) -> str:
    if aircraft.energy == "battery":
        return f"the battery of `{aircraft.id}` is empty"
    return f"`{aircraft.id}` has no fuel left"
