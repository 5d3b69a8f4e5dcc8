"""What only a running mission answers: ground truth, task events, assignments, routes, counted budgets.

Each takes the evaluation context and evaluated arguments. Total: what does not exist is `None`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

from lingjing.kernel.budgets import limit_key
from lingjing.kernel.context import RuntimeContext
from lingjing.mission.instance import Entity
from lingjing.mission.values import Value
from lingjing.trace.records import CLEARED, DEAD, DORMANT

HANDOFF_M = 50.0
"""How near a destination must be to a target for `assigned` to mean that target (the paper's vessel radius)."""

SAME_POINT_M = 1.0
"""A destination this near a matched report's position was taken from it."""


def _truth(at: RuntimeContext, entity: Value, frame: Value) -> Value:
    """The ground-truth box of an entity in a frame, or None where no pixel of it is visible."""
    info = at.registry.frames.get(frame) if isinstance(frame, str) else None
    if info is None or not isinstance(entity, Entity):
        return None
    return next((box for box in info.boxes if box.entity == entity.id), None)


def _emitted(at: RuntimeContext, kind: Value, *entities: Value) -> Value:
    """An engine has emitted the task event `kind` about every entity given, by this instant."""
    names = {entity.id for entity in entities if isinstance(entity, Entity)}
    return any(
        emitted == kind and time_s <= at.time_s and names.issubset(about)
        for (emitted, about), time_s in at.registry.emitted.items()
    )


def _assigned(at: RuntimeContext, resource: Value, target: Value) -> Value:
    """A destination that the resource was given last means this target (see `HANDOFF_M`, `SAME_POINT_M`)."""
    if not isinstance(resource, Entity) or not isinstance(target, Entity):
        return None
    here = at.place(target)
    reported = at.registry.sightings.get(target.id, ())
    return any(
        (here is not None and math.dist((item.east, item.north), (here.east, here.north)) <= HANDOFF_M)
        or any(math.dist((item.east, item.north), point) <= SAME_POINT_M for point in reported)
        for item in at.registry.assignments.get(resource.id, ())
    )


def _alive(at: RuntimeContext, asset: Value) -> Value:
    """The asset is there and not dead."""
    state = at.states.get(asset.id) if isinstance(asset, Entity) else None
    return state is not None and state.status not in (DEAD, DORMANT)


def _photographed(at: RuntimeContext, asset: Value) -> Value:
    """A camera of the asset has taken a picture; reference pictures are no asset's."""
    return isinstance(asset, Entity) and any(frame.entity == asset.id for frame in at.registry.frames.values())


def _inspected(at: RuntimeContext, inspection: Value) -> Value:
    """Every waypoint of the route as it is now has been inspected by this instant."""
    known = at.registry.progress.inspected.get(str(inspection))
    return known is not None and known.complete_s is not None and known.complete_s <= at.time_s


def _clear(at: RuntimeContext, inspection: Value) -> Value:
    """No target that is there blocks a waypoint of the route as it is now (`Entity.blocked_m`): waypoints are what is
    inspected, so a jam between two of them is nobody's to find."""
    declared = next((one for one in at.instance.inspections if one.name == inspection), None)
    route = at.registry.routes.get(declared.asset) if declared is not None else None
    if route is None:
        return None
    return not any(_blocks(entity, route.waypoints, at) for entity in at.instance.entities)


def _blocks(entity: Entity, waypoints: Sequence[tuple[float, ...]], at: RuntimeContext) -> bool:
    radius, here = entity.blocked_m, at.place(entity)
    if radius is None or here is None:
        return False
    if at.states[entity.id].status in (DORMANT, CLEARED):
        return False
    return any(math.dist((here.east, here.north), waypoint[:2]) <= radius for waypoint in waypoints)


def _replans(at: RuntimeContext, inspection: Value) -> Value:
    """How often the route was planned anew: routes are numbered from 1."""
    declared = next((one for one in at.instance.inspections if one.name == inspection), None)
    route = at.registry.routes.get(declared.asset) if declared is not None else None
    return None if declared is None else float(max(0, route.number - 1) if route is not None else 0)


def _used(at: RuntimeContext, limit: Value) -> Value:
    """What a counted budget has counted; one inside a stage is found by its own name."""
    used = at.registry.progress.used
    keys = [limit_key(one) for one in at.instance.limits if one.name == limit]
    return float(sum(used.get(key, 0) for key in keys)) if keys else None


FACTS: Mapping[str, Callable[..., Value]] = {
    "truth": _truth,
    "emitted": _emitted,
    "assigned": _assigned,
    "alive": _alive,
    "photographed": _photographed,
    "inspected": _inspected,
    "clear": _clear,
    "replans": _replans,
    "used": _used,
}
"""The functions of a running mission by their names in the language."""
