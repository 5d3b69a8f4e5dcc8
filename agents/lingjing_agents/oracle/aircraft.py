"""Aircraft: flights above targets, to photograph or to serve them, and along routes to inspect them."""

from __future__ import annotations

import math
from collections.abc import Sequence

from lingjing.plugins.policy import (
    DEAD,
    DORMANT,
    PHOTO,
    Action,
    Brief,
    CameraSpec,
    Datum,
    Entity,
    InspectionSpec,
    Outgoing,
    Resource,
    Route,
    Vector,
)
from lingjing.plugins.terrain import buildings_within
from lingjing_agents.capability import CLEAR, INSPECT, JAMMED, has_verb, nadir_camera, photo, rated, straight_to
from lingjing_agents.flight_levels import FlightLevels, crowded, overhead
from lingjing_agents.ground_plane import GroundPoint, GroundRectangle, distance_to_segment_m
from lingjing_agents.oracle.ability import Ability
from lingjing_agents.oracle.composing import MessageComposer
from lingjing_agents.oracle.privileged_state import InstanceIndex, PrivilegedState
from lingjing_agents.oracle.reporting import ReportAbility
from lingjing_agents.oracle.routes import another_way, is_blocked, jams_on, segment
from lingjing_agents.paths.between_towers import TowerPaths
from lingjing_agents.paths.visiting_order import shares, shortest

ABOVE_M = 40.0
"""Height above a target in metres. Chosen: low enough for a clear box, high enough to keep a drifting target in
view.
"""

NEAR_M = 8.0
"""Distance in metres at which an aircraft counts as arrived. Chosen."""
AREA_M = 1000.0
"""Distance in metres around the bodies and targets of an instance within which buildings count. Chosen."""
OVER_ROOFS_M = 15.0
"""Margin above roofs in metres. Chosen."""
STRAIGHT_M = 12.0
"""Distance in metres within which waypoints beside a straight flight count as passed. Chosen."""
PATIENCE_TICKS = 3
"""Ticks that an aircraft on the ground waits for one overhead. Chosen."""
_LEAD_S, _LEAD_MPS = 60.0, 8.0
"""Bound in seconds, and speed in metres per second, for the prediction of a drifting target's position. Chosen."""


def flyer(brief: Brief) -> Resource | None:
    """Return the first embodied resource that flies to points."""
    for resource in brief.resources:
        if resource.embodied and straight_to(resource, "x", "y", "z"):
            return resource
    return None


