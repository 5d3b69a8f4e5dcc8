"""The guiding pilot's rules: find a leak from above, report it, guide a walker without a camera to it, and go on to the
next one.

The pilot flies over the narrowest region until a picture shows a leak, descends for a nearer picture, reports, and
sends one step at a time: a turn or a walk, around the obstacles in its depth pictures. Adjudication gives no feedback
on a report. If the first walk does not begin, the pilot descends and reports again. Messages of guidance are limited,
so each must be worth it.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from types import MappingProxyType
from typing import ClassVar

import numpy as np

from lingjing.plugins.geometry import bearing_deg, box_to_plane, ground_footprint, turn_deg
from lingjing.plugins.policy import (
    PHOTO,
    Action,
    Brief,
    Datum,
    Decision,
    EntityView,
    Inbox,
    Observation,
    Outgoing,
    Peer,
    Picture,
    Resource,
    Vector,
)
from lingjing_agents.capability import centimetres, compose, fly, may_send, nadir_camera, photo, rated, sends, sighting
from lingjing_agents.flight_levels import FlightLevels
from lingjing_agents.ground_plane import (
    GroundPoint,
    GroundRectangle,
    distance_to_segment_m,
    inside,
    lattice,
    position_in,
)
from lingjing_agents.heuristic.events import EventLog, view_of
from lingjing_agents.heuristic.sightings import name_in
from lingjing_agents.heuristic.target_types import Detectors
from lingjing_agents.paths.kept_path import KeptPath
from lingjing_agents.paths.obstacle_grid import ObstacleGrid
from lingjing_agents.perception.depth_points import close_what_stands, heights
from lingjing_agents.perception.pipe_leaks import PIPE_M, PipeLeak, find_leaks

STEP_M = 7.5
"""Longest walk of one message in metres. Chosen."""

OFF_DEG = 6.0
"""Tolerated heading error of a walk in degrees. Chosen."""
BESIDE_M = (4.5, 3.0, 1.5)
"""Distances in metres from the leak at which guidance ends. A leak is sealed from 5 m. Each shorter distance is tried
if nothing happens at the one before. Chosen."""
SAFE_M = 0.5
"""Length in metres by which the last step ends nearer than it must. Chosen: a walk errs by a few decimetres."""
LIMIT = "limit"
"""The reason of receipts of what a limit of the mission rejects. A pilot's only limited requests are its guidance."""
REACHED_M = 4.0
"""Distance in metres at which a waypoint counts as reached. Chosen."""
PASSES_M = (45.0, 30.0, 20.0)
"""Search heights in metres, lower with each pass. Chosen."""

BEGUN_M = 0.5
"""Motion in metres from which on a walk has begun, and so was permitted. Chosen."""
CLOSER_M = 26.0
"""Height in metres of the first nearer picture. Chosen."""
SURE = 0.4
"""Least confidence of a detection. Chosen."""
ANSWER_TICKS = 3
"""Ticks between two reports, and ticks for a step without a report of its end. Chosen."""

SAMPLE_M = 6.0
"""Distance between search places in metres. Chosen."""
EVEN_M = 0.1
"""Difference in metres of the distances to the edge below which two points are equally deep in a region. Chosen."""
AXIS_M, AXIS_STEP_M = 6.0, 0.5
"""Distance in metres around a detection within which the axis of the line is sought, and spacing of the tried points.
The spray ends up to 9 m from the pipe (`perception.pipe_leaks`), and its box is centred within half of that. Chosen."""

SAME_M = 12.0
"""Distance in metres within which two detections are one leak. Chosen: spray reaches 9 m from the pipe."""

SPRAY_M = 6.0
"""Distance in metres from a leak within which nothing is taken for an obstacle. Spray is high in a depth picture and
stops no walker, and guidance ends before the pipe: with the spray closed, no place within the first of `BESIDE_M` was
free in one of ten instances, and the way led around the pipe. Chosen."""

EYE_M = 0.33
"""Height of a guided dog's body above the ground in metres."""


