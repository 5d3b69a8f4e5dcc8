"""The bodies of other engines in the simulation: set at each of its steps, moved on along their velocity.

What walks is a person of SUMO's, placed freely; what is as large as a car is a vehicle. Whoever drives there brakes
for them. Only bodies beside a road and near its height count, so aircraft, boats and far people cost one look-up.

SUMO sees a person once it is in a car's own lane, which is too late to stop for one who walks on without looking. So
who is about to step onto a lane has heralds: stand-ins where it will be in one, two and three seconds.

A stand-in is in one lane of SUMO's and slows the cars of that lane alone. A car that changes lanes for it is still
partly in its lane when it passes (`lateral_motion`). So a body that touches a second lane, or almost does, blocks that
lane too: it has stand-ins in the middle of each. SUMO does not look at persons of the lane that a car changes to, so
the cars just before a body keep their lanes; those farther back go around.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from lingjing.engines.bodies import floats, is_gone, mirror_size
from lingjing.engines.road.graph import Graph, LanePoint
from lingjing.engines.road.simulation import FOREVER_S, Simulation, SumoError
from lingjing.mission.instance import Entity
from lingjing.scene.lines import project
from lingjing.scene.sizes import Size
from lingjing.trace.records import BodyState

_HEIGHT_M = 2.5
_ROAD_M = 60.0
_LANE_REACH_M = 4.0
_WALKING_MPS = 0.2
_LEADS_S = (1.0, 2.0, 3.0)
_VEHICLE_LENGTH_M = 1.6
_SIDE_M = 0.2
"""Room that cars of its lane leave beside a body. SUMO knows no heading of a person, so one counts as wide as it is
long."""
_TOUCH_M = 0.5
"""A lane whose edge is no farther than this from a body is one that it blocks (chosen: buses leave 0.4 m of a lane)."""
_KEEPS_LANE_M = 60.0
"""So far before a body on a lane no vehicle changes lanes: more than the way to stop from 70 km/h, and what a change
shown at walking speed takes at 50 km/h."""
_KEEP_LANE = 512
"""SUMO's lane change mode without any change but to avoid a collision."""
_BLOCKERS_APART_M = 3.0
"""Stand-ins of a long body in the middle of a lane are no farther apart than this."""
_BLOCKER = Size(0.7, 0.7, 0.5)
"""A stand-in in the middle of a lane."""
_FREELY = 6
_FREELY_BY_CAR = 2


@dataclass(frozen=True, slots=True)
class ForeignBody:
    """A foreign body near a road: its state at the interval's start, its size, how many seconds ahead it is shown."""

    state: BodyState
    size: Size
    drives: bool
    leads_s: tuple[float, ...] = (0.0,)
    beside: tuple[tuple[str, tuple[float, float]], ...] = ()
    """Stand-ins in the middles of several lanes that it blocks: a name each, and how far east and north of it."""

    def at(self, ahead_s: float) -> tuple[float, float]:
        """Its place later on."""
        (x, y, _), (east, north, _) = self.state.position, self.state.velocity
        return (x + east * ahead_s, y + north * ahead_s)


