"""The bodies of other engines in the simulation: set at each of its steps, moved on along their velocity.

What walks is a person of SUMO's, placed freely; what is as large as a car is a vehicle. Whoever drives there brakes
for them. Only bodies beside a road and near its height count, so aircraft, boats and far people cost one look-up.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from lingjing.mission.instance import Entity
from lingjing.plugins.engines.bodies import SIZES, Size
from lingjing.plugins.engines.road.graph import Graph, Place
from lingjing.plugins.engines.road.simulation import FOREVER_S, Simulation, SumoError
from lingjing.trace.records import BodyState

ABSENT = frozenset({"dormant", "rescued", "served", "cleared"})
"""Statuses of bodies that are not there."""

_AFLOAT = frozenset({"lifeboat", "person_in_water"})
_HEIGHT_M = 2.5
_VEHICLE_LENGTH_M = 1.6
_PERSON_HEADROOM_M = 0.5
_FREELY = 6
_FREELY_BY_CAR = 2


@dataclass(frozen=True, slots=True)
class Body:
    """A foreign body near a road: its state at the interval's start and its size."""

    state: BodyState
    size: Size
    drives: bool

    def at(self, ahead_s: float) -> tuple[float, float]:
        """Its place later on."""
        (x, y, _), (east, north, _) = self.state.position, self.state.velocity
        return (x + east * ahead_s, y + north * ahead_s)


class Foreign:
    """Keeps the simulation's stand-ins of foreign bodies; `bodies` are those near a road now, by id."""

    def __init__(self, sim: Simulation, graph: Graph, entities: Sequence[Entity]) -> None:
        self.bodies: dict[str, Body] = {}
        self._sim = sim
        self._graph = graph
        self._names = {entity.id: (entity.type, *entity.bases) for entity in entities}
        self._present: dict[str, bool] = {}
        self._time_s = 0.0
        self._entries = 0
        self._types: set[str] = set()

    def look(self, mirrors: Sequence[BodyState], time_s: float) -> None:
        """Take the mirrors of time `time_s`."""
        self._time_s = time_s
        self.bodies = {body.state.id: body for body in self._near(mirrors)}
        for name in [name for name in self._present if name not in self.bodies]:
            self._remove(name)

    def step(self, time_s: float) -> None:
        """Set every stand-in to where its body will be at `time_s`, the end of the coming step."""
        for name, body in self.bodies.items():
            if name not in self._present:
                self._enter(body)
            x, y = body.at(time_s - self._time_s)
            heading = body.state.heading_deg
            if body.drives:
                half, angle = body.size.length_m / 2.0, math.radians(heading)
                front = (x + half * math.sin(angle), y + half * math.cos(angle))
                self._sim.vehicle.moveToXY(_stand_in(name), "", -1, *front, heading, _FREELY_BY_CAR)
            else:
                self._sim.person.moveToXY(_stand_in(name), "", x, y, heading, _FREELY)

    def _near(self, mirrors: Sequence[BodyState]) -> Iterator[Body]:
        for state in mirrors:
            x, y, z = state.position
            if state.status in ABSENT or not self._graph.is_near_road(x, y):
                continue
            kind = next((name for name in self._kinds(state) if name in SIZES), None)
            if kind is None or kind in _AFLOAT or abs(z - self._road_height(x, y)) > _HEIGHT_M:
                continue
            yield Body(state, SIZES[kind], SIZES[kind].length_m >= _VEHICLE_LENGTH_M and kind != "bicycle")

    def _kinds(self, state: BodyState) -> tuple[str, ...]:
        return (state.kind,) if state.kind else self._names.get(state.id, ())

    def _road_height(self, x: float, y: float) -> float:
        near = self._graph.nearest(x, y, most_m=60.0)
        if near is None:
            return -math.inf
        return float(self._sim.simulation.convert3D(near.lane.edge, near.at_m, near.lane.index)[2])

    def _enter(self, body: Body) -> None:
        x, y, _ = body.state.position
        near = self._graph.nearest(x, y, most_m=60.0)
        if near is None:
            return
        name = _stand_in(body.state.id)
        kind = self._declared(body)
        self._present[body.state.id] = body.drives
        if body.drives:
            self._enter_vehicle(name, kind, near)
        else:
            self._sim.person.add(name, near.lane.edge, near.at_m, typeID=kind)
            self._sim.person.appendWaitingStage(name, FOREVER_S)

    def _enter_vehicle(self, name: str, kind: str, near: Place) -> None:
        self._entries += 1
        route = f"route/{name}/{self._entries}"
        self._sim.route.add(route, [near.lane.edge])
        self._sim.vehicle.add(name, route, kind)

    def _declared(self, body: Body) -> str:
        size = body.size
        name = f"foreign/{size.length_m}x{size.width_m}x{size.height_m}/{body.drives}"
        if name not in self._types:
            self._types.add(name)
            types = self._sim.vehicletype
            types.copy("DEFAULT_VEHTYPE" if body.drives else "DEFAULT_PEDTYPE", name)
            types.setLength(name, size.length_m)
            types.setWidth(name, max(size.width_m, _PERSON_HEADROOM_M))
            types.setHeight(name, size.height_m)
        return name

    def _remove(self, name: str) -> None:
        drives = self._present.pop(name)
        try:
            if drives:
                self._sim.vehicle.remove(_stand_in(name))
            else:
                self._sim.person.remove(_stand_in(name))
        except SumoError:  # it never got in
            return


def _stand_in(name: str) -> str:
    return f"foreign/{name}"


def entity_of(vehicle: str) -> str:
    """The body behind a vehicle's id in the simulation."""
    return vehicle.removeprefix("foreign/")
