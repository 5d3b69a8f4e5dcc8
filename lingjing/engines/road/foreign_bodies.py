"""The bodies of other engines in SUMO: stand-ins that are set at each step, at constant velocity between mirrors.

A walking body is a SUMO person that is placed freely; a body as large as a car is a vehicle. SUMO's drivers brake for
both. Only bodies beside a road and near its height count; for all others the check costs one look-up.

SUMO detects a person only in a car's own lane. That is too late to stop for a body that walks on without looking. A
body that is about to step onto a lane therefore has heralds: stand-ins at its positions in one, two and three seconds.

A stand-in is in one SUMO lane and slows only the cars of that lane. A car that changes lanes for it is still partly in
its lane when it passes (`lateral_motion`). A body that touches a second lane, or almost does, therefore blocks that
lane too: it has stand-ins in the middle of each. SUMO ignores persons on the lane to which a car changes. So cars just
before a body keep their lanes, and those farther back drive around it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from lingjing.engines.bodies import is_absent, is_afloat, mirror_size
from lingjing.engines.road.graph import Graph, LanePoint
from lingjing.engines.road.simulation import FOREVER_S, Simulation, SumoError
from lingjing.mission.instance import Entity
from lingjing.scene.lines import project
from lingjing.scene.sizes import Size
from lingjing.trace.records import BodyState

_HEIGHT_M = 2.5
"""Height above or below a road beyond which a body does not matter, metres (chosen)."""

_ROAD_M = 60.0
"""Largest distance from a road at which its height is read, metres (chosen)."""

_LANE_REACH_M = 4.0
"""Distance added to a body's length in searches for lanes, metres: more than half a lane's width (chosen)."""

_WALKING_MPS = 0.2
"""Speed from which a body has heralds, m/s (chosen)."""

_LEADS_S = (1.0, 2.0, 3.0)
"""Times ahead of the heralds, seconds (chosen)."""

_VEHICLE_LENGTH_M = 1.6
"""Length from which a body is a vehicle in SUMO, metres (chosen)."""

_SIDE_M = 0.2
"""Room that cars leave beside a body, metres (chosen). A person in SUMO has no heading, so its width is its length."""
_TOUCH_M = 0.5
"""Largest distance of a lane's edge from a body that blocks the lane, metres (chosen: buses leave 0.4 m of a lane)."""
_KEEPS_LANE_M = 60.0
"""Distance before a body on a lane within which no vehicle changes lanes, metres.

It is more than the stopping distance from 70 km/h. It is also the way at 50 km/h of a lane change that is shown at
walking speed.
"""
_KEEP_LANE = 512
"""SUMO's lane change mode that allows changes only to avoid a collision."""
_BLOCKERS_APART_M = 3.0
"""Largest distance between two stand-ins of a long body in the middle of a lane, metres (chosen)."""
_BLOCKER = Size(0.7, 0.7, 0.5)
"""Size of a stand-in in the middle of a lane."""
_FREELY = 6
"""SUMO's `moveToXY` flag for persons: any position, on or off a lane."""

_FREELY_BY_CAR = 2
"""SUMO's `moveToXY` flag for vehicles: any position, on or off a lane."""


@dataclass(frozen=True, slots=True)
class ForeignBody:
    """A body of another engine near a road."""

    state: BodyState
    """Its mirror at the start of the interval."""
    size: Size
    """Its dimensions."""
    drives: bool
    """True if it is a vehicle in SUMO, False if it is a person."""
    leads_s: tuple[float, ...] = (0.0,)
    """Times ahead at which it has a stand-in, seconds; 0 is the body itself."""
    beside: tuple[tuple[str, tuple[float, float]], ...] = ()
    """Stand-ins in the middle of several lanes that it blocks: their names and their offsets (east, north), metres."""

    def at(self, ahead_s: float) -> tuple[float, float]:
        """Return its position `ahead_s` after the mirror, (east, north) metres."""
        (x, y, _), (east, north, _) = self.state.position, self.state.velocity
        return (x + east * ahead_s, y + north * ahead_s)


