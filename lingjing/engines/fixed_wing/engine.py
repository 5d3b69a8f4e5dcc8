"""The `plane` engine: all fixed-wing aircraft of an episode behind the five-method contract."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from lingjing.engines.aloft import Notice, collide
from lingjing.engines.fixed_wing.aeroplane import REACH_M, Aeroplane
from lingjing.engines.fixed_wing.control import PERIOD_S
from lingjing.mission.schedule import Schedule
from lingjing.plugins.engine import EngineSpec
from lingjing.plugins.fleet import FleetEngine
from lingjing.plugins.neighbours import Neighbours
from lingjing.plugins.requests import STOP, Refusal, number
from lingjing.scene.city import City
from lingjing.scene.terrain import Terrain
from lingjing.trace.records import BodyState, Command


class PlaneEngine(FleetEngine):
    """Steps every aircraft at 50 Hz (100 Hz inside JSBSim); two that touch each other both crash."""

    step_s = PERIOD_S

    def build(self, spec: EngineSpec, city: City, seed: int) -> None:
        """Load one airframe an aircraft, flying or parked."""
        self._terrain = Terrain(city)
        self._schedule = Schedule(spec.instance)
        self._neighbours = Neighbours(spec.instance)
        weather = self._schedule.weather(0.0)
        self._fleet = {
            entity.id: Aeroplane(entity, self._terrain, weather, city.origin, seed) for entity in spec.owned()
        }

    def start(self, command: Command) -> None:
        """Begin a flight, or `Refusal`: `unknown_resource`, `dead`, `fuel`, `grounded`, `unknown_verb`,
        `bad_argument`, `unreachable`."""
        aircraft = self._fleet.get(command.resource)
        if aircraft is None:
            raise Refusal("unknown_resource", f"`{command.resource}` is no aircraft of `{self.name}`")
        if not aircraft.alive:
            if aircraft.fuel_kg <= 0.0:
                raise Refusal("fuel", f"`{aircraft.id}` has no fuel left")
            raise Refusal("dead", f"`{aircraft.id}` has crashed")
        if command.verb == STOP:
            aircraft.hold()
        elif command.verb == "setDestination":
            aircraft.head_for((number(command, "x"), number(command, "y"), number(command, "z")))
        else:
            raise Refusal("unknown_verb", f"an aeroplane has no verb `{command.verb}`")

    def look(self, mirrors: Sequence[BodyState]) -> None:
        """Who is near each aircraft."""
        self._neighbours.look(mirrors, self.clock.time_s)
        for aircraft in self._fleet.values():
            near = self._neighbours.near(aircraft.position, aircraft.reach_mps) if aircraft.flying else ()
            aircraft.around = near

    def step(self) -> None:
        """One control period of every aircraft."""
        now = self.clock.now_s
        weather = self._schedule.weather(now - self.step_s)
        for aircraft in self._fleet.values():
            self._finish_hold(aircraft, now)
            notice = aircraft.step(weather, now)
            if notice is not None:
                self._report(aircraft, notice)
        collide(self._fleet.values(), 2.0 * REACH_M, self._report)

    def states(self) -> Iterable[BodyState]:
        """Every aircraft."""
        return (aircraft.state(self.clock.remainder_s) for aircraft in self._fleet.values())

    def progress(self) -> Mapping[str, float]:
        """How much of each way is behind."""
        return {aircraft.id: aircraft.progress for aircraft in self._fleet.values()}

    def close(self) -> None:
        """Let go of the airframes."""
        self._fleet = {}

    def _finish_hold(self, aircraft: Aeroplane, now: float) -> None:
        pending = self.requests.pending(aircraft.id)
        if pending is not None and pending.verb == STOP:
            self.requests.complete(aircraft.id, now)

    def _report(self, aircraft: Aeroplane, notice: Notice) -> None:
        now = self.clock.now_s
        aircraft.goal = None
        if notice.kind == "done":
            self.requests.complete(aircraft.id, now)
            self.emit("arrived", aircraft.id)
        elif notice.kind == "collided":
            self.requests.fail(aircraft.id, now, "collided", f"`{aircraft.id}` hit `{notice.what}`")
            self.emit("collided", aircraft.id, notice.what, speed_mps=notice.speed_mps)
        else:
            self.requests.fail(aircraft.id, now, "fuel", f"`{aircraft.id}` has no fuel left")
            self.emit(notice.kind, aircraft.id)