class AircraftControl:
    """The flight control of one aircraft: altitudes and commands."""

    def __init__(self, body: Resource, plan: InstanceIndex) -> None:
        self.body, self._plan = body, plan
        self._buildings: tuple[tuple[Sequence[GroundPoint], float], ...] | None = None
        self._tallest = -math.inf
        self._towers: TowerPaths | None = None
        self._layers: FlightLevels | None = None
        self._waited = 0
        self.camera: CameraSpec | None = nadir_camera(body) if has_verb(body, PHOTO) else None

    def altitude(self, truth: PrivilegedState, place: GroundPoint, target_m: float, above_m: float = ABOVE_M) -> float:
        """Return the elevation for a view of a target.

        It lies in the aircraft's band and above all roofs; if the band does not allow that, above the roofs on the way,
        or at the top of the band between higher ones.
        """
        low, high = rated(self.body, "band_low_m", 0.0), rated(self.body, "band_high_m", math.inf)
        towers = self._between(truth)
        roofs = self._roofs(truth)
        if towers is not None:
            roofs = towers.highest_m(truth.place(self.body.id), place, _REACH_M)
        if self._layers is None:
            fleet = [body.id for body in self._plan.bodies(self._plan.entities[self.body.id].engine)]
            self._layers = FlightLevels(fleet.index(self.body.id), len(fleet), low, high)
        return self._layers.level(min(max(low, target_m + above_m, roofs + OVER_ROOFS_M), high))

    def free(self, truth: PrivilegedState, place: GroundPoint, z: float) -> GroundPoint:
        """Return a place, or the nearest one beside the buildings that stand there at an elevation."""
        towers = self._between(truth)
        return place if towers is None else towers.free(place, z)

    def to(self, truth: PrivilegedState, x: float, y: float, z: float) -> Action | None:
        """Return the next command of a flight to a place, or None to wait.

        Near roofs or other pads the aircraft first climbs vertically, as soon as no other one is overhead. It flies
        around the buildings that are higher than its altitude band.
        """
        here = truth.states[self.body.id].position
        others = self._others(truth)
        if truth.states[self.body.id].status == "grounded" and crowded(here, others):
            if overhead(here, others) and self._waited < PATIENCE_TICKS:
                self._waited += 1
                return None
            return self._straight_to(*here[:2], z)
        towers = self._between(truth)
        if towers is not None:
            x, y = towers.next_place(here[:2], towers.free((x, y), z), z)
        roofs = self._highest(truth, here[:2], (x, y))
        if here[2] + _STEEP_M < z and here[2] < roofs + _CLEAR_M:
            x, y = here[:2]
            z = min(z, roofs + OVER_ROOFS_M)
            if truth.states[self.body.id].status == "grounded" and has_verb(self.body, "takeoff"):
                return Action(verb="takeoff", arguments={"altitude": z - here[2]}, resource=self.body.id)
        return self._straight_to(x, y, z)

    def _straight_to(self, x: float, y: float, z: float) -> Action:
        arguments: dict[str, Datum] = {"x": x, "y": y, "z": z}
        return Action(verb=straight_to(self.body, "x", "y", "z"), arguments=arguments, resource=self.body.id)

    def _others(self, truth: PrivilegedState) -> list[Vector]:
        """Return the positions of the other living aircraft of the fleet."""
        fleet = self._plan.bodies(self._plan.entities[self.body.id].engine)
        others = (body.id for body in fleet if body.id != self.body.id)
        return [truth.states[name].position for name in others if _alive(truth, name)]

    def _between(self, truth: PrivilegedState) -> TowerPaths | None:
        """Return the ways between the buildings of a city that has some above the altitude band; None elsewhere."""
        if self._roofs(truth) + OVER_ROOFS_M <= rated(self.body, "band_high_m", math.inf):
            return None
        if self._towers is None:
            self._towers = TowerPaths(self._built(truth))
        return self._towers

    def _roofs(self, truth: PrivilegedState) -> float:
        """Return the elevation in metres of the highest roof around the instance; the datum without a building."""
        self._built(truth)
        return self._tallest

    def _built(self, truth: PrivilegedState) -> tuple[tuple[Sequence[GroundPoint], float], ...]:
        """Return the outline and the elevation of the top of the buildings around the instance."""
        if self._buildings is None:
            city, places = truth.known.city, [entity.position[:2] for entity in self._plan.instance.entities]
            area = GroundRectangle.around(places, AREA_M)
            bounds = area.west, area.south, area.east, area.north
            built = buildings_within(city, bounds) if city is not None and places else ()
            self._buildings = tuple((building.polygon, building.top_m) for building in built)
            self._tallest = max((top_m for _, top_m in self._buildings), default=truth.brief.water_level_m)
        return self._buildings

    def _highest(self, truth: PrivilegedState, start: GroundPoint, end: GroundPoint) -> float:
        """Return the top in metres of the highest building near a straight line; the datum without one."""
        highest = truth.brief.water_level_m
        for outline, top_m in self._built(truth):
            if top_m > highest and distance_to_segment_m(outline[0], start, end) <= _REACH_M:
                highest = top_m
        return highest

    def photo(self) -> Action | None:
        """Return the command for a picture straight down, or None without a camera."""
        if self.camera is None:
            return None
        return photo(self.body, self.camera)


class _SearchAbility(Ability):
    """Photographs each target of the aircraft's share from above, then serves those that aircraft serve."""

    def __init__(self, aircraft: AircraftControl, plan: InstanceIndex, reports: ReportAbility) -> None:
        self._aircraft, self._plan, self._reports = aircraft, plan, reports
        self._tries: dict[str, int] = {}

    def act(self, truth: PrivilegedState) -> Action | None:
        """Return the next command of a flight, or a picture."""
        body = self._aircraft.body
        if truth.busy(body.id):
            return None
        mine = self._share(truth)
        self.aim = mine[0] if mine else ""
        if mine:
            return self._above(truth, mine[0], looking=True)
        tasks = [task for task in truth.tasks_of(body.id) if not task.moves_goods]
        near = [task for task in tasks if truth.distance(body.id, task.target) <= 0.8 * task.within_m]
        staying = next((task for task in near if task.lasting_s), None)
        following = staying or next((task for task in tasks if task not in near), None)
        self.aim = following.target if following is not None else ""
        if following is None or following is staying:
            return None
        return self._above(truth, following.target, looking=False)

    def _share(self, truth: PrivilegedState) -> list[str]:
        open_now = self._reports.open(truth)
        if not open_now or self._aircraft.camera is None:
            return []
        places = {name: truth.place(name) for name in open_now}
        mates = {
            body.id: truth.place(body.id)
            for body in self._plan.bodies(self._plan.entities[self._aircraft.body.id].engine)
            if _alive(truth, body.id) and self._plan.owners[body.id].role == truth.brief.role
        }
        return shares(mates, self._order(truth, places), places).get(self._aircraft.body.id, [])

    def _order(self, truth: PrivilegedState, places: dict[str, GroundPoint]) -> tuple[str, ...]:
        """Return the targets in the order in which the bodies that serve them will visit them."""
        tasks = [task for task in truth.left if task.target in places]
        actors = [body.id for body in sorted(self._plan.able(*tasks), key=lambda body: body.engine)]
        start = truth.place(actors[0] if actors else self._aircraft.body.id)
        return shortest(start, places)

    def _above(self, truth: PrivilegedState, target: str, *, looking: bool) -> Action | None:
        state, body = truth.states[target], truth.states[self._aircraft.body.id]
        x, y = state.position[:2]
        tries = self._tries.get(target, 0)
        above = ABOVE_M * 0.6**tries
        z = self._aircraft.altitude(truth, (x, y), state.position[2], above)
        x, y = self._aircraft.free(truth, (x, y), z)
        if math.dist(body.position, (x, y, z)) <= NEAR_M:
            self._tries[target] = tries + 1
            return self._aircraft.photo() if looking else None
        east, north = truth.drift(target)
        lead_s = min(_LEAD_S, math.dist(body.position[:2], (x, y)) / _LEAD_MPS)
        return self._aircraft.to(truth, x + lead_s * east, y + lead_s * north, z)