class ForeignBodies:
    """The stand-ins of all bodies of other engines. `bodies` holds those near a road now, by id."""

    def __init__(self, sim: Simulation, graph: Graph, entities: Sequence[Entity], highest_m: float) -> None:
        """Create an empty set; `highest_m` is the elevation of the highest road."""
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
        """Take over the mirrors of time `time_s`."""
        self._time_s = time_s
        self.bodies = {body.state.id: body for body in self._near(mirrors)}
        wanted = {_stand_in(body.state.id, lead) for body in self.bodies.values() for lead in body.leads_s}
        wanted |= {name for body in self.bodies.values() for name, _ in body.beside}
        for name in [name for name in self._present if name not in wanted]:
            self._remove(name)

    def step(self, time_s: float) -> None:
        """Move every stand-in to the position of its body at `time_s`, the end of the coming step."""
        for body in self.bodies.values():
            for lead in body.leads_s:
                self._set(_stand_in(body.state.id, lead), body, time_s - self._time_s + lead)
            for name, (east, north) in body.beside:
                x, y = body.at(time_s - self._time_s)
                self._set_beside(name, x + east, y + north)
        self._keep_lanes()

    def _keep_lanes(self) -> None:
        """Forbid lane changes to vehicles just before a body on their road, and allow them again afterwards."""
        vehicles, coming = self._sim.vehicle, set(self._coming())
        for name in coming - self._kept.keys():
            self._kept[name] = vehicles.getLaneChangeMode(name)
            vehicles.setLaneChangeMode(name, _KEEP_LANE)
        for name in [name for name in self._kept if name not in coming]:
            before = self._kept.pop(name)
            if name in vehicles.getIDList() and vehicles.getLaneChangeMode(name) == _KEEP_LANE:
                vehicles.setLaneChangeMode(name, before)

    def _coming(self) -> Iterator[str]:
        """Return the vehicles just before bodies that are on or touch a lane, on the edges of those lanes."""
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
        """Set a stand-in in the middle of a lane; it is a person for every kind of body."""
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
            if z > self._highest_m + _HEIGHT_M or is_absent(state, entity) or not self._graph.is_near_road(x, y):
                continue
            size = mirror_size(state, entity)
            afloat = entity is not None and is_afloat(entity)
            if size is None or afloat or abs(z - self._road_height(x, y)) > _HEIGHT_M:
                continue
            drives = size.length_m >= _VEHICLE_LENGTH_M and state.kind != "bicycle"
            leads_s = (0.0,) if drives else (0.0, *self._heralds(state))
            yield ForeignBody(state, size, drives, leads_s, tuple(self._beside(state, size)))

    def _beside(self, state: BodyState, size: Size) -> Iterator[tuple[str, tuple[float, float]]]:
        """Return the stand-ins of a body in the middle of all lanes that it touches, if it touches more than one."""
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
        """Return the times at which a walking body will be on a lane, seconds."""
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
        assert near is not None  # only bodies near a road have stand-ins
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
                types.setVehicleClass(name, "ignoring")  # bodies also walk where pedestrians may not
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
        except SumoError:  # SUMO had not inserted it yet
            return


def _places_along(length_m: float) -> tuple[float, ...]:
    """Return the positions of stand-ins along a body, metres from its middle: one for a short body, else up to its
    ends."""
    gaps = math.ceil(length_m / _BLOCKERS_APART_M) if length_m > _BLOCKERS_APART_M else 0
    return tuple(length_m * (number / gaps - 0.5) for number in range(gaps + 1)) if gaps else (0.0,)


def _reach_m(size: Size, turned_deg: float) -> float:
    """Return the half width across a lane that a body blocks at an angle to the lane, metres.

    A walking body can turn on the spot, so its length counts across the lane too.
    """
    if size.length_m < _VEHICLE_LENGTH_M:
        return max(size.length_m, size.width_m) / 2.0 + _TOUCH_M
    return size.width_m / 2.0 * abs(math.cos(math.radians(turned_deg))) + _TOUCH_M


def _touch_m(body: ForeignBody, place: LanePoint) -> float:
    return _reach_m(body.size, body.state.heading_deg - place.heading_deg)


def _stand_in(body: str, lead_s: float) -> str:
    return f"foreign/{body}" if lead_s == 0.0 else f"foreign/{body}/in {lead_s:g} s"


def entity_of(vehicle: str) -> str:
    """Return the id of the body for an id in the simulation."""
    return vehicle.removeprefix("foreign/")
