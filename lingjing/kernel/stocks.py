"""State values and resources: what the author calls `p.demand`, the graph `demand_kg` and an engine `demand`.

A declared state (`state demand = 100 kg`) is a property with a unit in its name. The engine that changes it reports
its current value among the resources under the author's name, which carries no unit (or under the graph's); until it
does, the declared value holds. Resources with an `@` are the engines' own book-keeping and nobody's to see. What an
engine reports beside the declared states it has worked out from the entity's properties and states, as a battery's
watt-hours from its endurance and its load: where one of those is hidden, it is not shown.
"""

from __future__ import annotations

from lingjing.mission.instance import Datum, Entity
from lingjing.trace.records import BodyState

_INTERNAL = "@"

_PLACE = frozenset({"position", "heading"})
"""Hidden properties that no stock is worked out from."""


def current(entity: Entity, state: BodyState, name: str) -> Datum:
    """The value of a resource, a declared state or another property of an entity now; None if it has none."""
    if name in state.resources:
        return state.resources[name]
    if (spec := entity.state_of(name)) is not None and spec.name in state.resources:
        return state.resources[spec.name]
    return entity.properties.get(name)


def stocks(entity: Entity, state: BodyState) -> dict[str, float]:
    """All that an entity has in stock and that is not hidden: its engine's resources, then states as declared."""
    fields = {spec.field for spec in entity.state}
    stated = fields | {spec.name for spec in entity.state}
    closed = set(entity.hidden) - _PLACE
    shown = {} if closed else {name: value for name, value in public(state).items() if name not in stated}
    for spec in entity.state:
        value = current(entity, state, spec.field)
        if spec.field not in entity.hidden and isinstance(value, int | float):
            shown[spec.name] = float(value)
    return shown


def public(state: BodyState) -> dict[str, float]:
    """The resources without the engines' book-keeping."""
    return {name: value for name, value in state.resources.items() if _INTERNAL not in name}
