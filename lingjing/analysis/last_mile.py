"""The five stages of last-mile delivery (the paper's Last-Mile Failure Diagnosis), read from one trace.

- S1: the route was inspected from the air.
- S2: an admitted report of the route's ends (a message of the record type `endpoints`) names both within `ENDS_M`.
- S3: the waypoints that one sender reported (record type `waypoint`) name the vehicle's real way: in their order they
  pass each waypoint between the ends of the route that the vehicle has, or, once it drove, each that its track passed,
  within `ENDS_M`. A route of the shipped missions has four or five waypoints (ADR 0010).
- S4: the vehicle arrived at the stop along the inspected route, by the mission's rule, and its track ends there.
- S5: the dog reached the target house.

A stage that an intervention supplies counts as done. The policy option `intervention` names it: A1 supplies the ends,
A2 and A3 the ends and the waypoints.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import msgspec

from lingjing.analysis.messages import admitted_messages
from lingjing.mission.expression import Call, Symbol
from lingjing.mission.geometry2d import Vector2
from lingjing.mission.instance import InspectionSpec, Instance
from lingjing.plugins.geometry import distance_xy
from lingjing.trace.reader import Trace

STAGES = ("S1", "S2", "S3", "S4", "S5")
ENDS_M = 30.0
"""Largest error of a reported end: the paper's radius of road vehicles and delivery."""

_GIVEN = {"A1": ("S2",), "A2": ("S2", "S3"), "A3": ("S2", "S3")}
"""The stages that each intervention supplies."""


class LastMile(msgspec.Struct, frozen=True, kw_only=True):
    """The stages of one episode: `done` by the agents, and `given` by an intervention."""

    done: tuple[str, ...]
    given: tuple[str, ...] = ()

    @property
    def cumulative(self) -> int:
        """The number of stages that were done or given in a row from S1."""
        count = 0
        for stage in STAGES:
            if stage not in self.done and stage not in self.given:
                break
            count += 1
        return count


def last_mile(trace: Trace) -> LastMile | None:
    """Return the stages of a trace.

    Returns None for a mission without an inspection of a route to a destination, or without reports of its ends.
    """
    instance = trace.header.instance
    inspection = next((spec for spec in instance.inspections if spec.destination), None)
    if inspection is None or not any(message.type == "endpoints" for message in instance.messages):
        return None
    start, end = (_place(instance, name) for name in (inspection.asset, inspection.destination))
    results = (
        _inspected(trace, inspection),
        _ends_named(trace, start, end),
        _way_named(trace, inspection.asset, start, end),
        any(event.bindings == (inspection.destination,) for record in trace.boundaries for event in record.events)
        and _near(_last_place(trace, inspection.asset), end),
        trace.outcome is not None and trace.outcome.success,
    )
    interventions = {str(binding.arguments.get("intervention", "")) for binding in trace.header.bindings}
    supplied = {stage for name in interventions for stage in _GIVEN.get(name, ())}
    return LastMile(
        done=tuple(stage for stage, done in zip(STAGES, results, strict=True) if done),
        given=tuple(stage for stage in STAGES if stage in supplied),
    )


def _place(instance: Instance, name: str) -> Vector2:
    return next(entity.position[:2] for entity in instance.entities if entity.id == name)


def _inspected(trace: Trace, inspection: InspectionSpec) -> bool:
    """Return whether a stage was done that requires nothing but the inspection."""
    condition = Call("inspected", (Symbol(inspection.name),))
    stages = {stage.name for stage in trace.header.instance.stages if stage.condition == condition}
    return any(change.stage in stages for record in trace.boundaries for change in record.stages)


def _ends_named(trace: Trace, start: Vector2, end: Vector2) -> bool:
    for _, body in _reports(trace, "endpoints"):
        ends = (_point(body.get("start")), _point(body.get("target")))
        if all(_near(place, truth) for place, truth in zip(ends, (start, end), strict=True)):
            return True
    return False


def _near(place: Vector2 | None, truth: Vector2) -> bool:
    return place is not None and distance_xy(place, truth) <= ENDS_M


def _way_named(trace: Trace, vehicle: str, start: Vector2, end: Vector2) -> bool:
    """Return whether the waypoints of any sender name the vehicle's way. A later waypoint of the same number counts."""
    waypoints: dict[str, dict[float, Vector2]] = {}
    for sender, body in _reports(trace, "waypoint"):
        place, number = _point(body.get("position")), body.get("number")
        if place is not None and isinstance(number, int | float):
            waypoints.setdefault(sender, {})[float(number)] = place
    way = _real_way(trace, vehicle, start, end)
    ways = [[places[number] for number in sorted(places)] for places in waypoints.values()]
    return bool(way) and any(_passes(places, way) for places in ways)


def _real_way(trace: Trace, vehicle: str, start: Vector2, end: Vector2) -> list[Vector2]:
    """Return the waypoints of the vehicle's last route between the ends. Once it drove, those that its track passed."""
    routes = [route for record in trace.boundaries for route in record.routes if route.entity == vehicle]
    if not routes:
        return []
    between = [
        (point[0], point[1])
        for point in routes[-1].waypoints
        if min(distance_xy(point, start), distance_xy(point, end)) > ENDS_M
    ]
    track = _track(trace, vehicle)
    if not track or distance_xy(track[-1], start) <= ENDS_M:
        return between
    return [point for point in between if any(distance_xy(point, place) <= ENDS_M for place in track)]


def _passes(places: Sequence[Vector2], way: Sequence[Vector2]) -> bool:
    """Return whether places pass all waypoints of a way in their order."""
    left = list(way)
    for place in places:
        if left and distance_xy(place, left[0]) <= ENDS_M:
            left.pop(0)
    return not left


def _track(trace: Trace, vehicle: str) -> list[Vector2]:
    """Return the places of the vehicle at all macro-steps."""
    return [
        state.position[:2]
        for record in trace.boundaries
        for snapshot in record.snapshots
        for state in snapshot.states
        if state.id == vehicle
    ]


def _last_place(trace: Trace, vehicle: str) -> Vector2 | None:
    track = _track(trace, vehicle)
    return track[-1] if track else None


def _reports(trace: Trace, record: str) -> Iterable[tuple[str, dict[str, object]]]:
    """Yield sender and body of the admitted messages of a record type, each once, in order."""
    kinds = {message.kind for message in trace.header.instance.messages if message.type == record}
    for message in admitted_messages(trace):
        if message.kind in kinds:
            yield message.sender, dict(message.body)


def _point(value: object) -> Vector2 | None:
    if isinstance(value, list | tuple) and len(value) >= 2 and all(isinstance(item, int | float) for item in value[:2]):
        return float(value[0]), float(value[1])
    return None
