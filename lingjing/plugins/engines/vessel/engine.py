"""The vessel engine: all boats of an episode behind the five-method contract."""

from __future__ import annotations

from collections.abc import Sequence

from lingjing.plugins.engine import Boundary, CaptureRequest, EngineSpec, Frame
from lingjing.plugins.engines.clock import Clock
from lingjing.plugins.engines.plane import Terrain
from lingjing.plugins.engines.requests import STOP, Refusal, Requests, number
from lingjing.plugins.engines.vessel.boat import Boat
from lingjing.plugins.engines.vessel.hull import STEP_S
from lingjing.scene.city import City
from lingjing.trace.records import BodyState, Command, Receipt, TaskEvent


class VesselEngine:
    """Steps every boat at 10 Hz; boats do not see each other."""

    def reset(self, spec: EngineSpec, city: City, seed: int) -> Boundary:
        """Put the boats on the water. Nothing here is drawn at random, so the seed is not needed."""
        self._name = spec.engine
        self._tick_s = spec.instance.clock.tick_s
        self._clock = Clock(STEP_S)
        self._requests = Requests(spec.engine)
        self._events: list[TaskEvent] = []
        terrain = Terrain(city)
        self._boats = {entity.id: Boat(entity, terrain, spec.instance.weather) for entity in spec.owned()}
        return self._boundary()

    def submit(self, commands: Sequence[Command]) -> tuple[Receipt, ...]:
        """Admit or reject each command; admitted ones start at once."""
        return tuple(self._requests.admit(command, self._clock.time_s, self._start) for command in commands)

    def advance(self, until: float, mirrors: Sequence[BodyState]) -> Boundary:
        """Sail to `until`; progress of what goes on is reported at decision boundaries."""
        for _ in range(self._clock.steps_until(until)):
            self._clock.done += 1
            for boat in self._boats.values():
                boat.step()
                self._report(boat)
        if self._clock.is_boundary(self._tick_s):
            for boat in self._boats.values():
                self._requests.run(boat.id, until, boat.progress)
        return self._boundary()

    def capture(self, requests: Sequence[CaptureRequest]) -> tuple[Frame, ...]:
        """No sensors here."""
        return ()

    def close(self) -> None:
        """Let go of the boats."""
        self._boats = {}

    def _start(self, command: Command) -> None:
        boat = self._boats.get(command.resource)
        if boat is None:
            raise Refusal("unknown_resource", f"`{command.resource}` is no vessel of `{self._name}`")
        if boat.aground:
            raise Refusal("aground", f"`{boat.id}` is aground")
        if command.verb == STOP:
            boat.halt()
        elif command.verb == "moveTo":
            boat.head_for((number(command, "x"), number(command, "y")))
        else:
            raise Refusal("unknown_verb", f"a vessel has no verb `{command.verb}`")

    def _report(self, boat: Boat) -> None:
        now = self._clock.now_s
        if boat.aground:
            self._requests.fail(boat.id, now, "aground", f"`{boat.id}` ran aground")
        elif boat.arrived():
            self._requests.complete(boat.id, now)
            self._events.append(TaskEvent(kind="arrived", entities=(boat.id,), time_s=now))
        elif boat.stopped():
            self._requests.complete(boat.id, now)
        elif boat.goal is not None and boat.land_ahead():
            boat.halt()
            self._requests.fail(boat.id, now, "unreachable", f"`{boat.id}` stopped: there is land ahead")

    def _boundary(self) -> Boundary:
        events, self._events = tuple(self._events), []
        time_s = self._clock.time_s
        return Boundary(
            engine=self._name,
            time_s=time_s,
            states=tuple(boat.state(time_s, self._clock.remainder_s) for boat in self._boats.values()),
            receipts=self._requests.drain(),
            events=events,
        )
