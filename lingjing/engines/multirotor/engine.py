"""The multirotor engine: all vehicles of an episode behind the five-method contract."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from lingjing.engines.aloft import Notice, collide
from lingjing.engines.multirotor.control import PERIOD_S
from lingjing.engines.multirotor.drone import RADIUS_M, Drone
from lingjing.engines.multirotor.verbs import plan
from lingjing.mission.schedule import Schedule
from lingjing.plugins.engine import EngineSpec
from lingjing.plugins.fleet import FleetEngine
from lingjing.plugins.neighbours import Neighbours
from lingjing.plugins.requests import STOP, Refusal
from lingjing.scene.city import City
from lingjing.scene.terrain import Terrain
from lingjing.trace.records import BodyState, Command


class MultirotorEngine(FleetEngine):
    """Steps every vehicle at 50 Hz (100 Hz inside JSBSim); vehicles that touch each other both crash."""

    step_s = PERIOD_S

    def build(self, spec: EngineSpec, city: City, seed: int) -> None:
        """Load one airframe a vehicle and stand them at their start."""
        self._terrain = Terrain(city)
        self._schedule = Schedule(spec.instance)
        self._neighbours = Neighbours(spec.instance)
        weather = self._schedule.weather(0.0)
        self._drones = {entity.id: Drone(entity, self._terrain, weather, city.origin, seed) for entity in spec.owned()}

    def start(self, command: Command) -> None:
        """Begin a task, or `Refusal`: `unknown_resource`, `battery`, `dead`, `overloaded` and those of `plan`."""
        drone = self._drones.get(command.resource)
        if drone is None:
            raise Refusal("unknown_resource", f"`{command.resource}` is no vehicle of `{self.name}`")
        if not drone.alive:
            if drone.battery.empty:
                raise Refusal("battery", f"the battery of `{drone.id}` is empty")
            raise Refusal("dead", f"`{drone.id}` has crashed")
        if command.verb == STOP:
            drone.brake()
            return
        task = plan(command, drone.situation, self._terrain)
        if drone.overloaded:
            raise Refusal("overloaded", f"`{drone.id}` cannot lift {drone.stock.load_kg:g} kg")
        drone.begin(task)

    def look(self, mirrors: Sequence[BodyState]) -> None:
        """Who is near each vehicle, and what the book says is on board."""
        self._neighbours.look(mirrors, self.clock.time_s)
        for drone in self._drones.values():
            drone.stock.read(mirrors)
            drone.carry()
            drone.around = self._neighbours.near(drone.position, drone.reach_mps) if drone.flying else ()

    def step(self) -> None:
        """One control period of every vehicle."""
        now = self.clock.now_s
        weather = self._schedule.weather(now - self.step_s)
        for drone in self._drones.values():
            notice = drone.step(weather, now)
            if notice is not None:
                self._report(drone, notice)
        collide(self._drones.values(), 2.0 * RADIUS_M, self._report)

    def states(self) -> Iterable[BodyState]:
        """Every vehicle."""
        return (drone.state(self.clock.remainder_s) for drone in self._drones.values())

    def progress(self) -> Mapping[str, float]:
        """How much of each task's way is behind."""
        return {drone.id: drone.progress for drone in self._drones.values()}

    def close(self) -> None:
        """Let go of the airframes."""
        self._drones = {}

    def _report(self, drone: Drone, notice: Notice) -> None:
        now, task = self.clock.now_s, drone.task
        drone.task = None
        if notice.kind == "done":
            self.requests.complete(drone.id, now)
            if task is not None and task.arrives:
                self.emit("arrived", drone.id)
        elif notice.kind == "collided":
            self.requests.fail(drone.id, now, "collided", f"`{drone.id}` hit `{notice.what}`")
            self.emit("collided", drone.id, notice.what, speed_mps=notice.speed_mps)
        else:
            self.requests.fail(drone.id, now, "battery", f"the battery of `{drone.id}` is empty")
            self.emit(notice.kind, drone.id)
