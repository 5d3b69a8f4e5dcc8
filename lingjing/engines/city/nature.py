"""The behaviour of a target without interaction, derived from its properties: burning, leaking, adrift, waiting.

A nature has a status word and the word that follows when the behaviour ends. Some natures have a `level`: a declared
state between 0 and 1 without unit, such as `heat`. An actor works it off in a given time, and it may grow back. A type
may declare its own first status word (`status = …`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from lingjing.engines.city.arrivals import PEOPLE
from lingjing.mission.instance import Entity
from lingjing.trace.records import CLEARED, DORMANT

WAITING = "waiting"
"""Status of a target without another nature."""


@dataclass(frozen=True, slots=True)
class TargetNature:
    """The behaviour of a target without interaction."""

    word: str = WAITING
    """Status word."""
    level: str = ""
    """Name of the state that actors work off; empty if there is none."""
    over: str = ""
    """Status when the level is 0; empty means the word of the interaction."""
    vanished: str = DORMANT
    """Status after the target has vanished."""
    lasts: bool = False
    """True if no interaction changes the status word."""
    work_s: float = 0.0
    """Time in which an actor reduces the level from 1 to 0, seconds, unless the interaction declares its own."""
    growth_hz: float = 0.0
    """Growth of the level per second while no actor works on it."""


FIRE = TargetNature("burning", level="heat", over="out", work_s=10.0, growth_hz=1.0 / 60.0)
"""A fire. It takes 10 s to put out and a minute to regain its full heat (both chosen)."""
LEAK = TargetNature("leaking", level="flow", over="sealed", work_s=5.0)
"""A leak. It takes 5 s to seal (chosen) and does not grow back."""
BLOCKAGE = TargetNature("blocking", vanished=CLEARED, lasts=True)
"""A target that blocks a road. Once vanished it is cleared."""

BREAK = TargetNature("fractured", lasts=True)
"""A broken bridge. It stays broken."""

ADRIFT = TargetNature("adrift")
QUEUE = TargetNature("queueing")
STORE = TargetNature("open", lasts=True)
"""A store with an unlimited supply. It stays open."""


def nature_of(entity: Entity) -> TargetNature:
    """Return the nature of a target. Its own property `status` replaces the nature's word."""
    nature = _nature(entity)
    word = entity.properties.get("status")
    return replace(nature, word=word) if isinstance(word, str) else nature


def _nature(entity: Entity) -> TargetNature:
    properties = entity.properties
    for levelled in (FIRE, LEAK):
        if entity.state_of(levelled.level) is not None:
            return levelled
    if entity.blocked_m is not None:
        return BLOCKAGE
    if "drift_mps" in properties:
        return ADRIFT
    if entity.state_of(PEOPLE) is not None:
        return QUEUE
    if properties.get("on") == "bridge" and "width_m" in properties:
        return BREAK
    if any(interaction.gives and not interaction.source for interaction in entity.interactions):
        return STORE  # unlimited: the goods that it gives are not counted anywhere
    return TargetNature()
