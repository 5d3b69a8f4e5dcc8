"""Inspections of routes: waypoint by waypoint, at every macro-step, begun anew with every new route.

The road engine plans and publishes routes; here is only looked at who came near which waypoint. A waypoint counts from
the moment its route is known. In strict order the next one counts only after the one before; several may be reached
in one macro-step, by several inspectors too.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

from msgspec.structs import replace

from lingjing.kernel.assignments import point
from lingjing.kernel.progress import EpisodeProgress, Inspected
from lingjing.kernel.registry import Registry, Report
from lingjing.mission.instance import InspectionSpec, Instance
from lingjing.trace.records import BodyState, Route, Snapshot

PLAN = "route"
"""Verb of the kernel-origin command that asks the asset's engine for a route to a place (`x`, `y`)."""

REPLAN = "replan"
"""The same for another route to the same destination that avoids a place (`x`, `y`)."""

RouteRequest = tuple[str, str, tuple[float, float]]
"""An asset, `PLAN` or `REPLAN`, and the place (east, north) that it is about."""


class Inspections:
    """The inspections of one instance; holds no run-time state."""

    def __init__(self, instance: Instance) -> None:
        self._inspections = instance.inspections
        self._entities = {entity.id: entity for entity in instance.entities}

    def wanted(self, tick: int, reports: Sequence[Report]) -> tuple[RouteRequest, ...]:
        """The routes to ask for at the boundary `tick`: the first ones, and what the admitted messages ask for.

        Several messages of one boundary that say the same place ask once.
        """
        if not self._inspections:
            return ()
        asked: dict[RouteRequest, None] = {}
        for inspection in self._inspections:
            if tick == 1 and inspection.destination:
                east, north, _ = self._entities[inspection.destination].position
                asked[inspection.asset, PLAN, (east, north)] = None
            for message in reports:
                place = point(message.body.get("position"))
                if message.kind == inspection.replan and place is not None:
                    asked[inspection.asset, REPLAN, place] = None
        return tuple(asked)

    def follow(self, before: Registry, registry: Registry, snapshots: Iterable[Snapshot]) -> Registry:
        """The registry with what was inspected during the macro-steps that led to it."""
        if not self._inspections:
            return registry
        progress = before.progress
        for snapshot in snapshots:
            states = {state.id: state for state in snapshot.states}
            for inspection in self._inspections:
                route = _current(inspection.asset, before, registry, snapshot.time_s)
                if route is not None:
                    progress = _looked(progress, inspection, route, states, snapshot.time_s)
        return replace(registry, progress=replace(registry.progress, inspected=progress.inspected))


def _current(asset: str, before: Registry, registry: Registry, time_s: float) -> Route | None:
    """The asset's route as it was known at a time within the tick."""
    latest = registry.routes.get(asset)
    if latest is not None and latest.time_s <= time_s:
        return latest
    return before.routes.get(asset)


def _looked(
    progress: EpisodeProgress, inspection: InspectionSpec, route: Route, states: Mapping[str, BodyState], time_s: float
) -> EpisodeProgress:
    known = progress.inspected.get(inspection.name, Inspected())
    if known.route != route.number:
        known = Inspected(route=route.number)
    if known.complete_s is None:
        known = _seen(known, inspection, route, states, time_s)
    if progress.inspected.get(inspection.name) == known:
        return progress
    return replace(progress, inspected={**progress.inspected, inspection.name: known})


def _seen(
    known: Inspected, inspection: InspectionSpec, route: Route, states: Mapping[str, BodyState], time_s: float
) -> Inspected:
    seen = set(known.seen)
    eyes = [states[name].position for name in inspection.by if name in states]
    for number, waypoint in enumerate(route.waypoints):
        if number in seen:
            continue
        near = any(math.dist(eye[:2], waypoint[:2]) <= inspection.within_m for eye in eyes)
        if near:
            seen.add(number)
        elif inspection.order == "strict":
            break
    complete = time_s if len(seen) == len(route.waypoints) else None
    return replace(known, seen=frozenset(seen), complete_s=complete)
