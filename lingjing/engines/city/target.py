"""One target: what it is by itself, what may be done to it, how far that has come."""

from __future__ import annotations

from dataclasses import dataclass, field

from lingjing.engines.city.arrivals import PEOPLE, PeopleQueue, rates
from lingjing.engines.city.goods import DUST, first_amounts
from lingjing.engines.city.nature import TargetNature, nature_of
from lingjing.engines.city.whereabouts import TargetBody
from lingjing.mission.instance import Entity, InteractionSpec
from lingjing.trace.records import DORMANT


@dataclass(slots=True)
class Level:
    """How a state of the target is worked off by an actor that is there (a fire's heat); 0 and it is over.

    `name` is the state, whose value the book keeps. An actor brings it from `full` to nothing within `work_s`;
    `growth_hz` is regained a second when nobody is at it. `manned` says whether somebody was there at the end of the
    interval before.
    """

    name: str
    full: float
    work_s: float
    growth_hz: float
    manned: bool = False

    def after(self, value: float, seconds: float, *, manned: bool, tended: bool) -> float:
        """The value after an interval at whose end somebody is there or not. While another interaction works on the
        same state (`tended`) nothing is regained."""
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
    """The state of one target. `levels` holds what its interactions work off, by interaction; `attended` is how long
    each actor has been within reach of an interaction, seconds."""

    entity: Entity
    nature: TargetNature
    body: TargetBody
    possible: dict[str, InteractionSpec]
    levels: dict[str, Level] = field(default_factory=dict)
    crowd: PeopleQueue | None = None
    unlocked: list[str] = field(default_factory=list)
    done: list[str] = field(default_factory=list)
    attended: dict[tuple[str, str], float] = field(default_factory=dict)
    word: str = ""
    carrier: str | None = None
    present: bool = True
    appeared: bool = False

    @property
    def id(self) -> str:
        """The entity's id."""
        return self.entity.id

    def tended(self, state: str, besides: Level) -> bool:
        """Whether somebody works off a state by another interaction than that of the level `besides`."""
        return any(level.manned for level in self.levels.values() if level.name == state and level is not besides)

    @property
    def status(self) -> str:
        """Its status word now."""
        if self.present:
            return self.word
        return self.nature.gone if self.appeared else DORMANT

    def show(self, present: bool) -> None:
        """It is here, or not: not yet, or no more."""
        self.present = present
        self.appeared = self.appeared or present

    def attend(self, name: str, actors: list[str], seconds: float) -> dict[str, float]:
        """Count an interval for the actors within reach of an interaction at its end; who has just come starts at 0."""
        kept = {key: value for key, value in self.attended.items() if key[0] != name}
        now = {actor: self.attended.get((name, actor), -seconds) + seconds for actor in actors}
        self.attended = kept | {(name, actor): value for actor, value in now.items()}
        return now

    def finish(self, interaction: InteractionSpec, actor: str, over: str = "") -> None:
        """An interaction is done for good: its word holds unless the nature's lasts; the actor may take the target."""
        self.done.append(interaction.name)
        if not self.nature.lasts:
            self.word = interaction.status or over or interaction.done_word
        if interaction.aboard:
            self.carrier = actor


def target_of(entity: Entity, body: TargetBody, seed: int) -> CityTarget:
    """The target that an entity's properties describe."""
    nature, possible = nature_of(entity), {one.name: one for one in entity.interactions}
    return CityTarget(
        entity=entity,
        nature=nature,
        body=body,
        possible=possible,
        levels=_levels(entity, nature, possible),
        crowd=PeopleQueue(entity, seed) if entity.state_of(PEOPLE) is not None and any(rates(entity)) else None,
        word=nature.word,
    )


def _levels(entity: Entity, nature: TargetNature, possible: dict[str, InteractionSpec]) -> dict[str, Level]:
    """What each interaction works off: the state that it takes, or else the nature's, which falls to the first one
    that takes and gives nothing."""
    values = first_amounts(entity)
    workers = {one.name: one.takes for one in possible.values() if one.works_off and one.takes in values}
    idle = next((one.name for one in possible.values() if not one.takes and not one.gives), "")
    if nature.level in values and nature.level not in workers.values() and idle:
        workers[idle] = nature.level
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
