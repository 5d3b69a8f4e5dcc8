"""The navigator's rules: find the building of the reference picture and walk up to it.

Each picture adds to a map of possible positions of the facade: columns that resemble it add evidence along their
bearing, at about the distance that their height implies. The dog walks to the best position and explores where nothing
has been seen yet. It removes positions that it has reached without arriving. Where a rule ends the mission unless the
dog is near the building in time, it explores the places first that it has not been that near to.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from types import MappingProxyType
from typing import ClassVar

import numpy as np

from lingjing.plugins.geometry import bearing_deg, pixel_ray, pixel_to_plane, turn_deg
from lingjing.plugins.policy import (
    Action,
    Brief,
    CameraPose,
    CameraSpec,
    Decision,
    EntityView,
    Inbox,
    Observation,
    Outgoing,
    Picture,
    Resource,
    Vector,
)
from lingjing_agents.capability import centimetres, claims_limit, photo, sends, sighting
from lingjing_agents.ground_plane import GroundPoint, GroundRectangle, inside, position_in
from lingjing_agents.heuristic.dogs.movement import EYE_M, DogMovement
from lingjing_agents.heuristic.dogs.seen_ground import SeenGround
from lingjing_agents.heuristic.dogs.timely_stages import timely_distances_m
from lingjing_agents.heuristic.events import view_of
from lingjing_agents.heuristic.sightings import name_in
from lingjing_agents.heuristic.target_types import Detector, Detectors, building_class
from lingjing_agents.paths.obstacle_grid import ObstacleGrid
from lingjing_agents.perception.facades import FacadeColumn, WallColour, facade_box, find_facades, look_of, skyline
from lingjing_agents.perception.images import FloatArray
from lingjing_agents.perception.obstacles_ahead import near_walls
from lingjing_agents.perception.people_at_sea import FoundBox

GRID_M = 8.0
"""Distance between positions of the map in metres."""
ARRIVAL_M = 20.0
"""Distance in metres to a position within which it is removed if the dog has not arrived. Chosen."""

SPREAD = 0.5
"""Usual error of a distance, as a factor's natural logarithm. Chosen."""

SLIVER, WHOLE = 0.2, 0.3
"""Least evidence of a box, and share of the picture's width from which on it is 1. A near building is wide; what is
seen of a far one may be its corner between two other houses. Chosen."""

COLUMN_DEG, INSIDE_M = 6.0, 6.0
"""Angle in degrees between the bearings of one box, and metres from a wall to the middle of the building. Chosen."""

VIEWS_M, VIEW_WORTH = (85.0, 55.0, 35.0), 24
"""Distance in metres up to which a view shows a facade, in each pass, and new samples that make a sideways picture
worth a tick. Chosen: buildings are large, and ticks are limited.
"""

FAR_SAMPLES = 8
"""Samples of the region that the dog has not been near to in time, from which on they are worth a walk. Chosen."""

WORTH_GOING, WORTH_GLIMPSE = 0.7, 0.15
"""Least score of a position for an approach: by resemblance, and by a detector, which names no other building, so that
a `SLIVER` in one picture is enough. Chosen.
"""
HELD = 1.25
"""Factor by which another position must be better before the goal changes. Chosen."""

ORDERED_M = 3.0
"""Distance in metres at which an ordered place counts as reached. Chosen."""

LOW_M, BESIDE_DEG, SAME_PLACE_M, LEAST_WALK_M = 11.0, 3.0, 8.0, 20.0
"""A line is open if no skyline along it, also `BESIDE_DEG` degrees aside, is so high (m) that it could be a building
nearer than the end. Skylines count within `SAME_PLACE_M` metres; ends nearer than `LEAST_WALK_M` are not worth a walk.
Chosen.
"""

MARGIN_M = 40.0
"""Margin of paths around the region in metres. Chosen."""
WALK, FACE, FACING_DEG = "walk", "face", 15.0
"""Guidance steps: a place to walk to, or to photograph; and the largest bearing error in degrees for the picture."""

NOT_YET, PATIENCE_TICKS = frozenset({"not_permitted"}), 2
"""Reason codes of a rejection that another event must precede, and the ticks before the next attempt. Chosen."""

UNLED_SHARE, LED_AGAIN_TICKS = 0.8, 6
"""Share of the ticks for which a guided dog waits for first guidance, and ticks for which it waits after a path has
ended. Chosen.
"""

MOST_REPORTS = 3
"""Reports of an episode, at most. Chosen: claims are limited from tier 1 on, and each report costs one."""

