"""Upper bounds of an entity's speed and flight time, on which every bound of time depends.

The bound is the declared top speed plus allowances for wind, current and a controller's overshoot. The allowances are
generous on purpose, because a proof must hold for every engine. An engine without declared allowances
(`lingjing.mission.kinds_format.EngineKind`) and an entity without a declared speed have no bound, so that nothing is
proved about their travel.
"""

from __future__ import annotations

import math

import msgspec

from lingjing.mission.instance import Entity
from lingjing.mission.intervals import ANYTHING, Bounds, exactly
from lingjing.mission.kinds import engine_kind
from lingjing.mission.vocabulary import PHOTO, STOP

IDLE_VERBS = frozenset((STOP, PHOTO))
"""Commands that do not move the asset."""

_DRIFT = "drift_mps"


class Air(msgspec.Struct, frozen=True):
    """The strongest wind and current of the whole mission, m/s, and its highest waves."""

    wind_mps: float = 0.0
    current_mps: float = 0.0
    wave_m: float = 0.0
    """The highest waves, metres."""


def bounds(entity: Entity, drawn: dict[str, Bounds], name: str) -> Bounds:
    """The bounds of a property at the start. `drawn` has the bounds of properties that are drawn."""
    if name in drawn:
        return drawn[name]
    value = entity.properties.get(name)
    if isinstance(value, bool) or not isinstance(value, int | float):
        return ANYTHING
    return exactly(value)


def ceiling(entity: Entity, drawn: dict[str, Bounds], air: Air, *, driven: bool) -> float:
    """An upper bound of the entity's speed over ground, m/s; infinity if none is known.

    `driven` is True if some agent may command it to move.
    """
    kind = engine_kind(entity.engine)
    if entity.behaviour is not None:
        return entity.behaviour.speed_mps
    if kind.drift_factor is not None:
        return kind.drift_factor * max(0.0, bounds(entity, drawn, _DRIFT)[1]) if _DRIFT in entity.properties else 0.0
    top = kind.top_speed
    if top is None:
        return math.inf
    pushed = top.wind * air.wind_mps + top.current * air.current_mps
    if not driven:
        return pushed if kind.stays else math.inf
    return top.factor * top.held(bounds(entity, drawn, top.property)[1]) + pushed


def flight_s(entity: Entity, drawn: dict[str, Bounds]) -> float:
    """The longest time under way on one battery, seconds; infinity if it declares no endurance or can be charged."""
    share = engine_kind(entity.engine).least_power
    if share is None or "endurance_s" not in entity.properties:
        return math.inf
    return bounds(entity, drawn, "endurance_s")[1] / share


def moving_verbs(entity: Entity) -> tuple[str, ...]:
    """The commands that move the entity, in place or away from it."""
    return tuple(verb.name for verb in entity.verbs if verb.name not in IDLE_VERBS)


def roaming_verbs(entity: Entity) -> tuple[str, ...]:
    """The commands that move the entity away from its place in the plane: none that only raises it or turns it on the
    spot."""
    kind = engine_kind(entity.engine)
    return tuple(
        verb.name
        for verb in entity.verbs
        if verb.name not in IDLE_VERBS
        and verb.motion not in ("up", "down", "turn")
        and not any(kind.is_above_start(verb.name, argument.name) for argument in verb.arguments)
    )
