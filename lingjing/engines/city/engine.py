"""The city engine behind the engine contract: targets, goods and radio links of an episode."""

from __future__ import annotations

import math
from collections.abc import Sequence

from lingjing.engines.bodies import extrapolate, is_coarse
from lingjing.engines.city.goods import Goods, check_exchange
from lingjing.engines.city.radio import Coverage
from lingjing.engines.city.target import CityTarget, Level, target_of
from lingjing.engines.city.target_body import COARSE_STEP_S, STEP_S, BodyMaker
from lingjing.mission.instance import InteractionSpec, Vector
from lingjing.mission.natures import PEOPLE
from lingjing.mission.vocabulary import DORMANT, UNLOCK
from lingjing.plugins.engine import Boundary, CaptureRequest, EngineSpec, Frame
from lingjing.plugins.requests import Refusal, Requests
from lingjing.plugins.step_clock import StepClock
from lingjing.scene.city import City
from lingjing.scene.terrain import Terrain
from lingjing.trace.records import DEAD, BodyState, Command, Receipt, TaskEvent

_IDLE = (DORMANT, DEAD)
"""Statuses of actors that take no part in interactions: absent bodies and wrecks."""


_Actor = tuple[str, Vector]
"""An actor: its id and position."""


class CityEngine:
    """The engine of all targets.

    Targets burn, leak, drift, wait and move by themselves at 10 Hz. Unlocked interactions are carried out at the end of
    each macro-step. Each decision boundary reports the pairs of assets without a radio link.
    """

    def reset(self, spec: EngineSpec, city: City, seed: int) -> Boundary:
        """Place the targets, fill the stocks and find the actors of each interaction."""
        instance = spec.instance
        self._name = spec.engine
        self._tick_s = instance.clock.tick_s
        step_s = COARSE_STEP_S if is_coarse(spec) else STEP_S
        self._clock = StepClock(step_s)
        self._requests = Requests(spec.engine)
        self._events: list[TaskEvent] = []
        self._names = frozenset(entity.id for entity in instance.entities)
        self._actors: dict[tuple[str, str], tuple[str, ...]] = {}
        self._schedule = spec.schedule
        self._weather = self._schedule.weather(0.0)
        self._book = Goods(instance)
        terrain = Terrain(city)
        maker = BodyMaker(instance, city, terrain, seed, step_s)
        self._targets = {
            entity.id: target_of(entity, maker.body(entity, self._weather), seed) for entity in spec.owned()
        }
        for target in self._targets.values():
            for interaction in target.possible.values():
                actors = instance.actors(interaction)
                check_exchange(target.entity, interaction, actors)
                self._actors[target.id, interaction.name] = tuple(actor.id for actor in actors)
        self._bodies: dict[str, tuple[Vector, BodyState]] = {}
        self._update_presence()
        self._coverage = Coverage(instance, terrain)
        self._unlinked = self._coverage.unlinked({e.id: e.position for e in instance.entities}, self._weather)
        return self._boundary()

    def submit(self, commands: Sequence[Command]) -> tuple[Receipt, ...]:
        """Accept the kernel's unlock commands. An unlock holds for the episode and completes with its admission."""
        return tuple(self._requests.answer(command, self._clock.time_s, self._unlock) for command in commands)

    def advance(self, until: float, mirrors: Sequence[BodyState]) -> Boundary:
        """Advance the targets to `until`, then carry out interactions with the actors within reach at that time."""
        elapsed = until - self._clock.time_s
        self._update_weather()
        self._set_values()
        self._look_around(mirrors)
        self._step(until)
        self._update_presence()
        self._bodies = {
            body.id: (extrapolate(body.position, body.velocity, elapsed), body)
            for body in mirrors
            if body.id in self._names
        }
        for target in self._targets.values():
            self._interact(target, elapsed)
        if self._clock.is_boundary(self._tick_s):
            places = {name: place for name, (place, _) in self._bodies.items()}
            radio = self._schedule.radio(until)
            self._unlinked = self._coverage.unlinked(places, self._schedule.weather(until), radio)
        return self._boundary()

    def capture(self, requests: Sequence[CaptureRequest]) -> tuple[Frame, ...]:
        """Return no frames: this engine has no sensors."""
        return ()

    def close(self) -> None:
        """Drop the targets."""
        self._targets = {}

    def _unlock(self, command: Command) -> None:
        target = self._targets.get(command.resource)
        if target is None:
            raise Refusal("unknown_resource", f"`{command.resource}` is no target of `{self._name}`")
        if not command.verb.startswith(UNLOCK):
            raise Refusal("unknown_verb", f"a target takes no command `{command.verb}`")
        if command.origin != "kernel":
            raise Refusal("no_authority", "only the kernel unlocks an interaction")
        name = command.verb.removeprefix(UNLOCK)
        if name not in target.possible:
            known = ", ".join(target.possible) or "none"
            raise Refusal("unknown_verb", f"`{target.id}` has no interaction `{name}` (it has: {known})")
        if name not in target.unlocked:
            target.unlocked.append(name)

    def _update_weather(self) -> None:
        """Take over the weather, which changes at decision boundaries."""
        weather = self._schedule.weather(self._clock.time_s)
        if weather != self._weather:
            self._weather = weather
            for target in self._targets.values():
                target.body.set_weather(weather)

    def _set_values(self) -> None:
        """Set the states and status words that events change at this boundary."""
        for change in self._schedule.values_set(self._clock.time_s):
            target = self._targets.get(change.entity)
            if target is None:
                continue
            if isinstance(change.value, str):
                target.word = change.value
                continue
            state = target.entity.state_of(change.field)
            if state is not None:
                self._book.put(target.id, state.name, change.value)
                target.set_amount(state.name, change.value)

    def _look_around(self, mirrors: Sequence[BodyState]) -> None:
        """Show each target with a behaviour the places of all present bodies at the beginning of the macro-step."""
        roaming = [target for target in self._targets.values() if target.entity.behaviour is not None]
        if not roaming:
            return
        places = {body.id: body.position for body in mirrors if body.status not in _IDLE}
        places |= {target.id: self._pose(target)[0] for target in self._targets.values() if target.present}
        for target in roaming:
            target.body.look(places)

    def _step(self, until: float) -> None:
        moving = [target for target in self._targets.values() if target.moves]
        for target in self._targets.values():
            if not target.moves:
                target.body.halt()
        for _ in range(self._clock.steps_until(until)):
            self._clock.done += 1
            for target in moving:
                target.body.step()
        for target in self._targets.values():
            if target.crowd is not None:
                count = target.crowd.count_at(self._book.amount(target.id, PEOPLE), until)
                self._book.put(target.id, PEOPLE, count)

    def _update_presence(self) -> None:
        for target in self._targets.values():
            target.set_present(self._schedule.present(target.id, self._clock.time_s))

    def _interact(self, target: CityTarget, elapsed_s: float) -> None:
        if not target.present:
            target.attended.clear()
            return
        for interaction in target.possible.values():
            open_now = interaction.name in target.unlocked and interaction.name not in target.done
            reached = self._in_reach(target, interaction) if open_now else []
            level = target.levels.get(interaction.name)
            if level is not None:
                self._work_off(target, interaction, level, reached, elapsed_s)
            elif open_now:
                self._attend(target, interaction, reached, elapsed_s)

    def _in_reach(self, target: CityTarget, interaction: InteractionSpec) -> list[tuple[str, float]]:
        here, _ = self._pose(target)
        there = ((name, self._bodies.get(name)) for name in self._actors[target.id, interaction.name])
        actors = [(name, body[0]) for name, body in there if body is not None and body[1].status not in _IDLE]
        return _actors_in_reach(interaction, here, actors)

    def _work_off(
        self,
        target: CityTarget,
        interaction: InteractionSpec,
        level: Level,
        reached: list[tuple[str, float]],
        elapsed_s: float,
    ) -> None:
        if interaction.name in target.done:
            return
        tended = target.tended(level.name, besides=level)
        before = self._book.amount(target.id, level.name)
        left = level.after(before, elapsed_s, manned=bool(reached), tended=tended)
        self._book.put(target.id, level.name, left)
        if left <= 0.0 and reached:
            actor, distance_m = reached[0]
            target.finish(interaction, actor, target.nature.over)
            self._emit(target, interaction, actor, distance_m)

    def _attend(
        self, target: CityTarget, interaction: InteractionSpec, reached: list[tuple[str, float]], elapsed_s: float
    ) -> None:
        times = target.attend(interaction.name, [actor for actor, _ in reached], elapsed_s)
        lasting_s = interaction.lasting_s or 0.0
        ready = [(actor, far) for actor, far in reached if times[actor] >= lasting_s - 1e-9]
        if interaction.moves_goods:
            for actor, distance_m in ready:
                self._trade(target, interaction, actor, distance_m)
        elif ready:
            actor, distance_m = ready[0]
            target.finish(interaction, actor)
            self._emit(target, interaction, actor, distance_m)

    def _trade(self, target: CityTarget, interaction: InteractionSpec, actor: str, distance_m: float) -> None:
        moved = self._book.transfer(target.id, actor, interaction)
        if not moved:
            return
        target.attended[interaction.name, actor] = 0.0
        self._emit(target, interaction, actor, distance_m, moved)
        if interaction.own and self._book.amount(target.id, interaction.own) <= 0.0:
            target.finish(interaction, actor)

    def _emit(
        self,
        target: CityTarget,
        interaction: InteractionSpec,
        actor: str,
        distance_m: float,
        values: dict[str, float] | None = None,
    ) -> None:
        self._events.append(
            TaskEvent(
                kind=interaction.name,
                entities=(target.id, actor),
                time_s=self._clock.time_s,
                values={"distance_m": distance_m, **(values or {})},
            )
        )

    def _pose(self, target: CityTarget) -> tuple[Vector, Vector]:
        """Return position and velocity of a target, or those of the actor that carries it."""
        if target.carrier is not None and target.carrier in self._bodies:
            place, carrier = self._bodies[target.carrier]
            return place, carrier.velocity
        return target.body.pose(self._clock.time_s, self._clock.remainder_s)

    def _state(self, target: CityTarget) -> BodyState:
        position, velocity = self._pose(target)
        carrier = self._bodies.get(target.carrier) if target.carrier is not None else None
        return BodyState(
            id=target.id,
            position=position,
            velocity=velocity,
            heading_deg=target.heading_deg if carrier is None else carrier[1].heading_deg,
            status=target.status,
            resources=self._resources(target),
        )

    def _resources(self, target: CityTarget) -> dict[str, float]:
        return self._book.stocks(target.id) | self._book.accounts(target.id)

    def _boundary(self) -> Boundary:
        events, self._events = tuple(self._events), []
        return Boundary(
            engine=self._name,
            time_s=self._clock.time_s,
            states=tuple(self._state(target) for target in self._targets.values()),
            receipts=self._requests.drain(),
            events=events,
            unreachable_links=self._unlinked,
        )


def _actors_in_reach(interaction: InteractionSpec, target: Vector, actors: Sequence[_Actor]) -> list[tuple[str, float]]:
    """Return the actors within reach (inclusive, in the plane) with their distances in metres.

    The nearest comes first; equally near actors keep the order of `actors`.
    """
    distances = [(math.dist(place[:2], target[:2]), order) for order, (_, place) in enumerate(actors)]
    return [(actors[order][0], far) for far, order in sorted(distances) if far <= interaction.within_m]