SURE_M = 60.0
"""Distance in metres of a detected building that is reported, at most. Chosen: the foot of a farther one is less than
five pixels below the horizon, so that its place is uncertain by more than a building's width.
"""

LARGE, WALL_CONFIDENCE, SAID_M, BUILDING = 0.18, 0.6, 15.0, "building"
"""Share of the picture from which on a wall of the reference's colour is reported, confidence of the report, and metres
between two reports. Measured on 280 pictures of two episodes: of 17 boxes that large, 13 were matched. Only a class
with this word is that of a whole building.
"""

FARTHEST_M = 150.0
"""Distance in metres of a building with its foot above the horizon. Chosen."""

FAR_M = 220.0
"""Distance in metres at which the weight of a position is halved. Chosen."""


class BuildingFinder:
    """One dog with a picture of its destination. Its state belongs to one episode."""

    roles: ClassVar[tuple[str, ...]] = ("navigator", "courier", "walker")
    reads: ClassVar[tuple[str, ...]] = ("assignment", "guidance")
    sends: ClassVar[tuple[str, ...]] = ("report",)

    def __init__(
        self,
        brief: Brief,
        body: Resource,
        camera: CameraSpec,
        reference: Picture | None,
        here: GroundPoint,
        detectors: Detectors = MappingProxyType({}),
    ) -> None:
        self._brief, self._body, self._camera = brief, body, camera
        self._wanted: WallColour | None = look_of(reference.rgb) if reference is not None else None
        self._class = building_class(brief) or ""
        self._detector = detectors.get(self._class)
        self._report, self._reports = sends(brief, "report"), 0
        self._most_reports = min(MOST_REPORTS, claims_limit(brief) or MOST_REPORTS)
        self._said_at: GroundPoint | None = None
        self._ordered: GroundPoint | None = None
        self._led: tuple[tuple[str, GroundPoint], ...] = ()
        self._guided = any(message.type == "guidance" and message.is_for(brief.role) for message in brief.messages)
        self._led_tick = 0
        self._ground, self._entrance = where_to_look(brief, here)
        self._movement = DogMovement(body, ObstacleGrid(GroundRectangle.around((*self._ground, here), MARGIN_M)))
        grounds = (self._ground,) if self._ground else ()
        self._seen_ground = SeenGround(grounds, VIEWS_M, VIEW_WORTH)
        self._far_grounds = tuple(SeenGround(grounds, (near_m,)) for near_m in timely_distances_m(brief))
        self._belief = Belief(self._ground)
        self._far: SeenGround | None = None
        self._goal: GroundPoint | None = None
        self._patience = 0
        self._snaps = camera.capture == "on_request"
        self._waits = 0
        self._snapped: tuple[GroundPoint, float] | None = None
        self._skylines: list[tuple[GroundPoint, tuple[tuple[float, float], ...]]] = []

    def act(self, observation: Observation, inbox: Inbox) -> Decision:
        """Process pictures, update the map, take one step."""
        own = view_of(observation, self._body.id)
        if own is None or own.position is None or own.heading_deg is None:
            return Decision()
        here = own.position[:2]
        self._movement.feel(own, inbox)
        self._listen(inbox)
        messages: tuple[Outgoing, ...] = ()
        for picture in observation.pictures:
            if picture.entity == self._body.id and picture.camera == self._camera.name:
                messages += self._see(picture)
        self._belief.strike(here, ARRIVAL_M)
        for ground in self._far_grounds:
            ground.come_to(here)
        if any(receipt.reason in NOT_YET for receipt in inbox.receipts):
            self._waits = PATIENCE_TICKS
        interacted = any(len(event.entities) > 1 for event in observation.events)
        self._waits = 0 if interacted else self._waits - 1
        if own.busy or self._waits > 0:
            return Decision(messages=messages)
        if self._led:
            self._led_tick = observation.tick
        elif self._guided and observation.tick - self._led_tick < self._patience_for(observation):
            return Decision(messages=messages)
        return Decision(command=self._next(own, here), messages=messages, thought=f"towards {self._goal}")

    def _patience_for(self, observation: Observation) -> float:
        """Return the ticks for which a guided dog waits for guidance."""
        return LED_AGAIN_TICKS if self._led_tick else UNLED_SHARE * self._brief.ticks

    def _listen(self, inbox: Inbox) -> None:
        """Process messages. An assignment to this dog with a position is its goal; guidance with positions is its
        path.
        """
        way = []
        for envelope in inbox.messages:
            assignee, place = name_in(envelope.body, "assignee"), position_in(envelope.body)
            if envelope.category == "assignment" and assignee in (self._brief.agent, self._body.id) and place:
                if (step := name_in(envelope.body, "step")) is not None:
                    way.append((step, place))
                else:
                    self._ordered = place
                    self._movement.map.reach(place, MARGIN_M)
        if way:
            self._led = tuple(way)

    def _see(self, picture: Picture) -> tuple[Outgoing, ...]:
        """Add a picture to the maps. Return a report for each building that a detector finds in it."""
        pose = picture.pose
        here = pose.position[:2]
        self._snapped = here, pose.heading_deg
        for place in near_walls(picture.rgb, pose):
            self._movement.map.close(place)
        self._seen_ground.see(here, pose.heading_deg, pose.hfov_deg / 2.0)
        self._skylines = [*self._skylines[-7:], (here, skyline(picture.rgb, pose))]
        if self._detector is not None:
            return self._detect(picture, self._detector)
        if self._wanted is not None:
            facades = find_facades(picture.rgb, pose, self._wanted)
            self._belief.add(here, pose.heading_deg, pose.hfov_deg / 2.0, facades)
            return self._say(picture, self._wanted)
        return ()

    def _say(self, picture: Picture, wanted: WallColour) -> tuple[Outgoing, ...]:
        """Return the report of a large wall that resembles the reference, far enough from the last report."""
        pose, here = picture.pose, picture.pose.position[:2]
        if self._report is None or self._reports >= self._most_reports or BUILDING not in self._class:
            return ()
        if self._said_at is not None and math.dist(self._said_at, here) < SAID_M:
            return ()
        box = facade_box(picture.rgb, pose, wanted)
        if box is None or (box[2] - box[0]) * (box[3] - box[1]) < LARGE:
            return ()
        self._reports += 1
        self._said_at = here
        place, _ = _foot(pose, FoundBox(box, WALL_CONFIDENCE), pose.position[2] - EYE_M)
        return (sighting(self._report, picture.frame, self._class, box, centimetres(place), WALL_CONFIDENCE),)

    def _detect(self, picture: Picture, find: Detector) -> tuple[Outgoing, ...]:
        """Add the detectors' buildings to the map, and return the reports of them."""
        pose, ground_m = picture.pose, picture.pose.position[2] - EYE_M
        here, facades, reports = pose.position[:2], [], []
        for box in find(picture, ground_m):
            place, is_standing = _foot(pose, box, ground_m)
            away = math.dist(here, place[:2]) + INSIDE_M if is_standing else math.inf
            likeness = box.confidence * max(SLIVER, min(1.0, (box.box[2] - box.box[0]) / WHOLE))
            facades += [FacadeColumn(bearing, away, likeness) for bearing in _bearings(pose, box)]
            is_sure = is_standing and math.dist(here, place[:2]) <= SURE_M
            if self._report is not None and is_sure and self._reports < self._most_reports:
                self._reports += 1
                where = centimetres(place)
                reports.append(sighting(self._report, picture.frame, self._class, box.box, where, box.confidence))
        self._belief.add(here, pose.heading_deg, pose.hfov_deg / 2.0, tuple(facades))
        return tuple(reports)

    def _next(self, own: EntityView, here: GroundPoint) -> Action | None:
        assert own.heading_deg is not None
        if (action := self._follow(own, here)) is not None:
            return action
        if self._ordered is not None:
            action = self._movement.towards(own, self._ordered, reach_m=ORDERED_M)
            if action is not None:
                return action  # a collision costs less than a picture before every step
            self._ordered = None
        if self._snaps and not self._fresh(here, own.heading_deg):
            return photo(self._body, self._camera)
        if self._entrance is not None:
            if math.dist(here, self._entrance) > 8.0 and not self._movement.bumps > 12:
                action = self._movement.towards(own, self._entrance, reach_m=6.0)
                if action is not None:
                    return action
            self._entrance = None
        best, score = self._belief.best(here)
        known = self._goal is not None and self._belief.at(self._goal) * HELD >= score and self._patience > 0
        if best is not None and score >= (WORTH_GOING if self._detector is None else WORTH_GLIMPSE):
            if not known:
                self._goal, self._patience = best, 10 + int(3 * math.dist(here, best) / self._movement.longest_m)
            assert self._goal is not None
            return self._approach(own, here, self._goal)
        return self._explore(own, here)

    def _follow(self, own: EntityView, here: GroundPoint) -> Action | None:
        """Return the next step of the guided path, or the requested picture."""
        assert own.heading_deg is not None
        while self._led:
            step, place = self._led[0]
            if step == FACE:
                off = turn_deg(own.heading_deg, bearing_deg(here, place))
                if abs(off) > FACING_DEG:
                    return self._movement.turn(off)
                self._led = self._led[1:]
                return photo(self._body, self._camera)
            action = self._movement.towards(own, place, reach_m=ORDERED_M, is_corner=len(self._led) > 1)
            if action is not None:
                return action
            self._led = self._led[1:]
        return None

    def _approach(self, own: EntityView, here: GroundPoint, goal: GroundPoint) -> Action | None:
        self._patience -= 1
        action = self._movement.towards(own, goal, reach_m=ARRIVAL_M * 0.5) if self._patience > 0 else None
        if action is not None:
            return action
        self._belief.strike(goal, GRID_M * 1.6)  # it cannot be reached, or it is another building
        self._goal = None
        return self._explore(own, here)

    def _explore(self, own: EntityView, here: GroundPoint) -> Action | None:
        assert own.heading_deg is not None
        turn = self._seen_ground.best_turn(here, own.heading_deg, self._camera.hfov_deg / 2.0)
        if turn:
            return self._movement.turn(turn)
        is_near = self._goal is not None and self._far is not None and self._goal not in self._far.unseen
        if self._goal is None or is_near or math.dist(here, self._goal) < 8.0 or self._patience <= 0:
            if self._goal is not None and self._patience <= 0:
                self._refuse(self._goal)
            self._far = next((ground for ground in self._far_grounds if len(ground.unseen) >= FAR_SAMPLES), None)
            self._goal = (self._far or self._seen_ground).next_place(here, (), self._in_the_open(here))
            if self._goal is None:
                self._far = None
                self._seen_ground.next_pass()
                self._goal = self._seen_ground.next_place(here, ())
            self._patience = 8 + int(2.5 * math.dist(here, self._goal or here) / self._movement.longest_m)
        self._patience -= 1
        if self._goal is None:
            return None
        action = self._movement.towards(own, self._goal, reach_m=7.0)
        if action is None:
            self._refuse(self._goal)
            self._goal = None
        return action

    def _refuse(self, place: GroundPoint) -> None:
        """Explore another place than this one, which cannot be reached."""
        for ground in (*self._far_grounds, self._seen_ground):
            ground.refuse(place)

    def _in_the_open(self, here: GroundPoint) -> Callable[[GroundPoint], bool]:
        """Return a function that tests whether a place is reachable in the open, by the skylines seen from about
        here.
        """
        lines = [line for place, line in self._skylines if math.dist(place, here) < SAME_PLACE_M]

        def seen(place: GroundPoint) -> bool:
            bearing, away = bearing_deg(here, place), math.dist(here, place)
            near = [elevation for line in lines for at, elevation in line if abs(turn_deg(at, bearing)) < BESIDE_DEG]
            clear = bool(near) and away * math.tan(math.radians(max(near))) < LOW_M
            return clear and away > LEAST_WALK_M and self._movement.map.clear(here, place)

        return seen

    def _fresh(self, here: GroundPoint, heading_deg: float) -> bool:
        if self._snapped is None:
            return False
        place, heading = self._snapped
        return math.dist(place, here) < 6.0 and abs(turn_deg(heading, heading_deg)) < 40.0


