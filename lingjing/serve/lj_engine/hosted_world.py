"""A world of our engines for a foreign backend: built from its `resetScenario`, moved by its commands."""

from __future__ import annotations

import json
import math
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from msgspec.structs import replace

from lingjing.engines.remote.messages import Document
from lingjing.engines.remote.poses import centimetres, engine_of
from lingjing.kernel.cities import CityBuilder
from lingjing.kernel.world.contract import StoredFrame
from lingjing.kernel.world.inline import InlineWorld
from lingjing.mission.instance import Clock, Datum, Entity, Vector
from lingjing.mission.instantiate import instantiate
from lingjing.plugins.engine import CaptureRequest
from lingjing.plugins.host import PluginHost
from lingjing.trace.records import GROUNDED, REFUSED, BodyState, Command

REACHED_M = 5.0
"""A hidden place counts as reached within this distance along the ground, metres: that of the template `goals`."""
CLIMB_M = 10.0
"""Height of a take-off that a destination implies, metres: that of the multirotor engine."""
_SENDER = "backend"

Step = tuple[str, Mapping[str, Datum]]
"""A verb with its arguments."""


@dataclass
class _Order:
    """The commands that one body carries out one after another."""

    steps: list[Step]
    done: Callable[[bool, str], None]
    """Called at the end with the success and the reason."""
    command: str = ""
    """The id of the command that runs; "" before the first."""


