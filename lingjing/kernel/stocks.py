"""Declared states and resources: the language's `p.demand`, the graph's `demand_kg` and an engine's `demand`.

A declared state (`state demand = 100 kg`) becomes a property with the unit in its name. The engine that changes it
reports the current value among the entity's resources, under the author's name (without unit) or the graph's. Until it
does, the declared value holds. Resources with an `@` are the engines' internal accounts and never visible. An engine
may report further quantities that it derives from properties and states, such as a battery's watt-hours from endurance
and load. If an entity hides a property or state, its derived quantities are not shown.
"""

from __future__ import annotations

from lingjing.mission.instance import Datum, Entity
from lingjing.trace.records import BodyState

_INTERNAL = "@"
"""Marks a resource as an engine's internal account."""

_PLACE = frozenset({"position", "heading"})
"""Hidden properties from which no resource is derived."""


def current(entity: Entity, state: BodyState, name: str) -> Datum:
    """Return the present value of a resource, a declared state or another property of an entity; None if it has
    none.
    """
    if name in state.resources:
        return state.resources[name]
    if (spec := entity.state_of(name)) is not None and spec.name in state.resources:
        return state.resources[spec.name]
    return entity.properties.get(name)


def stocks(entity: Entity, state: BodyState) -> dict[str, float]:
    """Return the visible stocks of an entity: its engine's resources, then its declared states under their declared
    names.
    """
    fields = {spec.field for spec in entity.state}
    stated = fields | {spec.name for spec in entity.state}
    closed = set(entity.hidden) - _PLACE
    shown = {} if closed else {name: value for name, value in public_resources(state).items() if name not in stated}
    for spec in entity.state:
        value = current(entity, state, spec.field)
        if spec.field not in entity.hidden and isinstance(value, int | float):
            shown[spec.name] = float(value)
    return shown


def public_resources(state: BodyState) -> dict[str, float]:
    """Return the resources without the engines' internal accounts."""
    return {name: value for name, value in state.resources.items() if _INTERNAL not in name}