@dataclass(slots=True)
class _BelievedLeak:
    """The believed leak."""

    place: Vector
    """Its position in metres."""
    trusted: bool = False
    """True if its last report counts as accepted."""
    reported_tick: int = -99
    """The tick of the last report; -99 before the first."""
    reports: int = 0
    """Number of reports."""


class LeakGuidance:
    """One airborne camera and one walker. Its state belongs to one episode.

    Several pilots share the search area and fly at levels of their own. A pilot without a walker only searches; its
    reports are trusted.
    """

    roles: ClassVar[tuple[str, ...]] = ("pilot",)
    reads: ClassVar[tuple[str, ...]] = ("report", "status")
    sends: ClassVar[tuple[str, ...]] = ("report", "guidance")

    def __init__(self, brief: Brief, body: Resource, detectors: Detectors = MappingProxyType({})) -> None:
        camera = nadir_camera(body)
        assert camera is not None
        self._brief, self._body, self._camera = brief, body, camera
        self._detector = detectors.get(self._class())
        self._report, self._guide = may_send(brief, "report"), sends(brief, "guidance")
        mates = sorted((brief.agent, *(peer.id for peer in brief.peers if peer.role == brief.role)))
        self._rank, self._mates = mates.index(brief.agent), len(mates)
        led = _followers(brief)
        self._follower = led[self._rank] if self._rank < len(led) else None
        self._idle = frozenset(mates[len(led) :])
        regions = sorted(
            (region for region in brief.regions if region.polygon), key=lambda region: _area(region.polygon)
        )
        self._line = regions[0].polygon if regions else ()
        corners = tuple(corner for region in regions for corner in region.polygon)
        self._map = ObstacleGrid(GroundRectangle.around(corners, 4.0))
        self._low, self._high = rated(body, "band_low_m", 12.0), rated(body, "band_high_m", 60.0)
        self._way = KeptPath(self._map, 1.0)
        self._levels = FlightLevels(self._rank, self._mates, self._low + 1.0, self._high - 1.0)
        self._passes, self._left = 0, self._share()
        self._ground = 0.0
        self._dog_at: GroundPoint | None = None
        self._leak: _BelievedLeak | None = None
        self._goal: Vector | None = None
        self._flights = 0
        self._mapped: set[tuple[int, int]] = set()
        self._walked = False
        self._step: tuple[int, GroundPoint, float, str, float] | None = None
        self._tries, self._arrived = 0, -1
        self._events = EventLog("seal")
        self._sealed: list[GroundPoint] = []
        self._others: list[Vector] = []

    def act(self, observation: Observation, inbox: Inbox) -> Decision:
        """Process pictures and messages, send guidance, fly."""
        own = view_of(observation, self._body.id)
        dog = view_of(observation, self._follower.resources[0]) if self._follower is not None else None
        if own is None or own.position is None:
            return Decision()
        if dog is not None and dog.position is not None:
            self._ground, self._dog_at = dog.position[2] - EYE_M, dog.position[:2]
        if self._events.fresh_rescues(observation.events) and self._leak is not None:
            self._go_on(self._leak)
        messages: tuple[Outgoing, ...] = ()
        for picture in observation.pictures:
            if picture.entity == self._body.id and picture.camera == self._camera.name:
                messages += self._look(picture, observation)
        self._hear(observation, inbox, dog)
        if self._leak is not None and self._leak.trusted and dog is not None:
            messages += self._lead(observation, dog)
        command = None if own.busy else self._fly(observation, own, dog)
        return Decision(command=command, messages=messages)

    def _go_on(self, leak: _BelievedLeak) -> None:
        """Leave a sealed leak for another one that pictures have shown, or for the search."""
        self._sealed.append(leak.place[:2])
        self._others = [place for place in self._others if not _is_near(place, self._sealed)]
        self._leak = _BelievedLeak(self._others.pop(0)) if self._others else None
        self._goal, self._step, self._flights, self._walked = None, None, 0, False
        self._tries, self._arrived = 0, -1
        self._mapped.clear()

    # -- pictures and reports

    def _look(self, picture: Picture, observation: Observation) -> tuple[Outgoing, ...]:
        finds = [leak for leak in self._leaks(picture) if self._plausible(leak)]
        if picture.depth is not None:
            points = heights(picture.depth, picture.pose, self._ground)
            for place in self._leak_places(finds):
                points = points[np.hypot(points[:, 0] - place[0], points[:, 1] - place[1]) > SPRAY_M]
            close_what_stands(self._map, points, self._dog_at)
        footprint = ground_footprint(picture.pose, self._ground)
        if footprint is not None:
            self._left = [place for place in self._left if not inside(footprint, place)]
        if not finds:
            if self._leak is not None and not self._leak.trusted and self._leak.reported_tick < 0:
                self._leak = None  # the nearer picture shows no leak
            return ()
        self._note_others(finds)
        mine = finds if self._leak is None else [find for find in finds if _is_near(find.place, [self._leak.place[:2]])]
        leak = (mine or finds)[0]
        near = picture.pose.position[2] - self._ground < CLOSER_M + 4.0
        if self._leak is None or not self._leak.trusted:
            reported_tick, reports = (
                (self._leak.reported_tick, self._leak.reports) if self._leak is not None else (-99, 0)
            )
            self._leak = _BelievedLeak(leak.place, False, reported_tick, reports)
        if not near and leak.confidence < 0.9 and self._leak.reports == 0:
            return ()
        if self._leak.trusted or observation.tick - self._leak.reported_tick < ANSWER_TICKS:
            return ()
        return self._say(picture, leak, observation.tick)

    def _leak_places(self, finds: Iterable[PipeLeak]) -> list[GroundPoint]:
        """Return the places of the believed leak, of the others that pictures have shown, and of `finds`."""
        believed = [self._leak.place] if self._leak is not None else []
        return [place[:2] for place in (*believed, *self._others, *(find.place for find in finds))]

    def _note_others(self, finds: list[PipeLeak]) -> None:
        """Store the places of leaks beside the one that the pilot works on."""
        known = [self._leak.place[:2] if self._leak is not None else finds[0].place[:2]]
        for find in finds:
            if not _is_near(find.place, [*known, *(place[:2] for place in self._others)]):
                self._others.append(find.place)

    def _leaks(self, picture: Picture) -> tuple[PipeLeak, ...]:
        """Return the leaks in a picture: those of the detector, or of the colour rule."""
        if self._detector is None:
            return find_leaks(picture.rgb, picture.pose, self._ground)
        level_m = self._ground + PIPE_M
        placed = [(box, box_to_plane(picture.pose, box.box, level_m)) for box in self._detector(picture, level_m)]
        return tuple(
            PipeLeak(box.box, (*on_the_axis(self._line, at[:2]), at[2]), box.confidence)
            for box, at in placed
            if at is not None
        )

    def _plausible(self, leak: PipeLeak) -> bool:
        whole = leak.box[0] > 0.003 and leak.box[1] > 0.003 and leak.box[2] < 0.997 and leak.box[3] < 0.997
        new = not _is_near(leak.place, self._sealed)
        return whole and new and leak.confidence >= SURE and (not self._line or inside(self._line, leak.place[:2]))

    def _say(self, picture: Picture, leak: PipeLeak, tick: int) -> tuple[Outgoing, ...]:
        assert self._leak is not None
        self._leak.reported_tick, self._leak.reports = tick, self._leak.reports + 1
        if self._report is None:
            return ()
        where = centimetres(leak.place)
        return (sighting(self._report, picture.frame, self._class(), leak.box, where, leak.confidence),)

    def _class(self) -> str:
        return next((name for name in self._brief.classes if "leak" in name), (*self._brief.classes, "leak")[0])

    def _hear(self, observation: Observation, inbox: Inbox, dog: EntityView | None) -> None:
        if self._leak is not None and 0 <= self._leak.reported_tick < observation.tick:
            self._leak.trusted = True
        if any(receipt.status == "rejected" and receipt.reason == LIMIT for receipt in inbox.receipts):
            self._guide = None  # no guidance is left: a further message would be rejected too
        for envelope in inbox.messages:
            place = position_in(envelope.body) if envelope.sender in self._idle else None
            if place is not None and envelope.category == "report" and self._leak is None:
                self._leak = _BelievedLeak((*place, self._ground), True, observation.tick, 1)
        if self._step is None or dog is None or dog.position is None or dog.heading_deg is None:
            return
        since, start, heading, verb, amount = self._step
        states = [
            name_in(envelope.body, "state") for envelope in inbox.messages if envelope.category == "target_status"
        ]
        moved_m, turned = math.dist(start, dog.position[:2]), abs(turn_deg(heading, dog.heading_deg))
        carried_out = moved_m > amount - 0.5 if verb == "forward" else turned > amount - 3.0
        late = observation.tick - since > 2 * ANSWER_TICKS
        ended = observation.tick - since >= ANSWER_TICKS and ("done" in states or "blocked" in states)
        if not (carried_out or ended or late):
            return
        self._walked = self._walked or (verb == "forward" and moved_m > BEGUN_M)
        if verb == "forward" and not self._walked and self._leak is not None:
            self._leak = _BelievedLeak(self._leak.place, False, -ANSWER_TICKS, self._leak.reports)
        elif verb == "forward" and moved_m < amount - 1.0:
            self._map.bump(dog.position[:2], dog.heading_deg)
        self._step = None

    # -- guiding

    def _lead(self, observation: Observation, dog: EntityView) -> tuple[Outgoing, ...]:
        assert self._leak is not None
        if self._step is not None or self._guide is None or dog.position is None or dog.heading_deg is None:
            return ()
        here, goal = dog.position[:2], self._leak.place[:2]
        self._map.tread(here)
        beside_m = self._beside_m(observation.tick, math.dist(here, goal))
        if math.dist(here, goal) <= beside_m:
            return ()
        way = self._way.ahead(here, goal, beside_m) or (goal,)
        distance = math.dist(here, way[0])
        off = turn_deg(dog.heading_deg, bearing_deg(here, way[0]))
        if abs(off) > OFF_DEG and distance * math.sin(math.radians(min(abs(off), 90.0))) > 0.8:
            verb, amount = ("right" if off > 0 else "left"), min(abs(off), 90.0)
        else:
            left = max(1.0, distance - beside_m + SAFE_M) if way[0] == goal else distance
            verb, amount = "forward", min(STEP_M, left)
        self._step = observation.tick, here, dog.heading_deg, verb, amount
        body: dict[str, Datum] = {
            "assignee": self._follower.id if self._follower is not None else "",
            "step": verb,
            "amount": round(amount, 1),
            "position": centimetres(self._leak.place),
        }
        return (compose(self._guide, body),)

    def _beside_m(self, tick: int, distance_m: float) -> float:
        """Return the distance from the leak at which guidance ends. A shorter one is tried if nothing happens there."""
        if distance_m > BESIDE_M[self._tries]:
            self._arrived = -1
        elif self._arrived < 0:
            self._arrived = tick
        elif tick - self._arrived > ANSWER_TICKS and self._tries + 1 < len(BESIDE_M):
            self._tries, self._arrived = self._tries + 1, -1
        return BESIDE_M[self._tries]

    # -- flying

    def _fly(self, observation: Observation, own: EntityView, dog: EntityView | None) -> Action | None:
        assert own.position is not None
        leak = self._leak
        if leak is not None and leak.trusted:
            return self._map_the_way(own, dog)
        if leak is not None:
            if observation.tick - leak.reported_tick < ANSWER_TICKS:
                return None
            height = max(self._low + 2.0, CLOSER_M - 4.0 * leak.reports)
            return self._photograph_at(own, (leak.place[0], leak.place[1], self._ground + height))
        if self._goal is None:
            self._goal = self._next_place(own.position)
        return self._photograph_at(own, self._goal) if self._goal is not None else None

    def _next_place(self, here: Vector) -> Vector | None:
        if not self._left:
            self._passes += 1
            self._left = self._share()
        height = min(max(PASSES_M[min(self._passes, len(PASSES_M) - 1)], self._low + 1.0), self._high - 1.0)
        reach = 0.4 * height
        if not self._left:
            return None

        def worth(place: GroundPoint) -> float:
            gain = sum(1 for other in self._left if math.dist(place, other) <= reach)
            return gain / (25.0 + math.dist(place, here[:2]))

        place = max(sorted(self._left), key=worth)
        return place[0], place[1], self._ground + height

    def _map_the_way(self, own: EntityView, dog: EntityView | None) -> Action | None:
        """Photograph the ground between walker and leak during guidance."""
        assert self._leak is not None and own.position is not None
        if dog is None or dog.position is None:
            return None
        x, y = (0.5 * dog.position[0] + 0.5 * self._leak.place[0], 0.5 * dog.position[1] + 0.5 * self._leak.place[1])
        key = (round(x / 20.0), round(y / 20.0))
        if key in self._mapped:
            return None
        height = min(self._high - 1.0, max(35.0, 0.9 * math.dist(dog.position[:2], self._leak.place[:2])))
        action = self._photograph_at(own, (x, y, self._ground + height))
        if action.verb == PHOTO:
            self._mapped.add(key)
        return action

    def _share(self) -> list[GroundPoint]:
        """Return this pilot's share of the search places."""
        places = lattice(self._line, SAMPLE_M)
        return places[self._rank * len(places) // self._mates : (self._rank + 1) * len(places) // self._mates]

    def _photograph_at(self, own: EntityView, goal: Vector) -> Action:
        assert own.position is not None
        if self._mates > 1:
            goal = (*goal[:2], self._levels.level(goal[2]))
        if math.dist(own.position, goal) <= REACHED_M or self._flights >= 3:
            self._flights, self._goal = 0, None
            return photo(self._body, self._camera)
        self._flights += 1
        return fly(self._body, *goal)


def _is_near(place: Vector, others: Iterable[GroundPoint]) -> bool:
    """Return whether a detection is at one of some places."""
    return any(math.dist(place[:2], other) <= SAME_M for other in others)


def _followers(brief: Brief) -> list[Peer]:
    """Return the walkers, one for the pilot of each rank: peers with a body that may receive guidance."""
    guide = sends(brief, "guidance")
    others = [peer for peer in brief.peers if peer.resources and peer.role != brief.role]
    return [peer for peer in others if guide is not None and guide.is_for(peer.role)]


def on_the_axis(line: tuple[GroundPoint, ...], place: GroundPoint) -> GroundPoint:
    """Return the nearest point on the axis of a narrow region: a pipe runs in the middle of its strip, and a leak is on
    the pipe while the middle of its spray is beside it. The place itself without a region around it."""
    count = round(AXIS_M / AXIS_STEP_M)
    tried = [
        (place[0] + AXIS_STEP_M * i, place[1] + AXIS_STEP_M * j)
        for i in range(-count, count + 1)
        for j in range(-count, count + 1)
        if math.hypot(i, j) <= count
    ]
    depths = {point: _depth_m(line, point) for point in tried if line and inside(line, point)}
    if not depths:
        return place
    deepest = max(depths.values())
    return min((point for point in depths if depths[point] >= deepest - EVEN_M),
               key=lambda point: (math.dist(point, place), point))  # fmt: skip


def _depth_m(polygon: tuple[GroundPoint, ...], place: GroundPoint) -> float:
    """Return the distance in metres from a point to the edge of a polygon."""
    edges = zip(polygon, (*polygon[1:], polygon[0]), strict=True)
    return min(distance_to_segment_m(place, start, end) for start, end in edges)


def _area(polygon: tuple[GroundPoint, ...]) -> float:
    pairs = zip(polygon, (*polygon[1:], polygon[0]), strict=True)
    return abs(sum(ax * by - bx * ay for (ax, ay), (bx, by) in pairs)) / 2.0
