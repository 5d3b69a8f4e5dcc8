"""The functions a rule may call: distances, boxes, ground truth, task events, assignments.

Each takes evaluated arguments and the instant. Total: what does not exist is `None` and makes a predicate false.
Distances are planar metres, boxes normalised image boxes. Numbers that decide are left in the instant's evidence.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

from lingjing.kernel.assignments import point
from lingjing.kernel.budgets import limit_key
from lingjing.kernel.instant import Instant, Value
from lingjing.mission.instance import Entity
from lingjing.trace.records import DORMANT

HANDOFF_M = 50.0
"""How near a destination must be to a target for `assigned` to mean that target (the paper's vessel radius)."""

SAME_POINT_M = 1.0
"""A destination this near a matched report's position was taken from it."""


def planar(value: Value, at: Instant) -> tuple[float, float] | None:
    """East and north of a position or of an entity's current position."""
    if isinstance(value, Entity):
        state = at.states.get(value.id)
        return None if state is None else (state.position[0], state.position[1])
    return point(value)


def _distance_xy(arguments: Sequence[Value], at: Instant) -> Value:
    first = planar(arguments[0], at)
    second = planar(arguments[1], at)
    if first is None or second is None:
        return None
    distance = math.hypot(first[0] - second[0], first[1] - second[1])
    at.evidence["distance_m"] = distance
    return distance


def overlap(first: tuple[float, ...], second: tuple[float, ...]) -> float:
    """Intersection over union of two boxes (x_min, y_min, x_max, y_max); 0 for an empty one."""
    width = min(first[2], second[2]) - max(first[0], second[0])
    height = min(first[3], second[3]) - max(first[1], second[1])
    if width <= 0 or height <= 0:
        return 0.0
    shared = width * height
    union = _area(first) + _area(second) - shared
    return shared / union if union > 0 else 0.0


def _area(box: tuple[float, ...]) -> float:
    return max(0.0, box[2] - box[0]) * max(0.0, box[3] - box[1])


def _iou(arguments: Sequence[Value], at: Instant) -> Value:
    first, second = arguments[:2]
    if not _is_box(first) or not _is_box(second):
        return None
    value = overlap(first, second)  # type: ignore[arg-type]
    at.evidence["iou"] = value
    return value


def _is_box(value: Value) -> bool:
    return isinstance(value, tuple) and len(value) == 4 and all(isinstance(item, int | float) for item in value)


def _truth(arguments: Sequence[Value], at: Instant) -> Value:
    """The ground-truth box of an entity in a frame, or None where no pixel of it is visible."""
    entity, frame = arguments[:2]
    info = at.registry.frames.get(frame) if isinstance(frame, str) else None
    if info is None or not isinstance(entity, Entity):
        return None
    return next((box for box in info.boxes if box.entity == entity.id), None)


def _emitted(arguments: Sequence[Value], at: Instant) -> Value:
    """An engine has emitted the task event `kind` about every entity given, by this instant."""
    kind, *entities = arguments
    names = {entity.id for entity in entities if isinstance(entity, Entity)}
    return any(
        emitted == kind and time_s <= at.time_s and names.issubset(about)
        for (emitted, about), time_s in at.registry.emitted.items()
    )


def _assigned(arguments: Sequence[Value], at: Instant) -> Value:
    """A destination that the resource was given last means this target (see `HANDOFF_M`, `SAME_POINT_M`)."""
    resource, target = arguments[:2]
    if not isinstance(resource, Entity) or not isinstance(target, Entity):
        return None
    here = planar(target, at)
    reported = at.registry.sightings.get(target.id, ())
    return any(
        (here is not None and math.dist((item.east, item.north), here) <= HANDOFF_M)
        or any(math.dist((item.east, item.north), point) <= SAME_POINT_M for point in reported)
        for item in at.registry.assignments.get(resource.id, ())
    )


def _numbers(arguments: Sequence[Value]) -> list[float] | None:
    """The arguments as numbers; None if one of them is none."""
    numbers = [float(value) for value in arguments if isinstance(value, int | float) and not isinstance(value, bool)]
    return numbers if numbers and len(numbers) == len(arguments) else None


def _min(arguments: Sequence[Value], at: Instant) -> Value:
    numbers = _numbers(arguments)
    return min(numbers) if numbers else None


def _max(arguments: Sequence[Value], at: Instant) -> Value:
    numbers = _numbers(arguments)
    return max(numbers) if numbers else None


def _abs(arguments: Sequence[Value], at: Instant) -> Value:
    numbers = _numbers(arguments)
    return abs(numbers[0]) if numbers else None


def _inspected(arguments: Sequence[Value], at: Instant) -> Value:
    """Every waypoint of the route as it is now has been inspected by this instant."""
    known = at.registry.course.inspected.get(str(arguments[0]))
    return known is not None and known.complete_s is not None and known.complete_s <= at.time_s


def _clear(arguments: Sequence[Value], at: Instant) -> Value:
    """No target that blocks, and is there, stands within its radius of a waypoint of the route as it is now: waypoints
    are what is inspected, so a jam between two of them is nobody's to find."""
    inspection = next((one for one in at.instance.inspections if one.name == arguments[0]), None)
    route = at.registry.routes.get(inspection.asset) if inspection is not None else None
    if route is None:
        return None
    return not any(_blocks(entity, route.waypoints, at) for entity in at.instance.entities)


def _blocks(entity: Entity, waypoints: Sequence[tuple[float, ...]], at: Instant) -> bool:
    radius, here = entity.properties.get("radius_m"), planar(entity, at)
    if entity.properties.get("blocks") is not True or here is None or not isinstance(radius, int | float):
        return False
    if at.states[entity.id].status in (DORMANT, "cleared"):
        return False
    return any(math.dist(here, waypoint[:2]) <= radius for waypoint in waypoints)


def _replans(arguments: Sequence[Value], at: Instant) -> Value:
    """How often the route was planned anew: routes are numbered from 1."""
    inspection = next((one for one in at.instance.inspections if one.name == arguments[0]), None)
    route = at.registry.routes.get(inspection.asset) if inspection is not None else None
    return None if inspection is None else float(max(0, route.number - 1) if route is not None else 0)


def _used(arguments: Sequence[Value], at: Instant) -> Value:
    """What a counted budget has counted; one inside a stage is found by its own name."""
    used = at.registry.course.used
    keys = [limit_key(limit) for limit in at.instance.limits if limit.name == arguments[0]]
    return float(sum(used.get(key, 0) for key in keys)) if keys else None


FUNCTIONS: Mapping[str, Callable[[Sequence[Value], Instant], Value]] = {
    "distance_xy": _distance_xy,
    "iou": _iou,
    "truth": _truth,
    "emitted": _emitted,
    "assigned": _assigned,
    "min": _min,
    "max": _max,
    "abs": _abs,
    "inspected": _inspected,
    "clear": _clear,
    "replans": _replans,
    "used": _used,
}
"""Every function of a rule by its name in the language."""
