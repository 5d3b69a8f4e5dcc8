"""How fast an entity can be at most, and how long it can fly: the ceilings that every bound on time rests on.

A ceiling is the declared top speed plus what wind, current and a controller's overshoot may add; the allowances are
generous on purpose, because a proof must hold whatever the engine does. An engine that is not listed here, or an
entity that declares no speed, has no ceiling: nothing is ever proved about its travel.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import msgspec

from lingjing.mission.instance import Entity
from lingjing.mission.intervals import ANYTHING, Bounds, exactly
from lingjing.mission.vocabulary import PHOTO

IDLE_VERBS = frozenset(("stop", PHOTO))
"""Commands that take nobody anywhere."""

DRIFT_FACTOR = 2.0
"""A body adrift makes at most this many times its declared mean drift."""

LEAST_POWER_SHARE = 0.5
"""An aircraft's most economical flight needs at least this share of the power that hovering needs."""


class _Engine(NamedTuple):
    """The property that an engine takes for the top speed, and what it may add to it: a factor, and shares of the
    wind's and the current's speed."""

    speed: str
    factor: float
    wind: float = 0.0
    current: float = 0.0


_MOVERS = {
    "multirotor": _Engine("cruise_mps", 1.15, wind=0.1),
    "plane": _Engine("cruise_mps", 1.15, wind=1.0),
    "vessel": _Engine("speed_mps", 1.10, wind=0.05, current=1.0),
    "quadruped": _Engine("speed_mps", 1.25),
    "road": _Engine("speed_mps", 1.6),
}
_STAYS_UNCOMMANDED = frozenset(("multirotor", "vessel", "quadruped"))
_CITY, _DRIFT = "city", "drift_mps"


class Air(msgspec.Struct, frozen=True):
    """The strongest wind and current of the whole mission, m/s."""

    wind_mps: float = 0.0
    current_mps: float = 0.0


def bounds(entity: Entity, drawn: dict[str, Bounds], name: str) -> Bounds:
    """Between which bounds a property lies when the mission begins."""
    if name in drawn:
        return drawn[name]
    value = entity.properties.get(name)
    if isinstance(value, bool) or not isinstance(value, int | float):
        return ANYTHING
    return exactly(value)


def ceiling(entity: Entity, drawn: dict[str, Bounds], air: Air, *, driven: bool) -> float:
    """The speed over ground that the entity can reach, m/s; infinity if that is not known.

    `driven` says whether some agent may command it to move.
    """
    if entity.engine == _CITY:
        return DRIFT_FACTOR * max(0.0, bounds(entity, drawn, _DRIFT)[1]) if _DRIFT in entity.properties else 0.0
    engine = _MOVERS.get(entity.engine)
    if engine is None:
        return math.inf
    pushed = engine.wind * air.wind_mps + engine.current * air.current_mps
    if not driven:
        return pushed if entity.engine in _STAYS_UNCOMMANDED else math.inf
    return engine.factor * bounds(entity, drawn, engine.speed)[1] + pushed


def flight_s(entity: Entity, drawn: dict[str, Bounds]) -> float:
    """The longest time under way on one battery, seconds; infinity if it declares no endurance or can be charged."""
    if entity.engine != "multirotor" or "endurance_s" not in entity.properties:
        return math.inf
    return bounds(entity, drawn, "endurance_s")[1] / LEAST_POWER_SHARE


def drives(entity: Entity) -> bool:
    """Whether the entity has a command that moves it."""
    return any(verb.name not in IDLE_VERBS for verb in entity.verbs)
