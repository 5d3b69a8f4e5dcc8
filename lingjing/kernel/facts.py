"""Functions that need a running mission: ground truth, task events, assignments, routes, counted budgets.

Each function receives the evaluation context and evaluated arguments. A missing value is `None`; nothing raises.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

from lingjing.kernel.assignments import point
from lingjing.kernel.budgets import limit_key
from lingjing.kernel.context import RuntimeContext
from lingjing.mission.instance import Entity
from lingjing.mission.operations import is_box
from lingjing.mission.values import Value
from lingjing.mission.vocabulary import CLEARED, DORMANT
from lingjing.plugins.bodies import entity_size
from lingjing.scene.camera_geometry import pixel_ray
from lingjing.scene.lines import project
from lingjing.trace.records import DEAD, BodyState

HANDOFF_M = 50.0
"""Largest distance in metres between a destination and a target that it refers to in `assigned` (the paper's vessel
radius).
"""

FARTHEST_M = 10_000.0
"""Length of a camera's ray that does not meet the ground, metres (chosen: beyond the largest district)."""

SAME_POINT_M = 1.0
"""Largest distance in metres between a destination and the matched report's position from which it was copied.
Chosen.
"""


def _truth(at: RuntimeContext, entity: Value, frame: Value) -> Value:
    """Return the ground-truth box of an entity in a frame, or None if no pixel of it is visible."""
    info = at.registry.frames.get(frame) if isinstance(frame, str) else None
    if info is None or not isinstance(entity, Entity):
        return None
    return next((box for box in info.boxes if box.entity == entity.id), None)


def _ray_distance(at: RuntimeContext, frame: Value, box: Value, place: Value) -> Value:
    """Return the horizontal distance in metres of a place from the camera's ray through the middle of a box.

    The ray begins at the camera and ends at the ground or the water, or after `FARTHEST_M` if it does not fall. None
    without the picture, a box or a place.
    """
    info = at.registry.frames.get(frame) if isinstance(frame, str) else None
    reported = point(place)
    if info is None or not is_box(box) or reported is None:
        return None
    pose = info.pose
    ray = pixel_ray(pose, (box[0] + box[2]) / 2.0 * pose.width, (box[1] + box[3]) / 2.0 * pose.height)
    fall = pose.position[2] - min(0.0, at.instance.scene.datum_m)
    level = math.hypot(ray[0], ray[1])
    length = min(FARTHEST_M, fall / -ray[2] * level if ray[2] < 0.0 else FARTHEST_M)
    east, north = reported[0] - pose.position[0], reported[1] - pose.position[1]
    along = 0.0 if level == 0.0 else min(max((east * ray[0] + north * ray[1]) / level, 0.0), max(length, 0.0))
    ahead = (0.0, 0.0) if level == 0.0 else (along * ray[0] / level, along * ray[1] / level)
    return math.hypot(east - ahead[0], north - ahead[1])


def _edge_error(at: RuntimeContext, frame: Value, first: Value, second: Value) -> Value:
    """Return the largest distance between the same edges of two boxes, in pixels of the picture; None without one."""
    info = at.registry.frames.get(frame) if isinstance(frame, str) else None
    if info is None or not is_box(first) or not is_box(second):
        return None
    sizes = (info.pose.width, info.pose.height, info.pose.width, info.pose.height)
    return max(abs(a - b) * size for a, b, size in zip(first, second, sizes, strict=True))


def _emitted(at: RuntimeContext, kind: Value, *entities: Value) -> Value:
    """Return whether an engine has emitted the task event `kind` about all these entities by this instant."""
    names = {entity.id for entity in entities if isinstance(entity, Entity)}
    return any(
        emitted == kind and time_s <= at.time_s and names.issubset(about)
        for (emitted, about), time_s in at.registry.emitted.items()
    )


def _assigned(at: RuntimeContext, resource: Value, target: Value) -> Value:
    """Return whether the latest destinations of the resource refer to this target (see `HANDOFF_M`, `SAME_POINT_M`)."""
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
    """Return whether the asset is present and not dead."""
    state = at.states.get(asset.id) if isinstance(asset, Entity) else None
    return state is not None and state.status not in (DEAD, DORMANT)


def _photographed(at: RuntimeContext, asset: Value) -> Value:
    """Return whether a camera of the asset has taken a picture. Reference pictures belong to no asset."""
    return isinstance(asset, Entity) and any(frame.entity == asset.id for frame in at.registry.frames.values())


