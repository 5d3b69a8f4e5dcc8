"""What a target is without anybody's help, told from its properties: burning, leaking, adrift, waiting.

A nature is a status word, what that word becomes when the matter is over, and for what can be worked off (`level`, the
name of a declared state between 0 and 1, without a unit, such as `heat`) how long that takes and how fast it comes
back.
A type may name its first status word itself (`status = …`).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from lingjing.engines.city.arrivals import PEOPLE
from lingjing.mission.instance import Entity
from lingjing.trace.records import CLEARED, DORMANT

WAITING = "waiting"


@dataclass(frozen=True, slots=True)
class TargetNature:
    """What a target is by itself.

    `word` is its status, `over` the status when its level is 0 ("" : the interaction's own word), `gone` the status
    after it has vanished, `lasts` whether the word stays whatever is done to it. `work_s` is the time within which an
    actor brings the level from 1 to 0 unless the interaction says how long it takes, `growth_hz` what the level regains
    a second when nobody is at it.
    """

    word: str = WAITING
    level: str = ""
    over: str = ""
    gone: str = DORMANT
    lasts: bool = False
    work_s: float = 0.0
    growth_hz: float = 0.0


FIRE = TargetNature("burning", level="heat", over="out", work_s=10.0, growth_hz=1.0 / 60.0)
LEAK = TargetNature("leaking", level="flow", over="sealed", work_s=5.0)
BLOCKAGE = TargetNature("blocking", gone=CLEARED, lasts=True)
BREAK = TargetNature("fractured", lasts=True)
ADRIFT = TargetNature("adrift")
QUEUE = TargetNature("queueing")
STORE = TargetNature("open", lasts=True)


def nature_of(entity: Entity) -> TargetNature:
    """The nature of a target; its own `status` property goes before the usual word."""
    found = _nature(entity)
    word = entity.properties.get("status")
    return replace(found, word=word) if isinstance(word, str) else found


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
    if any(one.gives and not one.source for one in entity.interactions):
        return STORE  # inexhaustible: what it gives comes out of nothing that is counted
    return TargetNature()
