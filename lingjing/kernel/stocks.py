"""State values and resources: what the author calls `p.demand`, the graph `demand_kg` and an engine `demand`.

A declared state (`state demand = 100 kg`) is a property with a unit in its name. The engine that changes it reports
its current value among the resources under the author's name, which carries no unit; until it does, the declared
value holds. Resources with an `@` are the engines' own book-keeping and nobody's to see.
"""

from __future__ import annotations

from functools import cache

from lingjing.mission.instance import Datum, Entity
from lingjing.mission.units import NAMED
from lingjing.trace.records import BodyState

_INTERNAL = "@"


@cache
def plain_name(name: str) -> str:
    """The name without the unit that ends it: `demand` for `demand_kg`."""
    ends = [f"_{entry.suffix.lstrip('_')}" for entry in NAMED if entry.suffix]
    fitting = [end for end in ends if name.endswith(end) and len(name) > len(end)]
    return name.removesuffix(max(fitting, key=len)) if fitting else name


def current(entity: Entity, state: BodyState, name: str) -> Datum:
    """The value of a resource, a declared state or another property of an entity now; None if it has none."""
    if name in state.resources:
        return state.resources[name]
    if name in entity.state and (plain := plain_name(name)) in state.resources:
        return state.resources[plain]
    return entity.properties.get(name)


def stocks(entity: Entity, state: BodyState) -> dict[str, float]:
    """All that an entity has in stock and that is not hidden: its engine's resources, then states as declared."""
    hidden = {plain_name(name) for name in entity.hidden} | set(entity.hidden)
    shown = {name: value for name, value in state.resources.items() if _INTERNAL not in name and name not in hidden}
    for name in entity.state:
        value = current(entity, state, name)
        if name not in hidden and isinstance(value, int | float):
            shown.setdefault(plain_name(name), float(value))
    return shown


def public(state: BodyState) -> dict[str, float]:
    """The resources without the engines' book-keeping."""
    return {name: value for name, value in state.resources.items() if _INTERNAL not in name}
