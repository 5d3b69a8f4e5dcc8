"""The rules of a route inspector: waypoint after waypoint, with a picture and a report at each.

The waypoints come as orders of a coordinator, all at once; a new set of orders is a new route. Only the road between
the waypoints is examined, so that parked cars in yards do not count.
"""

from __future__ import annotations

import math
from itertools import pairwise
from types import MappingProxyType
from typing import ClassVar

from lingjing.plugins.geometry import box_to_plane
from lingjing.plugins.policy import (
    DEAD,
    Action,
    Brief,
    Decision,
    EntityView,
    Inbox,
    Observation,
    Outgoing,
    Picture,
    Resource,
)
from lingjing_agents.capability import (
    CLEAR,
    INSPECT,
    JAMMED,
    compose,
    fly,
    nadir_camera,
    photo,
    rated,
    sends,
    sighting,
    team,
)
from lingjing_agents.flight_levels import FlightLevels
from lingjing_agents.ground_plane import GroundPoint, between, distance_to_segment_m, position_in
from lingjing_agents.heuristic.events import view_of
from lingjing_agents.heuristic.sightings import name_in
from lingjing_agents.heuristic.target_types import ANY_VEHICLE, QUEUES, Detectors
from lingjing_agents.perception.images import ImageBox
from lingjing_agents.perception.road_blocks import RoadBlock, blocks_of_vehicles, find_blocks
from lingjing_agents.perception.road_queues import VehicleQueue, corners, find_queues

START = "start"
"""The task name of a coordinator's note of the place where the route begins."""
LOOK = "look"
"""The task name of a coordinator's order to photograph a place after all waypoints."""
REACHED_M = 5.0
"""Distance in metres at which a place counts as reached. Chosen."""
SLACK_M = 23.0
"""Distance in metres at which a waypoint need not be approached further: it counts as inspected from 25 m."""
VIEW_M = 12.0
"""Largest distance in metres from a place for its picture. Chosen."""
SETTLE_S = 5.5
"""Seconds of a tick that acceleration and braking take. Chosen."""
SURE = 0.5
"""Least confidence of a jam. Chosen."""
ATTEMPTS = 3
"""Number of flights to one waypoint. Chosen."""
LANE_M = 10.0
"""Distance of a detected queue from the route in metres, at most: others stand on other roads. Chosen."""
WAIT_TICKS = 5
"""Ticks to wait for a new route after a reported jam, before the present one is continued. Chosen."""
MOST_FLIGHTS = 2
"""Number of flights to a place of a further picture: the middle of a leg, or the front of a queue. Chosen."""
CLOSE_M = 12.0
"""Distance in metres of a jam from the place of its picture beyond which it is photographed once more. Chosen."""
LONG_LEG_M = 130.0
"""Distance between waypoints in metres from which the road between them is photographed too, where places of jams must
be exact. Chosen: a picture from 120 m shows 60 m ahead and behind."""