@dataclass
class HostedWorld:
    """The world of one scenario."""

    scenario: Document
    task_id: str
    host: PluginHost
    seed: int = 0
    reached: set[str] = field(default_factory=set)
    """The targets that a body has come to."""

    def __post_init__(self) -> None:
        """Build the world. Raises the errors of missions and of engines."""
        from lingjing.dsl.loading.load import load_mission

        document = {"commandType": "resetScenario", "taskId": self.task_id, "scenario": self.scenario}
        with tempfile.TemporaryDirectory(prefix="lingjing-") as folder:
            path = Path(folder) / "scenario.json"
            path.write_text(json.dumps(document), encoding="utf-8")
            mission = load_mission(path)
        drawn = instantiate(mission, seed=self.seed)
        clock = Clock(tick_s=drawn.clock.sync_s, sync_s=drawn.clock.sync_s)
        self.instance, city = CityBuilder(self.host).place(replace(drawn, clock=clock), imported=True)
        self._world = InlineWorld(self.host)
        self._states = {state.id: state for state in self._world.reset(self.instance, city).snapshots[-1].states}
        self.assets = tuple(entity for entity in self.instance.entities if entity.role == "asset")
        self.targets = tuple(entity for entity in self.instance.entities if entity.role == "target")
        written = {entity.id: entity.position for entity in drawn.entities}
        self._moved = {entity.id: _difference(written[entity.id], entity.position) for entity in self.targets}
        self.tick = 0
        self._orders: dict[str, _Order] = {}
        self._sent = 0

    def close(self) -> None:
        """End the engines."""
        self._world.close()

    @property
    def time_s(self) -> float:
        """Mission time, seconds."""
        return self.tick * self.instance.clock.tick_s

    @property
    def busy(self) -> bool:
        """True while a body carries out an order."""
        return bool(self._orders)

    def entity(self, name: str) -> Entity | None:
        """Return the asset with this code or name."""
        folded = _fold(name)
        named = (e for e in self.assets if folded in (_fold(e.id), _fold(e.label) if e.label else None))
        return next(named, None)

    def state(self, entity: str) -> BodyState:
        """Return the present state of a body."""
        return self._states[entity]

    def pose(self, entity: str) -> dict[str, float]:
        """Return the pose of a body as messages hold it: centimetres, Unreal's yaw."""
        state = self._states[entity]
        place = {name.lower(): value for name, value in centimetres(self._places(entity)[-1]).items()}
        return {**place, "yaw": (state.heading_deg - 90.0 + 180.0) % 360.0 - 180.0}

    def order(self, entity: Entity, steps: Sequence[Step], done: Callable[[bool, str], None]) -> None:
        """Give a body commands to carry out; an earlier order ends without success."""
        earlier = self._orders.pop(entity.id, None)
        if earlier is not None:
            if earlier.command:
                steps = [("stop", {}), *steps] if steps[:1] != [("stop", {})] else steps
            earlier.done(False, "another command took its place")
        self._orders[entity.id] = _Order(list(steps), done)

    def approach(self, entity: Entity, east: float, north: float, up: float | None = None) -> list[Step]:
        """Return the commands that bring a body to a place in metres."""
        state = self._states[entity.id]
        kind = engine_of(entity)
        if kind in ("multirotor", "plane"):
            height = state.position[2] + (CLIMB_M if state.status == GROUNDED else 0.0) if up is None else up
            return [("setDestination", {"x": east, "y": north, "z": height})]
        if kind == "vessel":
            return [("moveTo", {"x": east, "y": north})]
        if kind == "road":
            return [("setDestination", {"x": east, "y": north})]
        if kind == "quadruped":
            return self._walk(state, east, north)
        return []

    def advance(self) -> None:
        """Advance by one macro-step, with the next commands of all orders."""
        commands = [self._command(name, order) for name, order in self._orders.items() if not order.command]
        sent = [command for command in commands if command is not None]
        self.tick += 1
        boundary = self._world.step(self.tick, sent)
        self._states = {state.id: state for state in boundary.snapshots[-1].states}
        for receipt in (*boundary.admissions, *boundary.receipts):
            order = self._orders.get(receipt.resource)
            if order is None or receipt.request != order.command:
                continue
            if receipt.status in REFUSED:
                self._end(receipt.resource, order, False, receipt.detail or receipt.reason)
            elif receipt.status == "completed":
                order.command = ""
                if not order.steps:
                    self._end(receipt.resource, order, True, "")
        for name in boundary.missing:
            for resource, order in tuple(self._orders.items()):
                if order.command == name:
                    self._end(resource, order, False, "the engine gave no receipt")
        self._mark_reached()

    def photograph(self, entity: Entity, camera: str, frame: str) -> StoredFrame | None:
        """Return a picture; None if none could be drawn."""
        request = CaptureRequest(frame=frame, entity=entity.id, camera=camera, tick=self.tick, time_s=self.time_s)
        states = [self._states[each.id] for each in self.instance.entities]
        answer = self._world.capture(self.tick, [request], states)[0]
        return answer if isinstance(answer, StoredFrame) else None

    def _walk(self, state: BodyState, east: float, north: float) -> list[Step]:
        way = east - state.position[0], north - state.position[1]
        turn = (math.degrees(math.atan2(way[0], way[1])) - state.heading_deg + 180.0) % 360.0 - 180.0
        steps: list[Step] = []
        if abs(turn) > 1.0:
            steps.append(("right" if turn > 0.0 else "left", {"angle": abs(turn)}))
        return [*steps, ("forward", {"distance": math.hypot(*way)})]

    def _command(self, entity: str, order: _Order) -> Command | None:
        if not order.steps:
            return None
        verb, arguments = order.steps.pop(0)
        self._sent += 1
        order.command = f"c{self.tick}-{self._sent}"
        return Command(
            id=order.command, tick=self.tick, sender=_SENDER, resource=entity, verb=verb, arguments=dict(arguments)
        )

    def _end(self, resource: str, order: _Order, success: bool, reason: str) -> None:
        del self._orders[resource]
        order.done(success, reason)

    def _mark_reached(self) -> None:
        for target in self.targets:
            if target.id in self.reached:
                continue
            bodies = [self._states[asset.id].position for asset in self.assets]
            if any(_plan_distance(body, place) <= REACHED_M for body in bodies for place in self._places(target.id)):
                self.reached.add(target.id)

    def _places(self, entity: str) -> tuple[Vector, ...]:
        """Return the place of a body in the city, and last that in the document, metres.

        They differ for a target that was put on the city: a fire on the nearest facade. The backend knows the
        document's place, and cameras show the city's.
        """
        here = self._states[entity].position
        moved = self._moved.get(entity, (0.0, 0.0, 0.0))
        return (here, (here[0] + moved[0], here[1] + moved[1], here[2] + moved[2])) if any(moved) else (here,)


def _difference(first: Vector, second: Vector) -> Vector:
    return first[0] - second[0], first[1] - second[1], first[2] - second[2]


def _plan_distance(here: Vector, there: Vector) -> float:
    return math.hypot(here[0] - there[0], here[1] - there[1])


def _fold(name: str) -> str:
    return "".join(letter for letter in name if letter.isalnum()).casefold()