class ForeignBodies:
    """Keeps the simulation's stand-ins of foreign bodies; `bodies` are those near a road now, by id."""

    def __init__(self, sim: Simulation, graph: Graph, entities: Sequence[Entity], highest_m: float) -> None:
        """`highest_m` is the elevation of the highest road."""
        self.bodies: dict[str, ForeignBody] = {}
        self._sim = sim
        self._graph = graph
        self._entities = {entity.id: entity for entity in entities}
        self._present: dict[str, bool] = {}
        self._time_s = 0.0
        self._entries = 0
        self._types: set[str] = set()
        self._highest_m = highest_m
        self._kept: dict[str, int] = {}

    def look(self, mirrors: Sequence[BodyState], time_s: float) -> None:
        """Take the mirrors of time `time_s`."""
        self._time_s = time_s
        self.bodies = {body.state.id: body for body in self._near(mirrors)}
        wanted = {_stand_in(body.state.id, lead) for body in self.bodies.values() for lead in body.leads_s}
        wanted |= {name for body in self.bodies.values() for name, _ in body.beside}
        for name in [name for name in self._present if name not in wanted]:
            self._remove(name)

    def step(self, time_s: float) -> None:
        """Set every stand-in to where its body will be at `time_s`, the end of the coming step."""
        for body in self.bodies.values():
            for lead in body.leads_s:
                self._set(_stand_in(body.state.id, lead), body, time_s - self._time_s + lead)
            for name, (east, north) in body.beside:
                x, y = body.at(time_s - self._time_s)
                self._set_beside(name, x + east, y + north)
        self._keep_lanes()

    def _keep_lanes(self) -> None:
        """Let no vehicle change lanes that is just before a body on its stretch of road; others may again."""
        vehicles, coming = self._sim.vehicle, set(self._coming())
        for name in coming - self._kept.keys():
            self._kept[name] = vehicles.getLaneChangeMode(name)
            vehicles.setLaneChangeMode(name, _KEEP_LANE)
        for name in [name for name in self._kept if name not in coming]:
            before = self._kept.pop(name)
            if name in vehicles.getIDList() and vehicles.getLaneChangeMode(name) == _KEEP_LANE:
                vehicles.setLaneChangeMode(name, before)

    def _coming(self) -> Iterator[str]:
        """The vehicles just before the bodies that are on a lane or touch one, on the edges of those lanes."""
        for body in self.bodies.values():
            x, y, _ = body.state.position
            near = self._graph.places(x, y, body.size.length_m + _LANE_REACH_M)
            if not any(place.off_m <= place.lane.width_m / 2.0 + _touch_m(body, place) for place in near):
                continue
            for place in near:
                for name in self._sim.lane.getLastStepVehicleIDs(place.lane.id):
                    if 0.0 < place.at_m - self._sim.vehicle.getLanePosition(name) < _KEEPS_LANE_M:
                        yield name

    def _set_beside(self, name: str, x: float, y: float) -> None:
        """Put a stand-in into the middle of a lane: a person, whatever the body is."""
        if name not in self._present:
            self._enter_person(name, self._declared(_BLOCKER, drives=False), x, y)
        self._sim.person.moveToXY(name, "", x, y, 0.0, _FREELY)

    def _set(self, name: str, body: ForeignBody, ahead_s: float) -> None:
        x, y = body.at(ahead_s)
        if name not in self._present:
            self._enter(name, body, x, y)
        heading = body.state.heading_deg
        if body.drives:
            half, angle = body.size.length_m / 2.0, math.radians(heading)
            front = (x + half * math.sin(angle), y + half * math.cos(angle))
            self._sim.vehicle.moveToXY(name, "", -1, *front, heading, _FREELY_BY_CAR)
        else:
            self._sim.person.moveToXY(name, "", x, y, heading, _FREELY)

    def _near(self, mirrors: Sequence[BodyState]) -> Iterator[ForeignBody]:
        for state in mirrors:
            x, y, z = state.position
            entity = self._entities.get(state.id)
            if z > self._highest_m + _HEIGHT_M or is_gone(state, entity) or not self._graph.is_near_road(x, y):
                continue
            size = mirror_size(state, entity)
            afloat = entity is not None and floats(entity)
            if size is None or afloat or abs(z - self._road_height(x, y)) > _HEIGHT_M:
                continue
            drives = size.length_m >= _VEHICLE_LENGTH_M and state.kind != "bicycle"
            leads_s = (0.0,) if drives else (0.0, *self._heralds(state))
            yield ForeignBody(state, size, drives, leads_s, tuple(self._beside(state, size)))

    def _beside(self, state: BodyState, size: Size) -> Iterator[tuple[str, tuple[float, float]]]:
        """The stand-ins of a body in the middles of all lanes that it touches, if it touches more than one."""
        (x, y, _), angle = state.position, math.radians(state.heading_deg)
        touched: list[tuple[str, tuple[float, float]]] = []
        for number, along in enumerate(_places_along(size.length_m)):
            east, north = x + along * math.sin(angle), y + along * math.cos(angle)
            for place in self._graph.places(east, north, size.length_m + _LANE_REACH_M):
                reach_m = _reach_m(size, state.heading_deg - place.heading_deg)
                if place.off_m <= place.lane.width_m / 2.0 + reach_m:
                    on = project(place.lane.shape, east, north)
                    px, py = (a + on.share * (b - a) for a, b in zip(on.start, on.end, strict=True))
                    touched.append((f"foreign/{state.id}/on/{place.lane.id}/{number}", (px - x, py - y)))
        lanes = {name.rpartition("/")[0] for name, _ in touched}
        return iter(touched if len(lanes) > 1 else ())

    def _heralds(self, state: BodyState) -> tuple[float, ...]:
        """The leads at which a walking body will be on a lane."""
        (x, y, _), (east, north, _) = state.position, state.velocity
        if math.hypot(east, north) < _WALKING_MPS:
            return ()
        return tuple(lead for lead in _LEADS_S if self._on_lane(x + east * lead, y + north * lead))

    def _on_lane(self, x: float, y: float) -> bool:
        return any(place.off_m <= place.lane.width_m / 2.0 for place in self._graph.places(x, y, _LANE_REACH_M))

    def _road_height(self, x: float, y: float) -> float:
        near = self._graph.nearest(x, y, most_m=_ROAD_M)
        if near is None:
            return -math.inf
        return float(self._sim.simulation.convert3D(near.lane.edge, near.at_m, near.lane.index)[2])

    def _enter(self, name: str, body: ForeignBody, x: float, y: float) -> None:
        kind = self._declared(body.size, drives=body.drives)
        if body.drives:
            self._enter_vehicle(name, kind, self._nearest(x, y))
        else:
            self._enter_person(name, kind, x, y)

    def _nearest(self, x: float, y: float) -> LanePoint:
        near = self._graph.nearest(x, y, most_m=_ROAD_M)
        assert near is not None  # bodies are near a road, their heralds on one
        return near

    def _enter_person(self, name: str, kind: str, x: float, y: float) -> None:
        near = self._nearest(x, y)
        self._present[name] = False
        length = self._graph.edges[near.lane.edge].length_m
        self._sim.person.add(name, near.lane.edge, max(0.0, min(near.at_m, length - 0.1)), typeID=kind)
        self._sim.person.appendWaitingStage(name, FOREVER_S)

    def _enter_vehicle(self, name: str, kind: str, near: LanePoint) -> None:
        self._present[name] = True
        self._entries += 1
        route = f"route/{name}/{self._entries}"
        self._sim.route.add(route, [near.lane.edge])
        self._sim.vehicle.add(name, route, kind)

    def _declared(self, size: Size, *, drives: bool) -> str:
        name = f"foreign/{size.length_m}x{size.width_m}x{size.height_m}/{drives}"
        if name not in self._types:
            self._types.add(name)
            types = self._sim.vehicletype
            types.copy("DEFAULT_VEHTYPE" if drives else "DEFAULT_PEDTYPE", name)
            if not drives:
                types.setVehicleClass(name, "ignoring")  # it walks where it walks, permitted or not
            types.setLength(name, size.length_m)
            types.setWidth(name, size.width_m if drives else max(size.length_m, size.width_m) + 2.0 * _SIDE_M)
            types.setHeight(name, size.height_m)
        return name

    def _remove(self, name: str) -> None:
        drives = self._present.pop(name)
        try:
            if drives:
                self._sim.vehicle.remove(name)
            else:
                self._sim.person.remove(name)
        except SumoError:  # it never got in
            return


