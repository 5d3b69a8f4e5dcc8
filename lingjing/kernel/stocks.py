"""State values and resources: what the author calls `p.demand`, the graph `demand_kg` and an engine `demand`.

A declared state (`state demand = 100 kg`) is a property with a unit in its name. The engine that changes it reports
its current value among the resources under the author's name, which carries no unit (or under the graph's); until it
does, the declared value holds. Resources with an `@` are the engines' own book-keeping and nobody's to see. What an
engine reports beside the declared states it has worked out from the entity's properties, as a battery's watt-hours from
its endurance: where one of those is hidden, it is not shown.
"""

from __future__ import annotations

from lingjing.mission.instance import Datum, Entity
from lingjing.mission.units import without_unit
from lingjing.trace.records import BodyState

_INTERNAL = "@"

_PLACE = frozenset({"position", "heading"})
"""Hidden properties that no stock is worked out from."""


def current(entity: Entity, state: BodyState, name: str) -> Datum:
    """The value of a resource, a declared state or another property of an entity now; None if it has none."""
    if name in state.resources:
        return state.resources[name]
    if name in entity.state and (plain := without_unit(name)) in state.resources:
        return state.resources[plain]
    return entity.properties.get(name)


def stocks(entity: Entity, state: BodyState) -> dict[str, float]:
    """All that an entity has in stock and that is not hidden: its engine's resources, then states as declared."""
    hidden = {without_unit(name) for name in entity.hidden} | set(entity.hidden)
    unseen = {*hidden, *entity.state}
    own = {} if set(entity.hidden) - _PLACE - set(entity.state) else public(state)
    stated = {without_unit(name) for name in entity.state}
    shown = {name: value for name, value in own.items() if name not in unseen}
    shown |= {name: value for name, value in public(state).items() if name in stated - unseen}
    for name in entity.state:
        value = current(entity, state, name)
        if name not in hidden and isinstance(value, int | float):
            shown.setdefault(without_unit(name), float(value))
    return shown


def public(state: BodyState) -> dict[str, float]:
    """The resources without the engines' book-keeping."""
    return {name: value for name, value in state.resources.items() if _INTERNAL not in name}
