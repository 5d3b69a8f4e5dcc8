"""The city engine: all targets of an episode behind the five-method contract."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

from lingjing.mission.instance import Vector
from lingjing.plugins.engine import Boundary, CaptureRequest, EngineSpec, Frame
from lingjing.plugins.engines.city.afloat import STEP_S, Afloat
from lingjing.plugins.engines.city.interaction import UNLOCK, Interaction, actor_in_reach, interactions, moved_on
from lingjing.plugins.engines.clock import Clock
from lingjing.plugins.engines.requests import Refusal, Requests
from lingjing.plugins.engines.terrain import Terrain
from lingjing.scene.city import City
from lingjing.trace.records import BodyState, Command, Receipt, TaskEvent

ADRIFT = "adrift"
"""Status of a target that nothing has been done to yet."""


@dataclass(slots=True)
class Target:
    """A target, what may be done to it, what has been unlocked and who has taken it aboard."""

    id: str
    body: Afloat
    heading_deg: float
    possible: dict[str, Interaction]
    unlocked: list[str] = field(default_factory=list)
    done: list[str] = field(default_factory=list)
    status: str = ADRIFT
    carrier: str | None = None


class CityEngine:
    """Drifts targets at 10 Hz; performs unlocked interactions at each macro-step."""

    def reset(self, spec: EngineSpec, city: City, seed: int) -> Boundary:
        """Put the targets where the instance says and learn which engine owns whom."""
        self._name = spec.engine
        self._clock = Clock(STEP_S)
        self._requests = Requests(spec.engine)
        self._events: list[TaskEvent] = []
        self._owners = {entity.id: entity.engine for entity in spec.instance.entities}
        terrain, weather = Terrain(city), spec.instance.weather
        self._targets = {
            entity.id: Target(
                id=entity.id,
                body=Afloat(entity, terrain, weather, seed),
                heading_deg=entity.heading_deg,
                possible=interactions(entity),
            )
            for entity in spec.owned()
        }
        return self._boundary({})

    def submit(self, commands: Sequence[Command]) -> tuple[Receipt, ...]:
        """Take the kernel's unlocks; they last for the episode and are complete with their admission."""
        return tuple(self._admit(command) for command in commands)

    def advance(self, until: float, mirrors: Sequence[BodyState]) -> Boundary:
        """Drift to `until`, then look who has come into reach by then."""
        elapsed = until - self._clock.time_s
        for _ in range(self._clock.steps_until(until)):
            self._clock.done += 1
            for target in self._targets.values():
                target.body.step()
        bodies = {body.id: body for body in mirrors}
        places = {name: moved_on(body, elapsed) for name, body in bodies.items()}
        for target in self._targets.values():
            self._interact(target, places)
        return self._boundary({name: (places[name], body) for name, body in bodies.items()})

    def capture(self, requests: Sequence[CaptureRequest]) -> tuple[Frame, ...]:
        """No sensors here."""
        return ()

    def close(self) -> None:
        """Let go of the targets."""
        self._targets = {}

    def _admit(self, command: Command) -> Receipt:
        receipt = self._requests.admit(command, self._clock.time_s, self._unlock)
        if receipt.status == "accepted":
            self._requests.complete(command.resource, self._clock.time_s)
        return receipt

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

    def _interact(self, target: Target, places: dict[str, Vector]) -> None:
        for name in target.unlocked:
            if name in target.done:
                continue
            interaction = target.possible[name]
            here, _ = self._pose(target)
            actors = [(who, place) for who, place in places.items() if self._owners.get(who) == interaction.by_engine]
            reached = actor_in_reach(interaction, here, actors)
            if reached is not None:
                self._perform(target, interaction, *reached)

    def _perform(self, target: Target, interaction: Interaction, actor: str, distance_m: float) -> None:
        target.done.append(interaction.name)
        target.status = interaction.status
        if interaction.takes_aboard:
            target.carrier = actor
        self._events.append(
            TaskEvent(
                kind=interaction.name,
                entities=(target.id, actor),
                time_s=self._clock.time_s,
                values={"distance_m": distance_m},
            )
        )

    def _pose(self, target: Target) -> tuple[Vector, Vector]:
        return target.body.pose(self._clock.time_s, self._clock.remainder_s)

    def _state(self, target: Target, carriers: dict[str, tuple[Vector, BodyState]]) -> BodyState:
        position, velocity = self._pose(target)
        heading = target.heading_deg
        if target.carrier is not None and target.carrier in carriers:
            position, carrier = carriers[target.carrier]
            velocity, heading = carrier.velocity, carrier.heading_deg
        return BodyState(id=target.id, position=position, velocity=velocity, heading_deg=heading, status=target.status)

    def _boundary(self, carriers: dict[str, tuple[Vector, BodyState]]) -> Boundary:
        events, self._events = tuple(self._events), []
        return Boundary(
            engine=self._name,
            time_s=self._clock.time_s,
            states=tuple(self._state(target, carriers) for target in self._targets.values()),
            receipts=self._requests.drain(),
            events=events,
        )