def _places_along(length_m: float) -> tuple[float, ...]:
    """Metres along a body from its middle to its stand-ins in a lane's middle: one if it is short, else to its ends."""
    gaps = math.ceil(length_m / _BLOCKERS_APART_M) if length_m > _BLOCKERS_APART_M else 0
    return tuple(length_m * (number / gaps - 0.5) for number in range(gaps + 1)) if gaps else (0.0,)


def _reach_m(size: Size, turned_deg: float) -> float:
    """How far across a lane a body at this angle to it blocks. What walks turns on the spot, and counts across."""
    if size.length_m < _VEHICLE_LENGTH_M:
        return max(size.length_m, size.width_m) / 2.0 + _TOUCH_M
    return size.width_m / 2.0 * abs(math.cos(math.radians(turned_deg))) + _TOUCH_M


def _touch_m(body: ForeignBody, place: LanePoint) -> float:
    return _reach_m(body.size, body.state.heading_deg - place.heading_deg)


def _stand_in(body: str, lead_s: float) -> str:
    return f"foreign/{body}" if lead_s == 0.0 else f"foreign/{body}/in {lead_s:g} s"


def entity_of(vehicle: str) -> str:
    """The body behind a vehicle's id in the simulation."""
    return vehicle.removeprefix("foreign/")