class _InspectionAbility(Ability):
    """Flies along a route from waypoint to waypoint. It photographs and reports obstacles and requests another
    route.
    """

    def __init__(
        self, aircraft: AircraftControl, plan: InstanceIndex, composer: MessageComposer, inspection: InspectionSpec
    ) -> None:
        self._aircraft, self._plan, self._composer, self._inspection = aircraft, plan, composer, inspection
        self._told: set[tuple[str, tuple[Vector, ...]]] = set()
        self._looked: set[tuple[str, int]] = set()
        self._cleared: set[tuple[int, int]] = set()
        self._sighted = 0
        self._asked = -1

    def say(self, truth: PrivilegedState) -> list[Outgoing]:
        """Return reports on inspected waypoints, on an obstacle that was photographed, and on the last waypoint."""
        route = truth.routes.get(self._inspection.asset)
        return [] if route is None else self._clear(truth, route) + self._route_reports(truth, route)

    def _clear(self, truth: PrivilegedState, route: Route) -> list[Outgoing]:
        messages: list[Outgoing] = []
        for number in truth.known.inspected.get(self._inspection.name, ()):
            x, y, _ = route.waypoints[number]
            if (route.number, number) not in self._cleared and not is_blocked(truth, (x, y)):
                self._cleared.add((route.number, number))
                place: dict[str, Datum] = {"position": route.waypoints[number]}
                messages += self._composer.status(f"{INSPECT}-{number + 1}", CLEAR, place)
        return messages

    def _route_reports(self, truth: PrivilegedState, route: Route) -> list[Outgoing]:
        jam = self._jam(truth, route)
        if jam is not None and (jam.id, route.number) in self._looked:
            self._told.add((jam.id, route.waypoints))
            self._asked = truth.tick
            return self._sighting(truth, jam) + self._ask_anew(truth, route, jam)
        if jam is None and self._next(truth, route) is None and self._sighted != route.number:
            return self._all_clear(truth, route)
        return []

    def act(self, truth: PrivilegedState) -> Action | None:
        """Return the flight to the next waypoint, or to an obstacle before it."""
        body, self.aim = self._aircraft.body, self._inspection.name
        if truth.busy(body.id):
            return None
        route = truth.routes.get(self._inspection.asset)
        if route is None:
            return self._take_off(truth)
        if self._asked == truth.tick:  # the requested route begins at the same place as this one
            x, y, z = route.waypoints[0]
            return self._aircraft.to(truth, x, y, self._aircraft.altitude(truth, (x, y), z))
        place = self._next(truth, route)
        if place is None:
            end = self._plan.entities.get(self._inspection.destination)
            unseen = end is not None and self._sighted != route.number
            return self._aircraft.photo() if unseen and self._carried() and not truth.known.frames else None
        jam = self._jam(truth, route)
        if jam is not None and segment(truth, route, jam) <= place:
            return self._look_at(truth, jam, route)
        if self._inspection.pictured:
            x, y, z = route.waypoints[place]
            if math.dist(truth.place(body.id), (x, y)) <= 0.6 * self._inspection.within_m:
                return self._aircraft.photo()
        else:
            x, y, z = route.waypoints[self._farthest(truth, route, place)]
        return self._aircraft.to(truth, x, y, self._aircraft.altitude(truth, (x, y), z))

    def _look_at(self, truth: PrivilegedState, jam: Entity, route: Route) -> Action | None:
        x, y = truth.place(jam.id)
        here = truth.place(self._aircraft.body.id)
        if math.dist(here, (x, y)) > 0.6 * self._inspection.within_m:
            return self._aircraft.to(truth, x, y, self._aircraft.altitude(truth, (x, y), jam.position[2]))
        self._looked.add((jam.id, route.number))
        return self._aircraft.photo()

    def _sighting(self, truth: PrivilegedState, jam: Entity) -> list[Outgoing]:
        for frame in truth.known.frames:
            for box in frame.boxes:
                if box.entity == jam.id:
                    return self._report(truth, frame.id, box.cls, box.box, truth.states[jam.id].position)
            return self._report(truth, frame.id, jam.type, (0.0, 0.0, 1.0, 1.0), truth.states[jam.id].position)
        return []

    def _all_clear(self, truth: PrivilegedState, route: Route) -> list[Outgoing]:
        """Return a report with a picture of the last waypoint, for the agents that drive there."""
        for frame in truth.known.frames:
            self._sighted = route.number
            end = self._plan.entities.get(self._inspection.destination)
            position = end.position if end is not None else route.waypoints[-1]
            return self._report(truth, frame.id, end.type if end is not None else "", (0.0, 0.0, 1.0, 1.0), position)
        return []

    def _report(
        self, truth: PrivilegedState, frame: str, cls: str, box: tuple[float, ...], position: tuple[float, ...]
    ) -> list[Outgoing]:
        body: dict[str, Datum] = {
            "frame": frame, "class": cls, "box": box, "position": position, "confidence": 1.0,
        }  # fmt: skip
        kind = self._carried()
        return self._composer.say(kind, body) if kind else []

    def _carried(self) -> str:
        """Return the kind of report that inspectors may send; "" without one."""
        message = self._composer.with_fields("frame", "class", "box", "position")
        return message.kind if message is not None else ""

    def _ask_anew(self, truth: PrivilegedState, route: Route, jam: Entity) -> list[Outgoing]:
        """Return a request for another route, or a report of the obstacle if this agent may not send requests."""
        known = another_way(truth, route, jam)
        requests = self._composer.say(self._inspection.replan, known)
        return requests or self._composer.status(f"{INSPECT}-{known['waypoint']}", JAMMED, known)

    def _jam(self, truth: PrivilegedState, route: Route) -> Entity | None:
        """Return the first obstacle on the route that has not been reported yet."""
        return next((jam for jam in jams_on(truth, route) if (jam.id, route.waypoints) not in self._told), None)

    def _next(self, truth: PrivilegedState, route: Route) -> int | None:
        seen = truth.known.inspected.get(self._inspection.name, ())
        return next((number for number in range(len(route.waypoints)) if number not in seen), None)

    def _farthest(self, truth: PrivilegedState, route: Route, place: int) -> int:
        """Return the last waypoint that a straight flight reaches after passing all waypoints before it."""
        here, best = truth.place(self._aircraft.body.id), place
        jam = self._jam(truth, route)
        last = len(route.waypoints) if jam is None else min(len(route.waypoints), segment(truth, route, jam))
        for candidate in range(place + 1, last):
            end = route.waypoints[candidate][:2]
            passed = route.waypoints[place:candidate]
            if all(distance_to_segment_m(point[:2], here, end) <= STRAIGHT_M for point in passed):
                best = candidate
        return best

    def _take_off(self, truth: PrivilegedState) -> Action | None:
        state = truth.states[self._aircraft.body.id]
        x, y, z = state.position
        height = self._aircraft.altitude(truth, (x, y), 0.0)
        return self._aircraft.to(truth, x, y, height) if z < height - NEAR_M else None


def aircraft_abilities(
    brief: Brief, plan: InstanceIndex, reports: ReportAbility | None, composer: MessageComposer
) -> list[Ability]:
    """Return the abilities of an agent with an aircraft, inspections first."""
    body = flyer(brief)
    if body is None:
        return []
    aircraft = AircraftControl(body, plan)
    inspections: list[Ability] = [
        _InspectionAbility(aircraft, plan, composer, spec) for spec in plan.instance.inspections if body.id in spec.by
    ]
    return [*inspections, _SearchAbility(aircraft, plan, reports or ReportAbility(plan, composer))]


def _alive(truth: PrivilegedState, name: str) -> bool:
    state = truth.state(name)
    return state is not None and state.status not in (DEAD, DORMANT)


_REACH_M = 60.0
"""Distance in metres from a flight line within which buildings count. Chosen."""
_STEEP_M, _CLEAR_M = 10.0, 5.0
"""Height differences in metres: a climb above the first goes vertically if the roofs are nearer than the second.
Chosen.
"""