def _bearings(pose: CameraPose, box: FoundBox) -> list[float]:
    """Return bearings across a box, `COLUMN_DEG` apart: the middle of a building may lie behind any part of it."""
    x0, y0, x1, y1 = box.box
    wide_deg = (x1 - x0) * pose.hfov_deg
    count = max(1, math.ceil(wide_deg / COLUMN_DEG))
    v = (y0 + y1) / 2.0 * pose.height
    rays = [pixel_ray(pose, (x0 + (x1 - x0) * (part + 0.5) / count) * pose.width, v) for part in range(count)]
    return [bearing_deg((0.0, 0.0), (east, north)) for east, north, _ in rays]


def _foot(pose: CameraPose, box: FoundBox, ground_m: float) -> tuple[Vector, bool]:
    """Return the place on the ray through a box's centre above the ground point of its lower edge, at most `FARTHEST_M`
    away, and whether that point is nearer. What hides the foot of a building leaves a box above the horizon."""
    x0, _, x1, y1 = box.box
    u, v = (x0 + x1) / 2.0 * pose.width, y1 * pose.height
    foot = pixel_to_plane(pose, u, v, ground_m)
    seen_m = math.dist(foot[:2], pose.position[:2]) if foot is not None else math.inf
    away = min(FARTHEST_M, seen_m)
    ray = pixel_ray(pose, u, (box.box[1] + y1) / 2.0 * pose.height)
    steps = away / max(math.hypot(ray[0], ray[1]), 1e-6)
    x, y, z = pose.position
    return (x + steps * ray[0], y + steps * ray[1], z + steps * ray[2]), seen_m < FARTHEST_M


