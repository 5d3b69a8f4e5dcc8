"""Interactions of a target: who may do what to it from how far.

A target's type declares them (`interaction rescue { by = vessel, within = 50 m }`), which reaches the engine as the
properties `rescue_by` (the name of an engine: anything that it owns may do it) and `rescue_within_m`. Two optional
ones say what follows: `<name>_status` is the target's status word afterwards (default: the name's past participle) and
`<name>_aboard` whether the actor takes the target along (default: yes if the target drifts).
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


@dataclass(frozen=True, slots=True)
class Interaction:
    """One interaction of one target."""

    name: str
    by_engine: str
    within_m: float
    status: str
    takes_aboard: bool


def interactions(entity: Entity) -> dict[str, Interaction]:
    """The interactions that an entity's properties declare, by name."""
    found = {}
    for key, value in entity.properties.items():
        within = entity.properties.get(f"{key.removesuffix(_BY)}_within_m")
        if not key.endswith(_BY) or not isinstance(value, str) or not isinstance(within, int | float):
            continue
        name = key.removesuffix(_BY)
        status = entity.properties.get(f"{name}_status")
        found[name] = Interaction(
            name=name,
            by_engine=value,
            within_m=float(within),
            status=status if isinstance(status, str) else name + ("d" if name.endswith("e") else "ed"),
            takes_aboard=bool(entity.properties.get(f"{name}_aboard", "drift_mps" in entity.properties)),
        )
    return found


def moved_on(body: BodyState, seconds: float) -> Vector:
    """Where a mirrored body is `seconds` later if it keeps its velocity."""
    x, y, z = (here + seconds * rate for here, rate in zip(body.position, body.velocity, strict=True))
    return x, y, z


def actor_in_reach(
    interaction: Interaction, target: Vector, actors: Sequence[tuple[str, Vector]]
) -> tuple[str, float] | None:
    """The nearest of the possible actors within reach (inclusive, in the plane), with its distance in metres."""
    distances = [(math.dist(position[:2], target[:2]), order) for order, (_, position) in enumerate(actors)]
    if not distances or min(distances)[0] > interaction.within_m:
        return None
    distance, order = min(distances)
    return actors[order][0], distance
