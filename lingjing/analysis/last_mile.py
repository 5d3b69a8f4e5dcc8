"""The five stages of last-mile delivery (the paper's Last-Mile Failure Diagnosis), read from one trace.

S1: the route was inspected from the air. S2: an admitted report of the route's ends (a message made of the record
`endpoints`) names both within `ENDS_M`. S3: the reports of one sender on the places that the route passes (the record
`waypoint`) lie on the road graph between the ends, in an order that can be driven. S4: the vehicle arrived along the
inspected route, as the engine and the mission's rule say. S5: the dog reached the target house. A stage that an
intervention gives (`intervention` of the policy: A1 the ends, A2 and A3 the way too) counts as done. Where the city is
no longer to be had exactly as it was, S3 is not done.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import msgspec

from lingjing.analysis.messages import admitted
from lingjing.analysis.played_city import city_of
from lingjing.mission.expression import Call, Symbol
from lingjing.mission.geometry2d import Vector2
from lingjing.mission.instance import InspectionSpec, Instance
from lingjing.plugins.geometry import distance_xy
from lingjing.scene.road_map import RoadMap, read_road_map
from lingjing.trace.reader import Trace

STAGES = ("S1", "S2", "S3", "S4", "S5")
ENDS_M = 30.0
"""How near a reported end must be: the paper's radius of road vehicles and delivery."""

ON_ROAD_M = 15.0
"""How far off a road a reported place may lie."""

DETOUR = 1.5
"""A way along the reported places is at most so many times as long as the shortest."""

_GIVEN = {"A1": ("S2",), "A2": ("S2", "S3"), "A3": ("S2", "S3")}


class LastMile(msgspec.Struct, frozen=True, kw_only=True):
    """Which stages were done by themselves, which were given, and how many are done in a row from S1."""

    done: tuple[str, ...]
    given: tuple[str, ...] = ()

    @property
    def cumulative(self) -> int:
        """Stages that were done or given, one after the other from S1."""
        count = 0
        for stage in STAGES:
            if stage not in self.done and stage not in self.given:
                break
            count += 1
        return count


def last_mile(trace: Trace) -> LastMile | None:
    """The stages of a trace; None for a mission that inspects no route to a destination, or in which nobody may report
    the route's ends."""
    instance = trace.header.instance
    inspection = next((one for one in instance.inspections if one.destination), None)
    if inspection is None or not any(message.type == "endpoints" for message in instance.messages):
        return None
    start, end = (_place(instance, name) for name in (inspection.asset, inspection.destination))
    reports = (
        _inspected(trace, inspection),
        _ends_named(trace, start, end),
        _way_named(trace, start, end),
        any(event.bindings == (inspection.destination,) for record in trace.boundaries for event in record.events),
        trace.outcome is not None and trace.outcome.success,
    )
    asked = {str(binding.arguments.get("intervention", "")) for binding in trace.header.bindings}
    given = {stage for name in asked for stage in _GIVEN.get(name, ())}
    return LastMile(
        done=tuple(stage for stage, done in zip(STAGES, reports, strict=True) if done),
        given=tuple(stage for stage in STAGES if stage in given),
    )


def _place(instance: Instance, entity: str) -> Vector2:
    return next(one.position[:2] for one in instance.entities if one.id == entity)


def _inspected(trace: Trace, inspection: InspectionSpec) -> bool:
    """Whether a stage that asks for the inspection alone was done."""
    asked = Call("inspected", (Symbol(inspection.name),))
    wanted = {stage.name for stage in trace.header.instance.stages if stage.condition == asked}
    return any(change.stage in wanted for record in trace.boundaries for change in record.stages)


def _ends_named(trace: Trace, start: Vector2, end: Vector2) -> bool:
    for _, body in _reports(trace, "endpoints"):
        named = (_point(body.get("start")), _point(body.get("target")))
        if all(_near(place, due) for place, due in zip(named, (start, end), strict=True)):
            return True
    return False


def _near(place: Vector2 | None, due: Vector2) -> bool:
    return place is not None and distance_xy(place, due) <= ENDS_M


def _way_named(trace: Trace, start: Vector2, end: Vector2) -> bool:
    """Whether some sender's places make a way; those of one number are replaced by later ones."""
    named: dict[str, dict[float, Vector2]] = {}
    for sender, body in _reports(trace, "waypoint"):
        place, number = _point(body.get("position")), body.get("number")
        if place is not None and isinstance(number, int | float):
            named.setdefault(sender, {})[float(number)] = place
    ways = [[places[number] for number in sorted(places)] for places in named.values()]
    if not ways:
        return False
    city = city_of(trace)
    if city is None or not city.network:
        return False
    roads = read_road_map(city.network)
    return any(_drivable(roads, start, way, end) for way in ways)


def _drivable(roads: RoadMap, start: Vector2, places: Sequence[Vector2], end: Vector2) -> bool:
    """Whether places lie on roads, one of them between the ends, and can be driven through in their order."""
    between = [place for place in places if min(distance_xy(place, start), distance_xy(place, end)) > ENDS_M]
    shortest = roads.way(start, end)
    nearest = [roads.nearest(place) for place in between]
    if not between or shortest is None or any(one is None or one.off_m > ON_ROAD_M for one in nearest):
        return False
    legs = [roads.way(a, b) for a, b in zip((start, *between), (*between, end), strict=True)]
    length = sum(leg.length_m for leg in legs if leg is not None)
    return None not in legs and length <= DETOUR * shortest.length_m


def _reports(trace: Trace, record: str) -> Iterable[tuple[str, dict[str, object]]]:
    """Sender and body of the admitted messages that are made of a record, each once, in order."""
    kinds = {message.kind for message in trace.header.instance.messages if message.type == record}
    for message in admitted(trace):
        if message.kind in kinds:
            yield message.sender, dict(message.body)


def _point(value: object) -> Vector2 | None:
    if isinstance(value, list | tuple) and len(value) >= 2 and all(isinstance(one, int | float) for one in value[:2]):
        return float(value[0]), float(value[1])
    return None
