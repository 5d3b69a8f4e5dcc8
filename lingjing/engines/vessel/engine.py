"""The vessel engine: all vessels of an episode behind the engine contract."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from lingjing.engines.bodies import is_coarse
from lingjing.engines.vessel.boat import Boat
from lingjing.engines.vessel.hull import COARSE_STEP_S, STEP_S
from lingjing.mission.vocabulary import ARRIVED, COLLIDED
from lingjing.plugins.engine import EngineSpec
from lingjing.plugins.fleet import FleetEngine
from lingjing.plugins.requests import STOP, Refusal, number
from lingjing.plugins.stock import booked
from lingjing.scene.city import City
from lingjing.scene.terrain import Terrain
from lingjing.trace.records import AGROUND, BodyState, Command

SHORE = "shore"
"""Name of the land or structure that a boat runs onto, in events of collisions."""


class VesselEngine(FleetEngine):
    """The engine of all vessels, at 10 Hz (2 Hz with coarse motion).

    Vessels do not detect each other. Only gusts draw random numbers.
    """

    def build(self, spec: EngineSpec, city: City, seed: int) -> None:
        """Place the vessels on the water."""
        self.step_s = COARSE_STEP_S if is_coarse(spec) else STEP_S
        terrain = Terrain(city)
        self._schedule = spec.schedule
        self._shores = bool(spec.instance.scene.options.get("collisions"))
        weather = self._schedule.weather(0.0)
        self._boats = {entity.id: Boat(entity, terrain, weather, seed, self.step_s) for entity in spec.owned()}

    def start(self, command: Command) -> None:
        """Begin a voyage. Raises `Refusal` with `aground`, `unknown_verb`, `bad_argument` or `unreachable`."""
        boat = self._boats[command.resource]
        if boat.aground:
            raise Refusal(AGROUND, f"`{boat.id}` is aground")
        if command.verb == STOP:
            boat.halt()
        elif command.verb == "moveTo":
            boat.head_for((number(command, "x"), number(command, "y")))
        else:
            raise Refusal("unknown_verb", f"a vessel has no verb `{command.verb}`")

    def look(self, mirrors: Sequence[BodyState]) -> None:
        """Take over the goods on board from the city's accounts."""
        book = booked(mirrors)
        for boat in self._boats.values():
            boat.stock.read(book)
            boat.update_load()

    def step(self) -> None:
        """Move every vessel by one step."""
        weather = self._schedule.weather(self.clock.now_s - self.step_s)
        for boat in self._boats.values():
            boat.set_weather(weather)
            boat.step()
            self._report(boat)

    def states(self) -> Iterable[BodyState]:
        """Return the states of all vessels in the weather of the present time."""
        time_s = self.clock.time_s
        weather = self._schedule.weather(time_s)
        for boat in self._boats.values():
            boat.set_weather(weather)
            yield boat.state(time_s, self.clock.remainder_s)

    def progress(self) -> Mapping[str, float]:
        """Return the share of the way that each vessel has done, by id."""
        return {boat.id: boat.progress for boat in self._boats.values()}

    def _report(self, boat: Boat) -> None:
        now = self.clock.now_s
        if boat.aground:
            self.requests.fail(boat.id, now, AGROUND, f"`{boat.id}` ran aground")
            if self._shores and boat.struck_mps is not None:
                self.emit(COLLIDED, boat.id, SHORE, speed_mps=boat.struck_mps)
                boat.struck_mps = None
        elif boat.arrived():
            self.requests.complete(boat.id, now)
            self.emit(ARRIVED, boat.id)
        elif boat.stopped():
            self.requests.complete(boat.id, now)
        elif boat.goal is not None and boat.land_ahead():
            boat.halt()
            self.requests.fail(boat.id, now, "unreachable", f"`{boat.id}` stopped: there is land ahead")
