"""The quadruped engine: all robot dogs of an episode behind the engine contract.

The engine holds one model of the present dogs. It builds a new model when a dog comes near shapes that the model does
not hold, and when dogs appear or vanish. While every dog stands and nothing comes near, time passes without physics.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

from lingjing.engines.quadruped.assets import Assets, locate
from lingjing.engines.quadruped.city_shapes import CityShapes
from lingjing.engines.quadruped.dog import BLOCKED, DONE, UNREACHABLE, Dog, DogNotice
from lingjing.engines.quadruped.dog_model import DogMemory, DogModel, DogState, StandingPlace
from lingjing.engines.quadruped.gait import PERIOD_S
from lingjing.engines.quadruped.ground_ahead import GroundAhead
from lingjing.engines.quadruped.moving_boxes import POOL, MirroredBodies
from lingjing.engines.quadruped.physics import MovingBox, Touch
from lingjing.engines.quadruped.wind_load import WindLoad
from lingjing.mission.instance import Vector
from lingjing.mission.vocabulary import BATTERY_EMPTY, COLLIDED, DORMANT
from lingjing.plugins.engine import EngineSpec
from lingjing.plugins.fleet import FleetEngine
from lingjing.plugins.requests import Refusal
from lingjing.plugins.stock import booked
from lingjing.scene.city import City
from lingjing.scene.outlines import compass
from lingjing.scene.terrain import Terrain
from lingjing.trace.records import BodyState, Command

_ZONE_PERIODS = 25
"""Control periods between two checks whether the model holds all shapes near the dogs (chosen)."""

_ALERT_M = 3.0
"""Distance of a moving thing from which physics must run, metres (chosen)."""

_CLEAR_M = 0.6
"""Distance from moving things at which a fallen dog may rise, metres (chosen)."""


_HELD_N = 20.0
"""Force of the wind below which a standing dog does not move, newtons: a sixth of the friction of its feet."""


class QuadrupedEngine(FleetEngine):
    """The engine of all robot dogs, at 50 Hz (200 Hz in MuJoCo)."""

    step_s = PERIOD_S

    def build(self, spec: EngineSpec, city: City, seed: int) -> None:
        """Find the model and place the dogs. Only gusts draw random numbers."""
        self._assets: Assets = locate()
        self._schedule = spec.schedule
        self._terrain = Terrain(city)
        self._around = CityShapes(city)
        self._lookout = MirroredBodies(spec.instance, spec.owns)
        self._entities = {entity.id: entity for entity in spec.owned()}
        self._dogs = {entity.id: Dog(entity) for entity in spec.owned()}
        self._wind = WindLoad(seed)
        self._blown_n = 0.0
        self._movers: tuple[MovingBox, ...] = ()
        self._model: DogModel | None = None
        self._states_of_dogs: list[DogState] = []
        self._update_members(0.0)

    def start(self, command: Command) -> None:
        """Begin a command; raises `Refusal` if it cannot be carried out."""
        dog = self._dogs[command.resource]
        if dog.row < 0 or self._model is None:
            raise Refusal("dormant", f"`{dog.id}` is not there yet")
        dog.start(command, self._states_of_dogs[dog.row], self._model, self._ground)

    def look(self, mirrors: Sequence[BodyState]) -> None:
        """Take over the mirrors: moving bodies near the dogs, and the goods on board. Update the set of present
        dogs."""
        self._update_members(self.clock.time_s)
        book = booked(mirrors)
        for dog in self._dogs.values():
            dog.stock.read(book)
        if self._model is not None:
            self._set_loads(self._model)
            self._movers = self._lookout.nearest(mirrors, [here.position for here in self._states_of_dogs])
            self._model.set_movers(self._movers)

    def step(self) -> None:
        """Advance all dogs by one control period."""
        model = self._model
        if model is None:
            return
        members = [self._dogs[name] for name in model.ids]
        self._blow(model)
        still = model.quiet and self._blown_n < _HELD_N
        if still and all(dog.idle for dog in members) and model.clearances().min() > _ALERT_M:
            model.pass_time()
            for dog in members:
                self._report(dog, dog.rest(self._states_of_dogs[dog.row].watts))
            return
        model.step()
        self._states_of_dogs = model.dog_states()
        self._decide(model, members)
        if self.clock.done % _ZONE_PERIODS == 0 and not self._around.suffices(self._points()):
            self._rebuild([(dog.id, model.memory_of(dog.row)) for dog in members])

    def states(self) -> Iterable[BodyState]:
        """Return the states of all dogs; absent ones keep their declared place."""
        for dog in self._dogs.values():
            if dog.row < 0 or self._model is None or not self._schedule.present(dog.id, self.clock.time_s):
                entity = self._entities[dog.id]
                yield BodyState(
                    id=dog.id,
                    position=entity.position,
                    heading_deg=compass(entity.heading_deg),
                    status=DORMANT,
                    resources=dog.resources,
                )
            else:
                yield dog.state(
                    self._states_of_dogs[dog.row], self._model.model_angles(dog.row), self.clock.remainder_s
                )

    def progress(self) -> Mapping[str, float]:
        """Return the share of the request that each dog has done, by id."""
        return {dog.id: dog.progress for dog in self._dogs.values()}

    def close(self) -> None:
        """Drop the dogs and their model."""
        self._dogs, self._model = {}, None

    def _blow(self, model: DogModel) -> None:
        """Let the wind act on the dogs if the weather has effects."""
        weather = self._schedule.weather(self.clock.now_s - self.step_s)
        if not weather.effects:
            if self._blown_n > 0.0:
                self._push(model, [(0.0, 0.0)] * len(model.ids))
            return
        self._push(model, self._wind.forces(zip(model.ids, self._states_of_dogs, strict=True), weather))

    def _push(self, model: DogModel, forces: Sequence[tuple[float, float]]) -> None:
        for row, (east, north) in enumerate(forces):
            model.push(row, east, north)
        self._blown_n = max((math.hypot(*force) for force in forces), default=0.0)

    def _decide(self, model: DogModel, members: Sequence[Dog]) -> None:
        touched: dict[int, list[Touch]] = {}
        for touch in model.touches():
            touched.setdefault(touch.dog, []).append(touch)
        speeds: dict[str, Vector] = {mover.thing: mover.velocity for mover in self._movers}
        speeds.update((dog.id, self._states_of_dogs[dog.row].velocity) for dog in members if touched)
        for dog in members:
            here = self._states_of_dogs[dog.row]
            for notice in dog.step(here, touched.get(dog.row, ()), speeds, model, self._ground):
                self._report(dog, notice)
            if dog.rested and model.clearances()[dog.row] > _CLEAR_M:
                dog.rise(here, model)
                self._states_of_dogs[dog.row] = model.dog_states()[dog.row]

    def _report(self, dog: Dog, notice: DogNotice | None) -> None:
        if notice is None:
            return
        now = self.clock.now_s
        if notice.kind == DONE:
            self.requests.complete(dog.id, now)
        elif notice.kind == COLLIDED:
            self.emit(COLLIDED, dog.id, notice.what, speed_mps=notice.speed_mps)
        elif notice.kind == BLOCKED:
            what = f"`{notice.what}` is in the way" if notice.what else "it comes no further"
            self.requests.fail(dog.id, now, BLOCKED, f"`{dog.id}` stopped: {what}")
        elif notice.kind == UNREACHABLE:
            self.requests.fail(dog.id, now, UNREACHABLE, f"`{dog.id}` stopped: {notice.what} ahead")
        elif notice.kind == BATTERY_EMPTY:
            self.requests.fail(dog.id, now, "battery", f"the battery of `{dog.id}` is empty")
            self.emit(BATTERY_EMPTY, dog.id)
        else:
            self.requests.fail(dog.id, now, notice.kind, f"`{dog.id}` {notice.kind}")
            self.emit(notice.kind, dog.id)

    def _update_members(self, time_s: float) -> None:
        """Build a new model if the set of dogs that are present at a time has changed."""
        there = [name for name in self._dogs if self._schedule.present(name, time_s)]
        model = self._model
        if (model is not None and list(model.ids) == there) or (model is None and not there):
            return
        old = {name: model.memory_of(row) for row, name in enumerate(model.ids)} if model is not None else {}
        self._rebuild([(name, old.get(name) or self._spot(name)) for name in there])

    def _rebuild(self, members: Sequence[tuple[str, DogMemory | StandingPlace]]) -> None:
        """Build a new model for these dogs."""
        for dog in self._dogs.values():
            dog.row = -1
        if not members:
            self._model, self._states_of_dogs, self._movers = None, [], ()
            return
        elapsed_s = self._model.driven_s if self._model is not None else 0.0
        places = [state.place if isinstance(state, DogMemory) else state.position for _, state in members]
        self._model = DogModel(self._assets, members, self._around.load(places), self._around.ground_m, POOL)
        self._ground = GroundAhead(self._terrain, self._model)
        self._model.set_movers(self._movers, elapsed_s)
        self._states_of_dogs = self._model.dog_states()
        for row, (name, _) in enumerate(members):
            self._dogs[name].row = row
        self._set_loads(self._model)

    def _set_loads(self, model: DogModel) -> None:
        for row, name in enumerate(model.ids):
            model.set_load(row, self._dogs[name].stock.load_kg)

    def _spot(self, name: str) -> StandingPlace:
        entity = self._entities[name]
        return StandingPlace(entity.position, math.radians(90.0 - entity.heading_deg))

    def _points(self) -> list[tuple[float, float]]:
        return [(here.position[0], here.position[1]) for here in self._states_of_dogs]
