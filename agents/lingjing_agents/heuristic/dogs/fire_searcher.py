"""The fire searcher's rules: search for flames, report them, walk to the nearest and wait until it is out.

Several dogs share the ground by distance (they observe each other's positions) and report the searched places. Each
known fire belongs to the nearest free dog. All dogs compute the same assignment, so little communication is needed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from types import MappingProxyType
from typing import ClassVar

from lingjing.plugins.geometry import bearing_deg, pixel_ray, turn_deg
from lingjing.plugins.policy import (
    Action,
    Brief,
    CameraPose,
    CameraSpec,
    Datum,
    Decision,
    EntityView,
    Inbox,
    Observation,
    Outgoing,
    Picture,
    Resource,
)
from lingjing_agents.capability import centimetres, claims_limit, compose, may_send, natural, photo, sighting, team
from lingjing_agents.ground_plane import GroundPoint, GroundRectangle, between, position_in
from lingjing_agents.heuristic.dogs.known_fires import CLOSER, KnownFire, KnownFires
from lingjing_agents.heuristic.dogs.movement import EYE_M, DogMovement
from lingjing_agents.heuristic.dogs.seen_ground import SeenGround
from lingjing_agents.heuristic.events import view_of
from lingjing_agents.heuristic.sightings import name_in
from lingjing_agents.heuristic.target_types import Detectors
from lingjing_agents.paths.obstacle_grid import ObstacleGrid
from lingjing_agents.perception.fires_ahead import FireAhead, find_fires_ahead, fires_in_boxes
from lingjing_agents.perception.images import ImageBox
from lingjing_agents.perception.obstacles_ahead import near_walls

MARGIN_M = 6.0
"""Margin of paths around the region in metres: dogs start outside. Chosen."""

SURE_REPORT_M = 30.0
"""Distance in metres of a reported fire, at most, where claims are limited. Chosen: a nearer box is more exact."""

REPORTABLE = 0.6
"""Least confidence of a report. Chosen."""
BESIDE_M = 0.6
"""Distance in metres from a fire's centre to which a dog goes; it is put out from farther away. Chosen."""

PUT_OUT_M = 3.2
"""Distance in metres to a known fire within which a dog has put it out, when an event reports one. Chosen."""

DEEP_M = 14.0
"""Depth of buildings in metres: what lies farther behind a wall counts as hidden. Chosen: the middle of a deeper one is
seen from neither side."""

CHASE_TICKS = 50
"""Ticks of pursuit without a sight after which a fire counts as false until it is seen again. Chosen."""

UNSEEN = 1.7
"""Factor on the distance to a fire that a dog has not seen itself: there may be obstacles. Chosen."""

FIRE_M = 2.5
"""Radius in metres around a fire within which detected obstacles are ignored. Chosen."""
ONE_WALL_M, SURE_M = 2.0, 5.0
"""Distance in metres within which two obstacles belong to one wall, and distance beyond which they are unreliable.
Chosen.
"""

LOOK_AHEAD_DEG = 30.0
"""Largest bearing difference in degrees at which a picture covers the way ahead. Chosen."""
LOOK_EVERY_M, WORTH_A_LOOK_M = 15.0, 5.0
"""Distance in metres between pictures on the way, and least length of a step that is worth one. Chosen."""

FRESH_SHARE = 0.55
"""Share of the former distance at which a fire is photographed again. Chosen."""

NEAR_M = 4.0
"""Distance in metres within which a fire is approached step by step. Chosen."""

SAME_PLACE_M = 0.5
"""Distance in metres within which two pictures are taken from one place. Chosen."""
UPON_M = 1.5
"""Distance in metres to a believed position within which the fire may burn in any direction. Chosen."""

SHUT_IN = 3
"""Attempts that a fire without an open path costs. Chosen."""
TRIES = 14
"""Pictures and steps around a fire without success after which it counts as false. Chosen."""


