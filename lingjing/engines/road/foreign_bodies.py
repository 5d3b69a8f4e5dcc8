"""The bodies of other engines in the simulation: set at each of its steps, moved on along their velocity.

What walks is a person of SUMO's, placed freely; what is as large as a car is a vehicle. Whoever drives there brakes
for them. Only bodies beside a road and near its height count, so aircraft, boats and far people cost one look-up.

SUMO sees a person once it is in a car's own lane, which is too late to stop for one who walks on without looking. So
who is about to step onto a lane has heralds: stand-ins where it will be in one, two and three seconds.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from lingjing.engines.bodies import floats, is_gone, mirror_size
from lingjing.engines.road.graph import Graph, LanePoint
from lingjing.engines.road.simulation import FOREVER_S, Simulation, SumoError
from lingjing.mission.instance import Entity
from lingjing.scene.sizes import Size
from lingjing.trace.records import BodyState

_HEIGHT_M = 2.5
_ROAD_M = 60.0
_LANE_REACH_M = 4.0
_WALKING_MPS = 0.2
_LEADS_S = (1.0, 2.0, 3.0)
_VEHICLE_LENGTH_M = 1.6
_PERSON_HEADROOM_M = 0.5
_FREELY = 6
_FREELY_BY_CAR = 2


@dataclass(frozen=True, slots=True)
class ForeignBody:
    """A foreign body near a road: its state at the interval's start, its size, how many seconds ahead it is shown."""

    state: BodyState
    size: Size
    drives: bool
    leads_s: tuple[float, ...] = (0.0,)

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

    def look(self, mirrors: Sequence[BodyState], time_s: float) -> None:
        """Take the mirrors of time `time_s`."""
        self._time_s = time_s
        self.bodies = {body.state.id: body for body in self._near(mirrors)}
        wanted = {_stand_in(body.state.id, lead) for body in self.bodies.values() for lead in body.leads_s}
        for name in [name for name in self._present if name not in wanted]:
            self._remove(name)

    def step(self, time_s: float) -> None:
        """Set every stand-in to where its body will be at `time_s`, the end of the coming step."""
        for body in self.bodies.values():
            for lead in body.leads_s:
                self._set(_stand_in(body.state.id, lead), body, time_s - self._time_s + lead)

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
            yield ForeignBody(state, size, drives, (0.0,) if drives else (0.0, *self._heralds(state)))

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
        near = self._graph.nearest(x, y, most_m=_ROAD_M)
        assert near is not None  # bodies are near a road, their heralds on one
        kind = self._declared(body)
        self._present[name] = body.drives
        if body.drives:
            self._enter_vehicle(name, kind, near)
        else:
            length = self._graph.edges[near.lane.edge].length_m
            self._sim.person.add(name, near.lane.edge, max(0.0, min(near.at_m, length - 0.1)), typeID=kind)
            self._sim.person.appendWaitingStage(name, FOREVER_S)

    def _enter_vehicle(self, name: str, kind: str, near: LanePoint) -> None:
        self._entries += 1
        route = f"route/{name}/{self._entries}"
        self._sim.route.add(route, [near.lane.edge])
        self._sim.vehicle.add(name, route, kind)

    def _declared(self, body: ForeignBody) -> str:
        size = body.size
        name = f"foreign/{size.length_m}x{size.width_m}x{size.height_m}/{body.drives}"
        if name not in self._types:
            self._types.add(name)
            types = self._sim.vehicletype
            types.copy("DEFAULT_VEHTYPE" if body.drives else "DEFAULT_PEDTYPE", name)
            if not body.drives:
                types.setVehicleClass(name, "ignoring")  # it walks where it walks, permitted or not
            types.setLength(name, size.length_m)
            types.setWidth(name, max(size.width_m, _PERSON_HEADROOM_M))
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


def _stand_in(body: str, lead_s: float) -> str:
    return f"foreign/{body}" if lead_s == 0.0 else f"foreign/{body}/in {lead_s:g} s"


def entity_of(vehicle: str) -> str:
    """The body behind a vehicle's id in the simulation."""
    return vehicle.removeprefix("foreign/")
