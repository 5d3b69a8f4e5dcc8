"""Guidance of a walker to the building of a reference picture, with pictures from above.

An agent that receives the reference and the aircraft's pictures has the aircraft photograph the region around the
walker. It compares the walls in these pictures with the reference and plans a path around all obstacles to the front of
the most similar one. The walker's own picture of that front confirms or refutes it. A refuted front, or one that was
reached in vain, is excluded, and the next is tried.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from types import MappingProxyType

from lingjing.plugins.geometry import bearing_deg, box_to_plane, offset_xy, turn_deg
from lingjing.plugins.policy import Brief, Datum, EntityView, MessageSpec, Observation, Outgoing, Peer, Picture
from lingjing_agents.capability import compose, sends
from lingjing_agents.ground_plane import GroundPoint, GroundRectangle, inside
from lingjing_agents.heuristic.dogs.building_finder import FACE, WALK
from lingjing_agents.heuristic.events import view_of
from lingjing_agents.heuristic.target_types import Detector, Detectors, building_class
from lingjing_agents.paths.fewest_commands import PointsFromAbove, fewest_commands, ground_of
from lingjing_agents.perception.building_walls import (
    BuildingWall,
    ColouredPoints,
    ColourSpread,
    find_walls,
    reference_signature,
    signature,
)

REFERENCE = "reference"
"""The camera name of reference pictures."""
MARGIN_M = 12.0
"""Margin in metres around the region within which buildings are examined. Chosen."""

EYE_M = 0.33
"""Height of a walker's body above the ground in metres."""

APART_M, SEEN_M = 40.0, 18.0
"""Largest distance in metres between pictures along the region, so that one of them shows each wall at an angle, and
distance within which a place counts as photographed. Chosen.
"""

NEAR_M, NEARER_M = 9.0, 4.0
"""Distance in metres from a door at which a path ends, first and after a visit in vain. Chosen."""

INSET_M = -5.0
"""Margin in metres of paths inside the region (negative: inwards), because there are streets around it. Chosen."""

LONGEST_M = 25.0
"""Assumed longest step of a walker in metres. Chosen."""

DOOR_BONUS, LONG_BONUS = 0.06, 0.05
"""Score of a visible door, and of the building's longer side, beside the similarity. Chosen."""

SURE = 0.72
"""Similarity from which on a wall is approached before all pictures have arrived. Chosen."""

AT_M, STOOD_TICKS, RULED_OUT_M = 5.0, 4, 22.0
"""A walker within `AT_M` metres of a path's end for `STOOD_TICKS` ticks was there in vain; all walls within
`RULED_OUT_M` metres are excluded. Chosen.
"""

SAME_M = 12.0
"""Distance in metres between centres within which two walls are the same one, seen better. Chosen."""

ABOVE_DEG = 45.0
"""Tilt in degrees from which on a picture is taken from above. Chosen."""

OTHER, FACING_DEG, FACING_M = 0.5, 30.0, 45.0
"""Similarity below which a front is another one, for a walker's picture within these bearing (degrees) and distance (m)
limits. Chosen.
"""

FRONT = (slice(0, 36), slice(15, 85))
"""The part of a walker's picture with the front that it faces: rows and columns, in hundredths. Chosen."""


@dataclass(slots=True)
class _ApproachedWall:
    """The wall that the walker is guided to."""

    wall: BuildingWall
    """The wall that pictures have shown."""
    end: GroundPoint
    """The end of the path."""
    stood: int = 0
    """Ticks for which the walker has stood there."""
    nearer: bool = False
    """True after a visit in vain: the path ends nearer to the door."""


