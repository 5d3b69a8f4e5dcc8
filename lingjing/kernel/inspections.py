"""Inspections of routes: waypoint by waypoint, at every macro-step, restarted with every new route.

The road engine plans and publishes routes. This module checks which inspector came near which waypoint. A waypoint
counts only after its route is known. In strict order a waypoint counts only after the one before. Several waypoints may
be reached in one macro-step, also by different inspectors.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence

from msgspec.structs import replace

from lingjing.kernel.assignments import point
from lingjing.kernel.progress import EpisodeProgress, Inspected
from lingjing.kernel.registry import Registry, Report
from lingjing.mission.instance import InspectionSpec, Instance
from lingjing.scene.camera_geometry import in_image, world_to_pixel
from lingjing.trace.records import BodyState, FrameInfo, Route, Snapshot

PLAN = "route"
"""Verb of the kernel's own command that requests a route from the asset's engine to a place (`x`, `y`)."""

REPLAN = "replan"
"""Verb of the kernel's own command that requests another route to the same destination which avoids a place (`x`,
`y`).
"""

RouteRequest = tuple[str, str, tuple[float, float]]
"""An asset, `PLAN` or `REPLAN`, and a place in metres (east, north)."""


class Inspections:
    """The inspections of one instance. Holds no run-time state."""

    def __init__(self, instance: Instance) -> None:
        self._inspections = instance.inspections
        self._entities = {entity.id: entity for entity in instance.entities}

    def route_requests(self, tick: int, reports: Sequence[Report]) -> tuple[RouteRequest, ...]:
        """Return the routes to request at the boundary `tick`: the first routes, and those that admitted messages
        request.

        Several messages of one boundary with the same place cause one request.
        """
        if not self._inspections:
            return ()
        requests: dict[RouteRequest, None] = {}
        for inspection in self._inspections:
            if tick == 1 and inspection.destination:
                east, north, _ = self._entities[inspection.destination].position
                requests[inspection.asset, PLAN, (east, north)] = None
            for message in reports:
                place = point(message.body.get("position"))
                if message.kind == inspection.replan and place is not None:
                    requests[inspection.asset, REPLAN, place] = None
        return tuple(requests)

    def advance(self, before: Registry, registry: Registry, snapshots: Iterable[Snapshot]) -> Registry:
        """Return the registry with the waypoints that were inspected during the macro-steps that led to it."""
        if not self._inspections:
            return registry
        progress = before.progress
        for snapshot in snapshots:
            states = {state.id: state for state in snapshot.states}
            for inspection in self._inspections:
                route = _current(inspection.asset, before, registry, snapshot.time_s)
                if route is not None and (not inspection.pictured or snapshot.time_s == registry.time_s):
                    shown = _pictures_of(inspection, registry) if inspection.pictured else None
                    progress = _with_progress(progress, inspection, route, states, snapshot.time_s, shown)
        return replace(registry, progress=replace(registry.progress, inspected=progress.inspected))


def _current(asset: str, before: Registry, registry: Registry, time_s: float) -> Route | None:
    """Return the asset's route as it was known at a time within the tick."""
    latest = registry.routes.get(asset)
    if latest is not None and latest.time_s <= time_s:
        return latest
    return before.routes.get(asset)


def _with_progress(
    progress: EpisodeProgress,
    inspection: InspectionSpec,
    route: Route,
    states: Mapping[str, BodyState],
    time_s: float,
    shown: Sequence[FrameInfo] | None,
) -> EpisodeProgress:
    """Return the progress with the waypoints that inspectors are near to.

    With `shown`, a waypoint counts only if one of these pictures of a near inspector shows it.
    """
    known = progress.inspected.get(inspection.name, Inspected())
    if known.route != route.number:
        known = Inspected(route=route.number)
    if known.complete_s is None:
        known = _with_visits(known, inspection, route, states, time_s, shown)
    if progress.inspected.get(inspection.name) == known:
        return progress
    return replace(progress, inspected={**progress.inspected, inspection.name: known})


def _with_visits(
    known: Inspected,
    inspection: InspectionSpec,
    route: Route,
    states: Mapping[str, BodyState],
    time_s: float,
    shown: Sequence[FrameInfo] | None,
) -> Inspected:
    seen = set(known.seen)
    positions = {name: states[name].position for name in inspection.by if name in states}
    for number, waypoint in enumerate(route.waypoints):
        if number in seen:
            continue
        near = {
            name for name, position in positions.items() if math.dist(position[:2], waypoint[:2]) <= inspection.within_m
        }
        if near and (shown is None or any(frame.entity in near and _shows(frame, waypoint) for frame in shown)):
            seen.add(number)
        elif inspection.order == "strict":
            break
    complete = time_s if len(seen) == len(route.waypoints) else None
    return replace(known, seen=frozenset(seen), complete_s=complete)


def _pictures_of(inspection: InspectionSpec, registry: Registry) -> tuple[FrameInfo, ...]:
    """The pictures that the inspectors took at the registry's boundary."""
    return tuple(
        frame
        for frame in itertools.takewhile(lambda frame: frame.tick == registry.tick, registry.frames.newest())
        if frame.entity in inspection.by
    )


def _shows(frame: FrameInfo, place: Sequence[float]) -> bool:
    """True if the place projects into the picture. Buildings in between are not looked at."""
    pixel = world_to_pixel(frame.pose, (place[0], place[1], place[2] if len(place) > 2 else 0.0))
    return pixel is not None and in_image(frame.pose, pixel[0], pixel[1])
