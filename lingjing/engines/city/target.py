"""The state of one target: its nature, its interactions and their progress."""

from __future__ import annotations

from dataclasses import dataclass, field

import msgspec

from lingjing.engines.city.arrivals import PeopleQueue, rates
from lingjing.engines.city.goods import DUST, first_amounts
from lingjing.engines.city.target_body import TargetBody
from lingjing.mission.instance import Entity, InteractionSpec
from lingjing.mission.natures import PEOPLE, TargetNature, nature_of, traits_of, worked_levels
from lingjing.mission.vocabulary import DORMANT


@dataclass(slots=True)
class Level:
    """The progress of an interaction that works off a state of the target, such as the heat of a fire."""

    name: str
    """Name of the state; `Goods` holds its value."""
    full: float
    """Full value of the state."""
    work_s: float
    """Time in which an actor reduces the state from `full` to 0, seconds."""
    growth_hz: float
    """Growth per second as a share of `full` while no actor works on it."""
    manned: bool = False
    """True if an actor was within reach at the end of the last interval."""

    def after(self, value: float, seconds: float, *, manned: bool, tended: bool) -> float:
        """Return the value after an interval of `seconds`.

        `manned` is true if an actor is within reach at its end. `tended` is true if another interaction works on the
        same state; the state does not grow back then.
        """
        left = value
        if value > 0.0 and manned:
            left = self._worked(value, seconds)
        elif value > 0.0 and not tended:
            left = max(value, min(self.full, value + self.growth_hz * self.full * seconds))
        self.manned = manned
        return left if left > DUST else 0.0

    def _worked(self, value: float, seconds: float) -> float:
        if self.work_s <= 0.0:
            return 0.0
        return value - self.full * seconds / self.work_s if self.manned else value


@dataclass(slots=True)
class CityTarget:
    """The state of one target."""

    entity: Entity
    """The target as declared by the instance."""
    nature: TargetNature
    """Its behaviour without interaction."""
    body: TargetBody
    """Its motion."""
    possible: dict[str, InteractionSpec]
    """Its interactions, by name."""
    levels: dict[str, Level] = field(default_factory=dict)
    """The level that an interaction works off, by name of the interaction."""
    crowd: PeopleQueue | None = None
    """Its arrivals and departures; None if there are none."""
    unlocked: list[str] = field(default_factory=list)
    """Names of the unlocked interactions."""
    done: list[str] = field(default_factory=list)
    """Names of the interactions that are finished for good."""
    attended: dict[tuple[str, str], float] = field(default_factory=dict)
    """Time for which an actor has been within reach, seconds, by interaction and actor."""
    word: str = ""
    """Status word while it is present."""
    carrier: str | None = None
    """Id of the actor that carries it; None if it is not carried."""
    present: bool = True
    """True if the schedule has it present."""
    appeared: bool = False
    """True once it has been present."""

    @property
    def id(self) -> str:
        """Id of the entity."""
        return self.entity.id

    def tended(self, state: str, besides: Level) -> bool:
        """Return whether an actor works on a state by another interaction than that of the level `besides`."""
        return any(level.manned for level in self.levels.values() if level.name == state and level is not besides)

    @property
    def status(self) -> str:
        """Present status word."""
        if self.present:
            return self.word
        return self.nature.vanished if self.appeared else DORMANT

    def set_present(self, present: bool) -> None:
        """Set whether the target is present according to the schedule."""
        self.present = present
        self.appeared = self.appeared or present

    def attend(self, name: str, actors: list[str], seconds: float) -> dict[str, float]:
        """Count an interval for the actors within reach of an interaction at its end, and return the times of these
        actors.

        An actor that has just arrived starts at 0 s.
        """
        kept = {key: value for key, value in self.attended.items() if key[0] != name}
        now = {actor: self.attended.get((name, actor), -seconds) + seconds for actor in actors}
        self.attended = kept | {(name, actor): value for actor, value in now.items()}
        return now

    def set_amount(self, state: str, amount: float) -> None:
        """Adapt to a state that an event has set.

        Interactions that had used it up are open again if there is something left. A fire that an event puts out takes
        the status word that an actor would have given it.
        """
        served = [
            name
            for name, spec in self.possible.items()
            if spec.own == state or (name in self.levels and self.levels[name].name == state)
        ]
        if amount > 0.0 and any(name in self.done for name in served):
            self.done = [name for name in self.done if name not in served]
            self.word = self.nature.word
        elif amount <= 0.0 and state == self.nature.level:
            self.done += [name for name in served if name not in self.done]
            self.word = self.nature.over or self.word

    @property
    def moves(self) -> bool:
        """True if its body moves: it is present and not aboard, and one with a behaviour waits for no more service."""
        is_settled = self.entity.behaviour is not None and self.entity.is_served(self.word)
        return self.present and self.carrier is None and not is_settled

    @property
    def heading_deg(self) -> float:
        """The heading of its motion, or else the declared one."""
        own = self.body.heading_deg
        return self.entity.heading_deg if own is None else own

    def finish(self, interaction: InteractionSpec, actor: str, over: str = "") -> None:
        """Finish an interaction for good.

        The target takes the word of the interaction unless its nature keeps its own. The actor may take the target
        aboard.
        """
        self.done.append(interaction.name)
        if not self.nature.lasts:
            self.word = interaction.status or over or interaction.done_word
        if interaction.aboard:
            self.carrier = actor


def target_of(entity: Entity, body: TargetBody, seed: int) -> CityTarget:
    """Return the target that an entity's properties describe."""
    nature, possible = entity_nature(entity), {interaction.name: interaction for interaction in entity.interactions}
    return CityTarget(
        entity=entity,
        nature=nature,
        body=body,
        possible=possible,
        levels=_levels(entity, nature, possible),
        crowd=PeopleQueue(entity, seed) if entity.state_of(PEOPLE) is not None and any(rates(entity)) else None,
        word=nature.word,
    )


def entity_nature(entity: Entity) -> TargetNature:
    """Return the nature of a target, with its own first status word if it declares one."""
    nature, word = nature_of(traits_of(entity)), entity.properties.get("status")
    return msgspec.structs.replace(nature, word=word) if isinstance(word, str) else nature


def _levels(entity: Entity, nature: TargetNature, possible: dict[str, InteractionSpec]) -> dict[str, Level]:
    """Return the levels of all interactions that work off a state."""
    values = first_amounts(entity)
    workers = worked_levels(nature, possible.values(), values)
    growing = next((name for name, state in workers.items() if state == nature.level), "")
    made = {}
    for name, state in workers.items():
        natural, lasting_s = state == nature.level, possible[name].lasting_s
        made[name] = Level(
            name=state,
            full=1.0 if natural else values[state],
            work_s=nature.work_s if lasting_s is None else lasting_s,
            growth_hz=nature.growth_hz if name == growing else 0.0,
        )
    return made
