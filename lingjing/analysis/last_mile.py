"""The five stages of last-mile delivery (the paper's Last-Mile Failure Diagnosis), read from one trace.

- S1: the route was inspected from the air.
- S2: an admitted report of the route's ends (a message of the record type `endpoints`) names both within `ENDS_M`.
- S3: the waypoints that one sender reported (record type `waypoint`) lie on the road graph between the ends, in an
  order that can be driven. S3 counts as not done if the city cannot be rebuilt exactly. A
  route of the shipped missions has four or five waypoints (ADR 0010).
- S4: the vehicle arrived along the inspected route, by the mission's rule.
- S5: the dog reached the target house.

A stage that an intervention supplies counts as done. The policy option `intervention` names it: A1 supplies the ends,
A2 and A3 the ends and the waypoints.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import msgspec

from lingjing.analysis.messages import admitted_messages
from lingjing.analysis.played_city import city_of
from lingjing.mission.expression import Call, Symbol
from lingjing.mission.geometry2d import Vector2
from lingjing.mission.instance import InspectionSpec, Instance
from lingjing.plugins.geometry import distance_xy
from lingjing.scene.road_map import RoadMap, read_road_map
from lingjing.trace.reader import Trace

STAGES = ("S1", "S2", "S3", "S4", "S5")
ENDS_M = 30.0
"""Largest error of a reported end: the paper's radius of road vehicles and delivery."""

ON_ROAD_M = 15.0
"""Largest distance of a reported waypoint from a road. Chosen."""

DETOUR = 1.5
"""Largest ratio of the length along the reported waypoints to the shortest way. Chosen."""

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
        _way_named(trace, start, end),
        any(event.bindings == (inspection.destination,) for record in trace.boundaries for event in record.events),
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


def _way_named(trace: Trace, start: Vector2, end: Vector2) -> bool:
    """Return whether the waypoints of any sender form a drivable way. A later waypoint of the same number counts."""
    waypoints: dict[str, dict[float, Vector2]] = {}
    for sender, body in _reports(trace, "waypoint"):
        place, number = _point(body.get("position")), body.get("number")
        if place is not None and isinstance(number, int | float):
            waypoints.setdefault(sender, {})[float(number)] = place
    ways = [[places[number] for number in sorted(places)] for places in waypoints.values()]
    if not ways:
        return False
    city = city_of(trace)
    if city is None or not city.network:
        return False
    roads = read_road_map(city.network)
    return any(_drivable(roads, start, way, end) for way in ways)


def _drivable(roads: RoadMap, start: Vector2, places: Sequence[Vector2], end: Vector2) -> bool:
    """Return whether waypoints lie on roads, at least one of them between the ends, and can be driven in order."""
    between = [place for place in places if min(distance_xy(place, start), distance_xy(place, end)) > ENDS_M]
    shortest = roads.way(start, end)
    nearest = [roads.nearest(place) for place in between]
    if not between or shortest is None or any(road is None or road.off_m > ON_ROAD_M for road in nearest):
        return False
    legs = [roads.way(a, b) for a, b in zip((start, *between), (*between, end), strict=True)]
    length = sum(leg.length_m for leg in legs if leg is not None)
    return None not in legs and length <= DETOUR * shortest.length_m


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
