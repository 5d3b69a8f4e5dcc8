"""The multirotor engine: all vehicles of an episode behind the five-method contract."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

from lingjing.plugins.engine import Boundary, CaptureRequest, EngineSpec, Frame
from lingjing.plugins.engines.clock import Clock
from lingjing.plugins.engines.multirotor.control import PERIOD_S
from lingjing.plugins.engines.multirotor.drone import RADIUS_M, Drone, Notice
from lingjing.plugins.engines.multirotor.verbs import plan
from lingjing.plugins.engines.plane import Terrain
from lingjing.plugins.engines.requests import STOP, Refusal, Requests
from lingjing.scene.city import City
from lingjing.trace.records import BodyState, Command, Receipt, TaskEvent


class MultirotorEngine:
    """Steps every vehicle at 50 Hz (250 Hz inside JSBSim); vehicles that touch each other both crash."""

    def reset(self, spec: EngineSpec, city: City, seed: int) -> Boundary:
        """Load one airframe a vehicle and stand them at their start."""
        self._name = spec.engine
        self._tick_s = spec.instance.clock.tick_s
        self._terrain = Terrain(city)
        self._clock = Clock(PERIOD_S)
        self._requests = Requests(spec.engine)
        self._events: list[TaskEvent] = []
        self._drones = {
            entity.id: Drone(entity, self._terrain, spec.instance.weather, city.origin, seed) for entity in spec.owned()
        }
        return self._boundary()

    def submit(self, commands: Sequence[Command]) -> tuple[Receipt, ...]:
        """Admit or reject each command; admitted ones start at once."""
        return tuple(self._requests.admit(command, self._clock.time_s, self._start) for command in commands)

    def advance(self, until: float, mirrors: Sequence[BodyState]) -> Boundary:
        """Fly to `until`; progress of what goes on is reported at decision boundaries."""
        for _ in range(self._clock.steps_until(until)):
            self._clock.done += 1
            for drone in self._drones.values():
                notice = drone.step()
                if notice is not None:
                    self._report(drone, notice)
            self._collide()
        if self._clock.is_boundary(self._tick_s):
            for drone in self._drones.values():
                self._requests.run(drone.id, until, drone.progress)
        return self._boundary()

    def capture(self, requests: Sequence[CaptureRequest]) -> tuple[Frame, ...]:
        """No sensors here."""
        return ()

    def close(self) -> None:
        """Let go of the airframes."""
        self._drones = {}

    def _start(self, command: Command) -> None:
        drone = self._drones.get(command.resource)
        if drone is None:
            raise Refusal("unknown_resource", f"`{command.resource}` is no vehicle of `{self._name}`")
        if not drone.alive:
            if drone.battery.empty:
                raise Refusal("battery", f"the battery of `{drone.id}` is empty")
            raise Refusal("dead", f"`{drone.id}` has crashed")
        if command.verb == STOP:
            drone.brake()
        else:
            drone.begin(plan(command, drone.situation, self._terrain))

    def _collide(self) -> None:
        flying = [drone for drone in self._drones.values() if drone.flying]
        for one, other in itertools.combinations(flying, 2):
            if math.dist(one.position, other.position) < 2.0 * RADIUS_M and one.flying and other.flying:
                self._report(one, one.strike(other.id))
                self._report(other, other.strike(one.id))

    def _report(self, drone: Drone, notice: Notice) -> None:
        now, task = self._clock.now_s, drone.task
        drone.task = None
        if notice.kind == "done":
            self._requests.complete(drone.id, now)
            if task is not None and task.arrives:
                self._events.append(TaskEvent(kind="arrived", entities=(drone.id,), time_s=now))
        elif notice.kind == "collided":
            self._requests.fail(drone.id, now, "collided", f"`{drone.id}` hit `{notice.what}`")
            hit = {"speed_mps": notice.speed_mps}
            self._events.append(TaskEvent(kind="collided", entities=(drone.id, notice.what), time_s=now, values=hit))
        else:
            self._requests.fail(drone.id, now, "battery", f"the battery of `{drone.id}` is empty")
            self._events.append(TaskEvent(kind=notice.kind, entities=(drone.id,), time_s=now))

    def _boundary(self) -> Boundary:
        events, self._events = tuple(self._events), []
        return Boundary(
            engine=self._name,
            time_s=self._clock.time_s,
            states=tuple(drone.state(self._clock.remainder_s) for drone in self._drones.values()),
            receipts=self._requests.drain(),
            events=events,
        )