class BuildingGuidance:
    """The guidance of one episode: views of the region, excluded walls, present target."""

    def __init__(
        self,
        follower: Peer,
        message: MessageSpec,
        reference: ColourSpread,
        region: tuple[GroundPoint, ...],
        detector: Detector | None = None,
    ) -> None:
        self._follower, self._message, self._reference, self._region = follower, message, reference, region
        self._bounds = GroundRectangle.around(region, MARGIN_M)
        self._path_bounds = GroundRectangle.around(region, INSET_M)
        self._detector = detector
        self._detected: GroundPoint | None = None
        self._sent_to: GroundPoint | None = None
        self._unseen: list[GroundPoint] | None = None
        self._views: tuple[ColouredPoints, ...] = ()
        self._walls: tuple[BuildingWall, ...] | None = None
        self._ruled_out: list[GroundPoint] = []
        self._target: _ApproachedWall | None = None

    @staticmethod
    def of(
        brief: Brief, observation: Observation, detectors: Detectors = MappingProxyType({})
    ) -> BuildingGuidance | None:
        """Return the guidance of an agent that may guide a walker, observes its position and received a reference; else
        None.
        """
        message = sends(brief, "guidance")
        reference = next((picture for picture in observation.pictures if picture.camera == REFERENCE), None)
        if message is None or reference is None:
            return None
        for peer in brief.peers:
            view = view_of(observation, peer.resources[0]) if peer.resources else None
            if view is None or view.position is None or not message.is_for(peer.role):
                continue
            around = [region.polygon for region in brief.regions if inside(region.polygon, view.position[:2])]
            if around:
                smallest = min(around, key=lambda polygon: GroundRectangle.around(polygon).area_m2)
                detector = detectors.get(building_class(brief) or "")
                return BuildingGuidance(peer, message, reference_signature(reference.rgb), smallest, detector)
        return None

    def viewpoints(self, start: GroundPoint, most: int) -> tuple[GroundPoint, ...]:
        """Return at most `most` places for pictures, on a flight across the region from the side of `start`, without
        those near `start`: the aircraft has a picture from there, of the end of the route.
        """
        places = tuple(place for place in viewpoints(self._region, start, most) if math.dist(place, start) > SEEN_M)
        if self._unseen is None:
            self._unseen = list(places)
        return places

    def see(self, observation: Observation) -> None:
        """Process the new pictures."""
        follower = self._view(observation)
        ground = follower.position[2] - EYE_M if follower is not None and follower.position is not None else 0.0
        for picture in observation.pictures:
            if self._detector is not None and picture.camera != REFERENCE:
                self._detect(picture, self._detector, ground)
            view = ColouredPoints.of(picture, ground, self._bounds) if picture.camera != REFERENCE else None
            if view is not None and len(view.points):
                self._views, self._walls = (*self._views, view), None
                over = picture.pose.position[:2]
                if self._unseen is not None:
                    self._unseen = [place for place in self._unseen if math.dist(place, over) > SEEN_M]
            elif picture.entity == self._follower.resources[0] and self._detector is None:
                self._confirm(picture)

    def lead(self, observation: Observation, *, waited: bool) -> tuple[Outgoing, ...]:
        """Return the path to the best front as messages, whenever the front changes.

        Until all pictures have arrived, or have been `waited` for, only a very similar wall is approached.
        """
        follower = self._view(observation)
        if follower is None or follower.position is None:
            return ()
        if self._detector is not None:
            return self._lead_to_detection(follower) if waited or not self._unseen else ()
        if not self._views:
            return ()
        self._notice(follower.position[:2])
        if self._target is not None and self._target.stood > STOOD_TICKS and not self._target.nearer:
            return self._send_to(follower, self._target.wall, nearer=True)
        if self._walls is not None and self._target is not None:
            return ()
        if self._walls is None:
            self._walls = find_walls(self._views, self._bounds)
        best = self._best()
        if best is None or (self._unseen and not waited and self._likeness(best) < SURE):
            return ()
        if self._target is not None and math.dist(self._target.wall.middle, best.middle) < SAME_M:
            return ()
        return self._send_to(follower, best, nearer=False)

    def _detect(self, picture: Picture, find: Detector, ground_m: float) -> None:
        """Store the place of the building in a picture from above. The walker itself looks for it ahead."""
        if picture.pose.tilt_deg < ABOVE_DEG:
            return
        places = (box_to_plane(picture.pose, box.box, ground_m) for box in find(picture, ground_m))
        self._detected = next((place[:2] for place in places if place is not None), self._detected)

    def _lead_to_detection(self, follower: EntityView) -> tuple[Outgoing, ...]:
        """Return the way to the detected building, whenever it changes: straight without pictures with depth, because
        the walker finds its way around what it meets."""
        goal = self._detected
        if goal is None or (self._sent_to is not None and math.dist(goal, self._sent_to) < SAME_M):
            return ()
        self._sent_to = goal
        steps = [(WALK, place) for place in (*self._path(follower, goal, NEAR_M), goal)]
        return self._tell([*steps[:-1], (FACE, goal), steps[-1]])

    def _path(self, follower: EntityView, goal: GroundPoint, within_m: float) -> tuple[GroundPoint, ...]:
        """Return the path to within `within_m` of a place around what the pictures with depth show; empty if none is
        known."""
        assert follower.position is not None
        if not self._views:
            return ()
        here = follower.position[:2]
        views = [PointsFromAbove(view.over, view.points) for view in self._views]
        ground = ground_of(views, self._bounds, here)
        return fewest_commands(ground, self._path_bounds, here, follower.heading_deg or 0.0, goal, within_m, LONGEST_M)

    def _send_to(self, follower: EntityView, wall: BuildingWall, *, nearer: bool) -> tuple[Outgoing, ...]:
        """Return the path to a wall's door, or to its centre without a visible door."""
        assert follower.position is not None
        goal = wall.door or wall.middle
        within = NEARER_M if nearer else NEAR_M
        way = self._path(follower, goal, within)
        way = way or (offset_xy(goal, wall.bearing_deg, within),)
        self._target = _ApproachedWall(wall, way[-1], nearer=nearer)
        unsure = self._likeness(wall) < SURE and len(way) > 1
        steps = [(WALK, place) for place in way]
        steps.insert(len(way) - 1 if unsure else len(way), (FACE, goal))
        return self._tell(steps)

    def _confirm(self, picture: Picture) -> None:
        """Exclude the target if the walker's picture shows another front."""
        target, pose = self._target, picture.pose
        if target is None:
            return
        goal, here = target.wall.door or target.wall.middle, pose.position[:2]
        off = abs(turn_deg(pose.heading_deg, bearing_deg(here, goal)))
        if off > FACING_DEG or math.dist(here, goal) > FACING_M:
            return
        rows, columns = (
            slice(part.start * size // 100, part.stop * size // 100)
            for part, size in zip(FRONT, picture.rgb.shape[:2], strict=True)
        )
        if self._reference.likeness(signature(picture.rgb[rows, columns].reshape(-1, 3))) < OTHER:
            self._rule_out(target)

    def _rule_out(self, target: _ApproachedWall) -> None:
        self._ruled_out.append(target.wall.middle)
        self._target = None

    def _view(self, observation: Observation) -> EntityView | None:
        return view_of(observation, self._follower.resources[0])

    def _notice(self, here: GroundPoint) -> None:
        """Exclude the target if the walker stands near it without an arrival."""
        target = self._target
        if target is None:
            return
        target.stood = target.stood + 1 if math.dist(here, target.end) <= AT_M else 0
        if target.nearer and target.stood > STOOD_TICKS:
            self._rule_out(target)

    def _best(self) -> BuildingWall | None:
        open_walls = [
            wall
            for wall in self._walls or ()
            if wall.colours is not None
            and all(math.dist(wall.middle, place) > RULED_OUT_M for place in self._ruled_out)
        ]
        return max(open_walls, key=lambda wall: self._score(wall), default=None)

    def _score(self, wall: BuildingWall) -> float:
        bonus = (DOOR_BONUS if wall.door is not None else 0.0) + (LONG_BONUS if wall.long else 0.0)
        return self._likeness(wall) + bonus

    def _likeness(self, wall: BuildingWall) -> float:
        assert wall.colours is not None
        return self._reference.likeness(wall.colours)

    def _tell(self, steps: list[tuple[str, GroundPoint]]) -> tuple[Outgoing, ...]:
        messages = []
        for number, (step, place) in enumerate(steps, 1):
            body: dict[str, Datum] = {
                "assignee": self._follower.id,
                "step": step,
                "amount": number,
                "position": (round(place[0], 2), round(place[1], 2), 0.0),
            }
            messages.append(compose(self._message, body, to=(self._follower.id,)))
        return tuple(messages)


def viewpoints(region: tuple[GroundPoint, ...], start: GroundPoint, most: int) -> tuple[GroundPoint, ...]:
    """Return the places for pictures of a region: along its centre, away from the side of `start`.

    A picture is wider than high, and its top points in the direction of flight.
    """
    xs, ys = [x for x, _ in region], [y for _, y in region]
    west, south, wide, deep = min(xs), min(ys), max(xs) - min(xs), max(ys) - min(ys)
    east_of, north_of = (start[0] - west) / wide - 0.5, (start[1] - south) / deep - 0.5
    across = abs(east_of) > abs(north_of)
    count = min(most, math.ceil((wide if across else deep) / APART_M))
    stops = [(index + 0.5) / count for index in range(count)]
    if (east_of if across else north_of) > 0.0:
        stops.reverse()
    return tuple((west + (stop if across else 0.5) * wide, south + (0.5 if across else stop) * deep) for stop in stops)