class Belief:
    """The evidence for the building's position, on a grid over a region."""

    def __init__(self, polygon: tuple[GroundPoint, ...]) -> None:
        xs, ys = [x for x, _ in polygon] or [0.0], [y for _, y in polygon] or [0.0]
        east = np.arange(min(xs) + GRID_M / 2, max(xs), GRID_M)
        north = np.arange(min(ys) + GRID_M / 2, max(ys), GRID_M)
        grid = np.stack(np.meshgrid(east, north), axis=-1).reshape(-1, 2)
        self._places: FloatArray = grid
        self._score = np.zeros(len(grid))
        self._out = np.zeros(len(grid), bool)

    def add(self, here: GroundPoint, heading_deg: float, half_deg: float, facades: tuple[FacadeColumn, ...]) -> None:
        """Add one picture. Similar columns add evidence along their bearing; views without any reduce that of near
        positions.
        """
        east, north = self._places[:, 0] - here[0], self._places[:, 1] - here[1]
        distance = np.maximum(np.hypot(east, north), 1.0)
        bearing = np.degrees(np.arctan2(east, north))
        speaks = np.zeros(len(distance))
        for facade in facades:
            off = np.abs((bearing - facade.bearing_deg + 180.0) % 360.0 - 180.0)
            if math.isinf(facade.distance_m):
                along = np.ones(len(distance))
            else:
                along = np.exp(-0.5 * (np.log(distance / max(facade.distance_m, 5.0)) / SPREAD) ** 2)
            across = np.exp(-0.5 * (off / np.maximum(2.0, np.degrees(GRID_M / 2 / distance))) ** 2)
            speaks = np.maximum(speaks, facade.likeness * along * across)
        off = np.abs((bearing - heading_deg + 180.0) % 360.0 - 180.0)
        against = (off < half_deg - 3.0) & (distance < 60.0) & (speaks < 0.05)
        self._score = np.maximum(self._score + speaks - 0.15 * against, 0.0)

    def strike(self, place: GroundPoint, within_m: float) -> None:
        """Remove all positions within that distance of a place."""
        east, north = self._places[:, 0] - place[0], self._places[:, 1] - place[1]
        self._out |= np.hypot(east, north) <= within_m

    def best(self, here: GroundPoint) -> tuple[GroundPoint | None, float]:
        """Return the best position with its score, nearer ones preferred; None without a grid."""
        if len(self._places) == 0:
            return None, 0.0
        east, north = self._places[:, 0] - here[0], self._places[:, 1] - here[1]
        worth = np.where(self._out, 0.0, self._score) / (1.0 + np.hypot(east, north) / FAR_M)
        index = int(np.argmax(worth))
        place = float(self._places[index, 0]), float(self._places[index, 1])
        return place, float(self._score[index]) if not self._out[index] else 0.0

    def at(self, place: GroundPoint) -> float:
        """Return the score of the grid's position nearest to this place."""
        if len(self._places) == 0:
            return 0.0
        index = int(np.argmin(np.hypot(self._places[:, 0] - place[0], self._places[:, 1] - place[1])))
        return 0.0 if self._out[index] else float(self._score[index])


def where_to_look(brief: Brief, here: GroundPoint) -> tuple[tuple[GroundPoint, ...], GroundPoint | None]:
    """Return the region to search, and the centre of its entrance if it must be entered first.

    From inside a region the smallest such is searched. From outside, the largest is searched and entered by the
    smallest.
    """
    regions = [region.polygon for region in brief.regions if region.polygon]
    regions.sort(key=lambda polygon: GroundRectangle.around(polygon).area_m2)
    own = [polygon for polygon in regions if inside(polygon, here)]
    if own or not regions:
        return (own[0] if own else ()), None
    return regions[-1], (_middle(regions[0]) if len(regions) > 1 else None)


def _middle(polygon: tuple[GroundPoint, ...]) -> GroundPoint:
    return sum(x for x, _ in polygon) / len(polygon), sum(y for _, y in polygon) / len(polygon)