class FireSearcher:
    """One dog. Its state belongs to one episode."""

    roles: ClassVar[tuple[str, ...]] = ("searcher",)
    reads: ClassVar[tuple[str, ...]] = ("report", "status")
    sends: ClassVar[tuple[str, ...]] = ("report", "status")

    def __init__(
        self, brief: Brief, body: Resource, camera: CameraSpec, detectors: Detectors = MappingProxyType({})
    ) -> None:
        self._brief, self._body, self._camera = brief, body, camera
        self._class = (*brief.classes, "fire")[0]
        self._detector = detectors.get(self._class)
        limit = claims_limit(brief)
        self._claims_left = None if limit is None else max(1, limit // len(team(brief)))
        self._report, self._status = may_send(brief, "report"), may_send(brief, "target_status")
        polygons = tuple(region.polygon for region in brief.regions if region.polygon)
        corners = tuple(corner for polygon in polygons for corner in polygon)
        self._movement = DogMovement(body, ObstacleGrid(GroundRectangle.around(corners, MARGIN_M)))
        self._sight = ObstacleGrid(self._movement.map.bounds)  # with distant, uncertain walls, which hide ground too
        self._seen_ground, self._fires = SeenGround(polygons, visible=self._is_visible), KnownFires()
        self._half_deg = camera.hfov_deg / 2.0
        self._goal: GroundPoint | None = None
        self._patience = 0
        self._outbox: list[Outgoing] = []
        self._heard: set[str] = set()
        self._snapped: tuple[GroundPoint, float] | None = None
        self._looked = False
        self._thought = ""

    def act(self, observation: Observation, inbox: Inbox) -> Decision:
        """Process messages and pictures, then take one step."""
        own = view_of(observation, self._body.id)
        if own is None or own.position is None or own.heading_deg is None:
            return Decision()
        here = own.position[:2]
        self._movement.feel(own, inbox)
        self._listen(observation, inbox)
        for picture in observation.pictures:
            if picture.entity == self._body.id:
                self._look(picture, observation, own.position[2])
        self._hear_events(observation, here)
        command = None if own.busy else self._next(observation, own, here)
        if not own.busy:
            self._movement.sent(command)
        messages, self._outbox = tuple(self._outbox), []
        return Decision(command=command, messages=messages, thought=self._thought)

    # -- messages and events

    def _listen(self, observation: Observation, inbox: Inbox) -> None:
        for envelope in inbox.messages:
            place = position_in(envelope.body)
            if place is None:
                continue
            if envelope.category == "report":
                self._fires.add(place, self._distance_from(envelope.sender, observation, place), envelope.sender)
            elif envelope.category == "target_status":
                state = name_in(envelope.body, "state")
                if state == "searched":
                    self._seen_ground.see_around(place)
                elif state == "done":
                    self._fires.put_out(place, 8.0)

    def _distance_from(self, sender: str, observation: Observation, place: GroundPoint) -> float:
        resources = next((peer.resources for peer in self._brief.peers if peer.id == sender), ())
        seen = [view_of(observation, name) for name in resources]
        return min((math.dist(v.position[:2], place) for v in seen if v is not None and v.position), default=60.0)

    def _hear_events(self, observation: Observation, here: GroundPoint) -> None:
        """Process events: the fire beside the acting dog is out, and that dog reports it."""
        for event in observation.events:
            if event.id in self._heard or not event.kind.startswith("extinguish"):
                continue
            self._heard.add(event.id)
            for name in event.entities:
                view = view_of(observation, name)
                place = here if name == self._body.id else view.position[:2] if view and view.position else None
                if place is None:
                    continue
                fire = self._fires.put_out(place, PUT_OUT_M)
                if fire is None and self._detector is not None:
                    self._fires.burnt(place)
                if fire is not None and name == self._body.id:
                    self._tell("extinguish", "done", fire.place)

    def _look(self, picture: Picture, observation: Observation, height_m: float) -> None:
        pose = picture.pose
        here = pose.position[:2]
        self._snapped = here, pose.heading_deg
        self._looked = True
        walls = near_walls(picture.rgb, pose)
        _close(self._sight, walls)
        self._seen_ground.see(here, pose.heading_deg, self._half_deg)
        for flames in self._fires_in(picture):
            place = self._inside(here, flames.place)
            if place is None or self._may_be_ashes(pose, flames.box):
                continue
            fire = self._fires.add(place, flames.distance_m, self._brief.agent)
            fire.looked_at, fire.chased = here, 0
            if fire.state == "open":
                self._say(picture, flames, fire)
        # The fire's own logs are no obstacle on the way to it.
        near = [place for place in walls if math.dist(place, here) <= SURE_M]
        _close(self._movement.map, [place for place in near if self._fires.near(place, FIRE_M) is None])

    def _fires_in(self, picture: Picture) -> tuple[FireAhead, ...]:
        ground_m = picture.pose.position[2] - EYE_M
        if self._detector is None:
            return find_fires_ahead(picture.rgb, picture.pose, ground_m)
        return fires_in_boxes(self._detector(picture, ground_m), picture.pose, ground_m)

    def _may_be_ashes(self, pose: CameraPose, box: ImageBox) -> bool:
        """Return whether a box may be that of a burnt-out fire. The colour rules see flames alone, a detector of the
        class may see ashes too."""
        return self._detector is not None and self._fires.is_behind_ashes(pose.position[:2], *_sides(pose, box))

    def _is_visible(self, here: GroundPoint, place: GroundPoint) -> bool:
        """Return whether no known wall hides a place. Places just behind a wall are inside a building and count as
        visible.
        """
        away = math.dist(here, place)
        if away <= DEEP_M:
            return True
        return self._sight.clear(here, between(here, place, (away - DEEP_M) / away))

    def _inside(self, here: GroundPoint, place: GroundPoint) -> GroundPoint | None:
        """Return a seen place, moved towards the dog until it is in the region; None if it is outside."""
        for share in (1.0, 0.9, 0.8, 0.7, 0.6, 0.5, 0.4):
            nearer = between(here, place, share)
            if self._movement.map.bounds.holds(nearer):
                return nearer
        return None

    def _say(self, picture: Picture, flames: FireAhead, fire: KnownFire) -> None:
        whole = flames.box[0] > 0.005 and flames.box[2] < 0.995
        if self._report is None or not whole or flames.confidence < REPORTABLE:
            return
        if flames.distance_m > CLOSER * fire.reported_from_m:
            return
        if self._claims_left is not None:
            again = math.isfinite(fire.reported_from_m)  # the last claim is kept for a fire that has none yet
            if self._claims_left < (2 if again else 1) or flames.distance_m > SURE_REPORT_M:
                return
            self._claims_left -= 1
        fire.reported_from_m = flames.distance_m
        cls, where = self._class, (*centimetres(flames.place), 0.0)
        self._outbox.append(sighting(self._report, picture.frame, cls, flames.box, where, flames.confidence))

    def _tell(self, task: str, state: str, place: GroundPoint) -> None:
        if self._status is not None:
            body: dict[str, Datum] = {"task": task, "state": state, "position": (*place, 0.0)}
            self._outbox.append(compose(self._status, body))

    # -- actions

    def _next(self, observation: Observation, own: EntityView, here: GroundPoint) -> Action | None:
        fire = self._mine(observation, here)
        self._thought = (
            f"fire at {_place_words(fire.place)}" if fire is not None else f"look around at {_place_words(self._goal)}"
        )
        if fire is not None:
            self._goal = None
            return self._fight(observation, own, here, fire)
        return self._search(observation, own, here)

    def _mine(self, observation: Observation, here: GroundPoint) -> KnownFire | None:
        """Return this dog's fire in the common assignment of fires to nearest free dogs, or None."""
        mates = {peer.id: peer.resources for peer in self._brief.peers if peer.role == self._brief.role}
        places = {self._brief.agent: here}
        for name, resources in mates.items():
            view = view_of(observation, resources[0]) if resources else None
            if view is not None and view.position is not None:
                places[name] = view.position[:2]
        fires = list(self._fires.of("open"))
        while fires and places:
            _, _, name, index = min(
                (round(_way_m(name, at, fire), 3), natural(name), name, index)
                for name, at in places.items()
                for index, fire in enumerate(fires)
            )
            if name == self._brief.agent:
                return fires[index]
            del places[name], fires[index]
        return None

    def _fight(self, observation: Observation, own: EntityView, here: GroundPoint, fire: KnownFire) -> Action | None:
        distance = math.dist(here, fire.place)
        fire.chased += 1
        if fire.chased > CHASE_TICKS:
            fire.state = "false"
            return None
        due = fire.looked_at is None or distance < FRESH_SHARE * math.dist(fire.looked_at, fire.place)
        moved = fire.looked_at is None or math.dist(here, fire.looked_at) > 1.5
        if due and moved and distance > BESIDE_M + 0.6 and self._movement.map.clear(here, fire.place):
            return self._glance(own, here, fire)
        action = self._walk(own, here, fire.place, BESIDE_M)
        if action is not None and distance > NEAR_M:
            return action
        if distance > NEAR_M:
            self._shut_in(fire)
            return self._walk(own, here, fire.place, BESIDE_M) or self._search(observation, own, here)
        return self._close_in(own, here, fire, action)

    def _close_in(self, own: EntityView, here: GroundPoint, fire: KnownFire, action: Action | None) -> Action | None:
        """Walk up to the believed position, with new pictures in between.

        On the position itself the dog cannot face the fire, so it takes pictures all around.
        """
        assert own.heading_deg is not None
        fire.tries += 1
        if fire.tries > TRIES:
            fire.state = "false"
            self._movement.map.forget()
            return None
        if action is not None and fire.tries % 3:
            return action
        if math.dist(here, fire.place) > UPON_M:
            return self._glance(own, here, fire)
        if self._snapped is not None and _same_view(self._snapped, (here, own.heading_deg)):
            return self._movement.turn(2.0 * self._half_deg)
        return photo(self._body, self._camera)

    def _shut_in(self, fire: KnownFire) -> None:
        """Clear the map if no path to a fire is known, since some closed cells may be open; a limited number of
        times.
        """
        self._movement.map.forget()
        fire.tries += SHUT_IN
        if fire.tries > TRIES:
            fire.state = "false"

    def _glance(self, own: EntityView, here: GroundPoint, fire: KnownFire) -> Action:
        """Face the fire and photograph it."""
        assert own.heading_deg is not None
        off = turn_deg(own.heading_deg, bearing_deg(here, fire.place))
        if abs(off) > LOOK_AHEAD_DEG:
            return self._movement.turn(off)
        fire.looked_at = here
        return photo(self._body, self._camera)

    def _search(self, observation: Observation, own: EntityView, here: GroundPoint) -> Action | None:
        assert own.heading_deg is not None
        others = tuple(
            view.position[:2] for view in observation.entities if view.id != self._body.id and view.position is not None
        )
        if self._goal is None and self._snapped is None:
            return photo(self._body, self._camera)
        if self._goal is None:
            self._goal = self._seen_ground.next_place(here, others)
            if self._goal is None:
                self._seen_ground.next_pass()
                self._movement.map.forget()
                self._sight.forget()
                self._goal = self._seen_ground.next_place(here, others)
            if self._goal is None:
                return None
            self._patience = 8 + int(2.5 * math.dist(here, self._goal) / self._movement.longest_m)
        self._patience -= 1
        action = self._walk(own, here, self._goal, 3.0) if self._patience > 0 else None
        if action is not None:
            return action
        return self._look_around(own, here)

    def _walk(self, own: EntityView, here: GroundPoint, goal: GroundPoint, reach_m: float) -> Action | None:
        """Return the next step, or first a picture of the way ahead: a collision costs more than a picture."""
        action = self._movement.towards(own, goal, reach_m=reach_m)
        if action is None or action.verb != "forward" or own.heading_deg is None:
            return action
        length = action.arguments["distance"]
        if not isinstance(length, float) or length < WORTH_A_LOOK_M or self._has_looked(here, own.heading_deg):
            return action
        return photo(self._body, self._camera)

    def _has_looked(self, here: GroundPoint, heading_deg: float) -> bool:
        if self._snapped is None:
            return False
        place, heading = self._snapped
        return abs(turn_deg(heading, heading_deg)) < LOOK_AHEAD_DEG and math.dist(place, here) < LOOK_EVERY_M

    def _look_around(self, own: EntityView, here: GroundPoint) -> Action | None:
        assert own.heading_deg is not None and self._goal is not None
        turn = self._seen_ground.best_turn(here, own.heading_deg, self._half_deg)
        if turn is None:
            if math.dist(here, self._goal) > 6.0:
                self._seen_ground.refuse(self._goal)
            elif self._looked:
                self._tell("search", "searched", here)
            self._goal, self._looked = None, False
            return None
        return photo(self._body, self._camera) if turn == 0.0 else self._movement.turn(turn)


def _close(known: ObstacleGrid, places: Sequence[GroundPoint]) -> None:
    """Close the cells of obstacles, and those between two neighbouring ones of one wall."""
    for place in places:
        known.close(place)
    for a, b in pairwise(places):
        if math.dist(a, b) <= ONE_WALL_M:
            known.wall(a, b)


def _way_m(name: str, here: GroundPoint, fire: KnownFire) -> float:
    """Return the assumed length of the way to a fire. For dogs that did not see it last, obstacles are likely."""
    return math.dist(here, fire.place) * (1.0 if fire.seen_by == name else UNSEEN)


def _sides(pose: CameraPose, box: ImageBox) -> tuple[float, float]:
    """Return the bearings of the left and the right side of a box, in degrees."""
    v = (box[1] + box[3]) / 2.0 * pose.height
    left, right = (pixel_ray(pose, share * pose.width, v) for share in (box[0], box[2]))
    return bearing_deg((0.0, 0.0), left[:2]), bearing_deg((0.0, 0.0), right[:2])


def _same_view(a: tuple[GroundPoint, float], b: tuple[GroundPoint, float]) -> bool:
    """Return whether two pictures, each from a place with a heading, show the same."""
    return math.dist(a[0], b[0]) < SAME_PLACE_M and abs(turn_deg(a[1], b[1])) < LOOK_AHEAD_DEG


def _place_words(place: GroundPoint | None) -> str:
    return "this place" if place is None else f"({place[0]:.0f}, {place[1]:.0f})"
