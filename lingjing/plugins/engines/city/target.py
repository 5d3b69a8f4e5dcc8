"""One target: what it is by itself, what may be done to it, how far that has come."""

from __future__ import annotations

from dataclasses import dataclass, field

from lingjing.mission.instance import Entity
from lingjing.mission.units import without_unit
from lingjing.plugins.engines.city.afloat import Body
from lingjing.plugins.engines.city.book import DUST
from lingjing.plugins.engines.city.crowd import PEOPLE, Crowd
from lingjing.plugins.engines.city.interaction import Interaction, interactions
from lingjing.plugins.engines.city.nature import Nature, nature_of
from lingjing.trace.records import DORMANT


@dataclass(slots=True)
class Level:
    """What an actor works off by being there: 1 is all of it (a fire's heat), 0 and it is over.

    `interaction` is the one that does it, within `work_s` from full to nothing; `growth_hz` is regained a second when
    nobody is at it. `manned` says whether somebody was there at the end of the interval before.
    """

    name: str
    interaction: str
    value: float
    full: float
    work_s: float
    growth_hz: float
    manned: bool = False

    def pass_time(self, seconds: float, *, manned: bool) -> bool:
        """Let an interval pass at whose end somebody is there or not; whether the level is 0 now."""
        if self.value <= 0.0:
            return True
        if not manned:
            self.value = max(self.value, min(self.full, self.value + self.growth_hz * self.full * seconds))
        elif self.work_s <= 0.0:
            self.value = 0.0
        elif self.manned:
            self.value -= self.full * seconds / self.work_s
        self.manned = manned
        if self.value <= DUST:
            self.value = 0.0
        return self.value <= 0.0


@dataclass(slots=True)
class Target:
    """The state of one target. `attended` is how long each actor has been within reach of an interaction, seconds."""

    entity: Entity
    nature: Nature
    body: Body
    possible: dict[str, Interaction]
    level: Level | None = None
    crowd: Crowd | None = None
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

    def finish(self, interaction: Interaction, actor: str, over: str = "") -> None:
        """An interaction is done for good: its word holds unless the nature's lasts; the actor may take the target."""
        self.done.append(interaction.name)
        if not self.nature.lasts:
            self.word = interaction.status or over or interaction.done_word
        if interaction.takes_aboard:
            self.carrier = actor


def target_of(entity: Entity, body: Body, seed: int) -> Target:
    """The target that an entity's properties describe."""
    nature, possible = nature_of(entity), interactions(entity)
    states = {without_unit(name): name for name in entity.state}
    return Target(
        entity=entity,
        nature=nature,
        body=body,
        possible=possible,
        level=_level(entity, nature, possible),
        crowd=Crowd(entity, seed) if PEOPLE in states else None,
        word=nature.word,
    )


def _level(entity: Entity, nature: Nature, possible: dict[str, Interaction]) -> Level | None:
    """The level that an interaction takes by name, or else the nature's, which the first interaction works off."""
    named = next((one for one in possible.values() if one.takes and not one.moves_goods), None)
    worker = named or (next(iter(possible.values()), None) if nature.level else None)
    name = named.takes if named else nature.level
    values = {without_unit(key): value for key, value in entity.properties.items()}
    value = values.get(name)
    if worker is None or isinstance(value, bool) or not isinstance(value, int | float):
        return None
    natural = name == nature.level
    lasting = worker.lasting_s if worker.lasting_s is not None else nature.work_s
    return Level(
        name=name,
        interaction=worker.name,
        value=float(value),
        full=1.0 if natural else float(value),
        work_s=lasting,
        growth_hz=nature.growth_hz if natural else 0.0,
    )