class RouteInspector:
    """One camera over one route. Its state belongs to one episode."""

    roles: ClassVar[tuple[str, ...]] = ("inspector",)
    reads: ClassVar[tuple[str, ...]] = ("assignment",)
    sends: ClassVar[tuple[str, ...]] = ("status", "report")

    def __init__(self, brief: Brief, body: Resource, detectors: Detectors = MappingProxyType({})) -> None:
        camera = nadir_camera(body)
        assert camera is not None
        self._brief, self._body, self._camera = brief, body, camera
        self._class = next((name for name in brief.classes if any(word in name for word in QUEUES)), QUEUES[0])
        self._detector, self._vehicles = detectors.get(self._class), detectors.get(ANY_VEHICLE)
        self._status, self._report = sends(brief, "status"), sends(brief, "report")
        mates, ceiling = team(brief), rated(body, "band_high_m", 100.0)
        z = brief.water_level_m + ceiling
        # The first inspector flies at the top of the band, the others below it.
        self._z = FlightLevels(
            mates.index(brief.agent), len(mates), rated(body, "band_low_m", 0.0), z, anchor_m=z
        ).level(z)
        self._reach_m = rated(body, "cruise_mps", 12.0) * max(1.0, brief.tick_s - SETTLE_S)
        self._aim: tuple[int, GroundPoint] | None = None
        self._route: list[GroundPoint] = []
        self._next = 0
        self._tries = 0
        self._wait_until = 0
        self._start: GroundPoint | None = None
        self._looks: list[GroundPoint] = []
        self._flights = 0
        self._is_exact = names_places(brief)
        self._near: GroundPoint | None = None
        self._closer = 0
        self._resumed = False
        self._middles: dict[int, GroundPoint] = {}
        self._extra_flights = MOST_FLIGHTS
        self._unnamed = brief.settings.get("jams", math.inf)

    def act(self, observation: Observation, inbox: Inbox) -> Decision:
        """Process orders and the new pictures, then go on."""
        self._listen(inbox)
        messages: tuple[Outgoing, ...] = ()
        for picture in observation.pictures:
            if picture.entity == self._body.id and self._next < len(self._route):
                messages += self._look(picture, observation.tick)
            elif picture.entity == self._body.id and self._looks:
                self._looks, self._flights = self._looks[1:], 0
        own = view_of(observation, self._body.id)
        if own is None or own.position is None or own.busy or own.status == DEAD:
            return Decision(messages=messages)
        if self._start is None:
            self._start = _ground_start(observation, self._body.id)
        return Decision(command=self._move(own, observation.tick), messages=messages)

    def _listen(self, inbox: Inbox) -> None:
        self._start = next(iter(self._ordered(inbox, START)), self._start)
        self._looks = self._ordered(inbox, LOOK) or self._looks
        orders = self._ordered(inbox, INSPECT)
        if orders:
            self._route, self._next, self._tries, self._wait_until = orders, 0, 0, 0
            self._aim = self._near = None
            self._middles = self._middles_of(orders) if self._unnamed > 0 else {}

    def _middles_of(self, route: list[GroundPoint]) -> dict[int, GroundPoint]:
        """Return the middles of long legs by the index of the waypoint at their end.

        Where places of jams need not be exact, these are the legs of more than one tick, on which a stop costs least.
        """
        long_m = LONG_LEG_M if self._is_exact else self._reach_m + SLACK_M
        return {
            number: ((a[0] + b[0]) / 2.0, (a[1] + b[1]) / 2.0)
            for number, (a, b) in enumerate(pairwise(route), 1)
            if math.dist(a, b) > long_m
        }

    def _ordered(self, inbox: Inbox, task: str) -> list[GroundPoint]:
        return [
            place
            for envelope in inbox.messages
            if envelope.category == "assignment"
            and name_in(envelope.body, "task") == task
            and name_in(envelope.body, "assignee") in {self._brief.agent, self._body.id}
            and (place := position_in(envelope.body)) is not None
        ]

    def _look(self, picture: Picture, tick: int) -> tuple[Outgoing, ...]:
        place = self._route[self._next]
        if self._is_exact:
            return self._look_exactly(picture, tick)
        middle = self._middles.pop(self._next, None)
        if middle is None and math.dist(picture.pose.position[:2], place) > SLACK_M + REACHED_M:
            return ()
        self._extra_flights = MOST_FLIGHTS
        jams = [queue for queue in self._queues(picture) if queue.confidence >= SURE]
        if middle is not None and not jams:
            return ()
        number, self._tries = self._next + 1, 0
        self._next += middle is None
        if not jams:
            return self._say(CLEAR, number, place)
        self._unnamed -= 1
        return self._say_jammed(picture, tick, number, jams[0].place, jams[0].box, jams[0].confidence)

    def _look_exactly(self, picture: Picture, tick: int) -> tuple[Outgoing, ...]:
        """Process a picture where the place of a jam must be exact: a second picture, over the jam, gives its place."""
        place, number = self._route[self._next], self._next + 1
        middle, near = self._middles.pop(self._next, None), self._near
        if near is None and middle is None and math.dist(picture.pose.position[:2], place) > SLACK_M + REACHED_M:
            return ()
        blocks = self._blocks(picture) if self._unnamed > 0 else ()
        self._near, self._extra_flights = None, MOST_FLIGHTS
        far = blocks and near is not None and math.dist(blocks[0].place, near) > CLOSE_M
        if blocks and (near is None or ((far or not blocks[0].certain) and self._closer > 0)):
            self._closer = MOST_FLIGHTS if near is None else self._closer - 1
            self._near = blocks[0].place
            self._resumed = middle is None and near is None
            return ()
        if blocks and blocks[0].certain:
            self._unnamed -= 1
            self._next, self._tries = number, 0
            return self._say_jammed(picture, tick, number, blocks[0].place, blocks[0].box, 0.9)
        if middle is not None or (near is not None and not self._resumed):
            return ()
        self._next, self._tries = number, 0
        return self._say(CLEAR, number, place)

    def _say_jammed(
        self, picture: Picture, tick: int, number: int, at: GroundPoint, box: ImageBox, confidence: float
    ) -> tuple[Outgoing, ...]:
        self._wait_until = tick + WAIT_TICKS
        messages = self._say(JAMMED, number, at)
        if self._report is not None:
            where = (*at, self._brief.water_level_m)
            messages += (sighting(self._report, picture.frame, self._class, box, where, confidence),)
        return messages

    def _blocks(self, picture: Picture) -> tuple[RoadBlock, ...]:
        """Return the blocked places of the route in a picture: among detected vehicles, or in the pixels."""
        lane = tuple(([self._start] if self._start is not None else []) + self._route)
        level_m = self._brief.water_level_m
        if self._vehicles is None:
            return find_blocks(picture.rgb, picture.pose, level_m, lane)
        boxes = [vehicle.box for vehicle in self._vehicles(picture, level_m)]
        return blocks_of_vehicles(boxes, picture.pose, level_m, lane)

    def _queues(self, picture: Picture) -> tuple[VehicleQueue, ...]:
        """Return the queues along the route in a picture: those of the detector, or of the colour rule."""
        lane = tuple(([self._start] if self._start is not None else []) + self._route)
        level_m = self._brief.water_level_m
        if self._detector is None:
            return find_queues(picture.rgb, picture.pose, level_m, lane)
        placed = [(box, box_to_plane(picture.pose, box.box, level_m)) for box in self._detector(picture, level_m)]
        legs = tuple(pairwise(corners(lane)))
        return tuple(
            VehicleQueue(box.box, box.confidence, at[:2], 0)
            for box, at in placed
            if at is not None and any(distance_to_segment_m(at[:2], *leg) <= LANE_M for leg in legs)
        )

    def _say(self, state: str, number: int, place: GroundPoint) -> tuple[Outgoing, ...]:
        if self._status is None:
            return ()
        where = (round(place[0], 1), round(place[1], 1), self._brief.water_level_m)
        return (compose(self._status, {"task": f"{INSPECT}-{number}", "state": state, "position": where}),)

    def _move(self, own: EntityView, tick: int) -> Action | None:
        assert own.position is not None
        if own.status == "grounded":
            return self._fly(*own.position[:2])  # vertically, because of houses around
        if tick < self._wait_until and self._route:
            # The next route begins at the same place as this one: go there while waiting.
            first = self._route[0]
            return self._fly(*first) if math.dist(own.position[:2], first) > REACHED_M else None
        if self._next >= len(self._route):
            return self._view(own.position[:2])
        extra = self._near or self._middles.get(self._next)
        if extra is not None:
            if self._extra_flights and math.dist(own.position[:2], extra) > VIEW_M:
                self._extra_flights -= 1
                return self._fly(*extra)
            return photo(self._body, self._camera)
        if self._aim is None or self._aim[0] != self._next:
            self._aim = self._next, self._aimed(own.position[:2])
        x, y = self._aim[1]
        if math.dist(own.position[:2], (x, y)) > REACHED_M:
            self._tries += 1
            if self._tries <= 2 * ATTEMPTS:
                return self._fly(x, y)
        return photo(self._body, self._camera)

    def _view(self, here: GroundPoint) -> Action | None:
        """Return the flight to the next ordered place, or its picture."""
        if not self._looks:
            return None
        if math.dist(here, self._looks[0]) > VIEW_M and self._flights < ATTEMPTS:
            self._flights += 1
            return self._fly(*self._looks[0])
        return photo(self._body, self._camera)

    def _aimed(self, here: GroundPoint) -> GroundPoint:
        """Return the place to fly to for the next waypoint.

        Over the waypoint the road up to it is in view. A place short of it may save a tick, and a place beyond it may
        save one on the next leg.
        """
        place = self._route[self._next]
        distance = math.dist(here, place)
        if distance <= SLACK_M:
            return here
        if self._reach_m < distance <= self._reach_m + SLACK_M:
            return _towards(place, here, distance - self._reach_m)
        if self._next + 1 >= len(self._route):
            return place
        after = self._route[self._next + 1]
        most = SLACK_M if distance > self._reach_m else min(SLACK_M, self._reach_m - distance)
        wanted = math.dist(place, after) - self._reach_m - SLACK_M
        return _towards(place, after, min(most, max(0.0, wanted)))

    def _fly(self, x: float, y: float) -> Action:
        return fly(self._body, x, y, self._z)


def names_places(brief: Brief) -> bool:
    """Return whether a rule compares the place in a request for another route with that of a jam."""
    kinds = [message.kind for message in brief.messages if message.type == "trafficJam"]
    return any(f", {kind} `" in rule and ".position`" in rule for kind in kinds for rule in brief.rules)


def _ground_start(observation: Observation, body: str) -> GroundPoint | None:
    """Return the start of the route: the first other entity with a visible position, the vehicle that will drive it."""
    for view in observation.entities:
        if view.id != body and view.position is not None:
            return view.position[:2]
    return None


def _towards(start: GroundPoint, end: GroundPoint, distance_m: float) -> GroundPoint:
    """Return the point `distance_m` from `start` on the way to `end`, or `end` if that is nearer."""
    run = math.dist(start, end)
    return between(start, end, min(1.0, distance_m / run) if run else 0.0)