def _inspected(at: RuntimeContext, inspection: Value) -> Value:
    """Return whether every waypoint of the present route has been inspected by this instant."""
    known = at.registry.progress.inspected.get(str(inspection))
    return known is not None and known.complete_s is not None and known.complete_s <= at.time_s


def _clear(at: RuntimeContext, inspection: Value) -> Value:
    """Return whether no present target blocks a waypoint of the present route (`Entity.blocked_m`).

    Only waypoints are inspected, so a jam between two of them does not count. With `pictured`, pictures also show the
    road between the waypoints, and such a jam counts: a car that stood behind it would measure its place.
    """
    declared = next((inspected for inspected in at.instance.inspections if inspected.name == inspection), None)
    route = at.registry.routes.get(declared.asset) if declared is not None else None
    if route is None:
        return None
    whole = declared is not None and declared.pictured
    return not any(_blocks(entity, route.waypoints, at, whole=whole) for entity in at.instance.entities)


def _blocks(entity: Entity, waypoints: Sequence[tuple[float, ...]], at: RuntimeContext, *, whole: bool) -> bool:
    """Return whether the entity is present, and blocks a waypoint, or with `whole` any place of the way along them."""
    radius, here = entity.blocked_m, at.place(entity)
    if radius is None or here is None:
        return False
    if at.states[entity.id].status in (DORMANT, CLEARED):
        return False
    if whole and len(waypoints) > 1:
        return project([(place[0], place[1]) for place in waypoints], here.east, here.north).off_m <= radius
    return any(math.dist((here.east, here.north), waypoint[:2]) <= radius for waypoint in waypoints)


def _speed(at: RuntimeContext, body: Value) -> Value:
    """Return the speed of a body in metres per second, in three dimensions; None if it is not there."""
    state = _present(at, body)
    return None if state is None else math.hypot(*state.velocity)


def _line_of_sight(at: RuntimeContext, first: Value, second: Value) -> Value:
    """Return whether the city leaves the line between the middles of two bodies free; False if one is not there."""
    ends = []
    for body in (first, second):
        state = _present(at, body)
        if state is None:
            return False
        east, north, up = state.position
        ends.append((east, north, up + entity_size(body).height_m / 2.0))
    return at.sight.is_free(*ends)


def _present(at: RuntimeContext, body: Value) -> BodyState | None:
    state = at.states.get(body.id) if isinstance(body, Entity) else None
    return None if state is None or state.status == DORMANT else state


def _replans(at: RuntimeContext, inspection: Value) -> Value:
    """Return how often the route was planned again. Routes are numbered from 1."""
    declared = next((inspected for inspected in at.instance.inspections if inspected.name == inspection), None)
    route = at.registry.routes.get(declared.asset) if declared is not None else None
    return None if declared is None else float(max(0, route.number - 1) if route is not None else 0)


def _used(at: RuntimeContext, limit: Value) -> Value:
    """Return the count of a budget; a budget inside a stage is found by its own name."""
    used = at.registry.progress.used
    keys = [limit_key(spec) for spec in at.instance.limits if spec.name == limit]
    return float(sum(used.get(key, 0) for key in keys)) if keys else None


def _count(at: RuntimeContext, name: Value, *entities: Value) -> Value:
    """Return how often an event of the mission occurred, or an interaction with all these entities was performed."""
    if any(event.name == name for event in at.instance.events):
        occurred = (item.tick * at.instance.clock.tick_s for item in at.registry.occurrences if item.event == name)
        return float(sum(time_s <= at.time_s for time_s in occurred))
    names = {entity.id for entity in entities if isinstance(entity, Entity)}
    earlier = sum(
        number for (kind, about), number in at.registry.counts.items() if kind == name and names.issubset(about)
    )
    recent = sum(
        kind == name and time_s <= at.time_s and names.issubset(about) for kind, about, time_s in at.registry.recent
    )
    return float(earlier + recent)


FACTS: Mapping[str, Callable[..., Value]] = {
    "truth": _truth,
    "edge_error": _edge_error,
    "ray_distance": _ray_distance,
    "emitted": _emitted,
    "assigned": _assigned,
    "alive": _alive,
    "photographed": _photographed,
    "inspected": _inspected,
    "clear": _clear,
    "replans": _replans,
    "speed": _speed,
    "line_of_sight": _line_of_sight,
    "used": _used,
    "count": _count,
}
"""The functions of a running mission by their names in the language."""
