"""Interactions of a target: who may do what to it from how far, for how long, and what changes hands.

A target's type declares them (`interaction rescue { by = vessel, within = 50 m }`), which reaches the engine as the
properties `rescue_by` (the name of an engine: anything that it owns may do it) and `rescue_within_m`. Optional ones:
`<name>_lasting_s` (how long an actor must stay within reach), `<name>_status` (the target's word afterwards; by default
the name's past participle) and `<name>_aboard` (whether the actor takes the target along; by default if it drifts).
`<name>_takes = demand, <name>_from = load` lowers the target's `demand` by what the actor has in its `load`; `_takes`
alone works a level off (`heat`) while the actor is there;
`<name>_gives = load` fills the actor's `load`, `_up_to = payload` as far as that and `_from = content` out of the
target's own `content`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from lingjing.mission.instance import Entity, Vector
from lingjing.trace.records import BodyState

UNLOCK = "unlock."
"""Prefix of the verbs that the kernel sends: `unlock.<interaction>`."""

_BY = "_by"

Actor = tuple[str, Vector]
"""Somebody who may act: its id and where it is."""


@dataclass(frozen=True, slots=True)
class Interaction:
    """One interaction of one target. `status` is "" where the type names none; stocks are names without units."""

    name: str
    by_engine: str
    within_m: float
    status: str = ""
    takes_aboard: bool = False
    lasting_s: float | None = None
    takes: str = ""
    gives: str = ""
    source: str = ""
    up_to: str = ""

    @property
    def moves_goods(self) -> bool:
        """Whether something changes hands; then it may happen again and again."""
        return bool(self.gives or (self.takes and self.source))

    @property
    def works_off(self) -> bool:
        """Whether it lowers a state of the target while the actor is there, and nobody gets what is taken."""
        return bool(self.takes) and not self.source

    @property
    def carried(self) -> str:
        """The state of the actor that goods are taken from or put into; "" if nothing changes hands."""
        return self.source if self.takes else self.gives

    @property
    def own(self) -> str:
        """The state of the target that goods come from or go to; "" for a supply that is not counted."""
        return self.takes or self.source

    @property
    def done_word(self) -> str:
        """The target's status afterwards."""
        return self.status or self.name + ("d" if self.name.endswith("e") else "ed")


def interactions(entity: Entity) -> dict[str, Interaction]:
    """The interactions that an entity's properties declare, by name."""
    found = {}
    for key, value in entity.properties.items():
        within = entity.properties.get(f"{key.removesuffix(_BY)}_within_m")
        if key.endswith(_BY) and isinstance(value, str) and isinstance(within, int | float):
            name = key.removesuffix(_BY)
            found[name] = _interaction(entity, name, value, float(within))
    return found


def _interaction(entity: Entity, name: str, by_engine: str, within_m: float) -> Interaction:
    def word(key: str) -> str:
        value = entity.properties.get(f"{name}_{key}")
        return value if isinstance(value, str) else ""

    lasting = entity.properties.get(f"{name}_lasting_s")
    return Interaction(
        name=name,
        by_engine=by_engine,
        within_m=within_m,
        status=word("status"),
        takes_aboard=bool(entity.properties.get(f"{name}_aboard", "drift_mps" in entity.properties)),
        lasting_s=float(lasting) if isinstance(lasting, int | float) else None,
        takes=word("takes"),
        gives=word("gives"),
        source=word("from"),
        up_to=word("up_to"),
    )


def moved_on(body: BodyState, seconds: float) -> Vector:
    """Where a mirrored body is `seconds` later if it keeps its velocity."""
    x, y, z = (here + seconds * rate for here, rate in zip(body.position, body.velocity, strict=True))
    return x, y, z


def actors_in_reach(interaction: Interaction, target: Vector, actors: Sequence[Actor]) -> list[tuple[str, float]]:
    """The actors within reach (inclusive, in the plane) with their distances in metres: nearest first, of equally near
    ones in the order given."""
    distances = [(math.dist(place[:2], target[:2]), order) for order, (_, place) in enumerate(actors)]
    return [(actors[order][0], far) for far, order in sorted(distances) if far <= interaction.within_m]
