"""Leading a walker to the building of a reference picture with pictures from above.

Whoever is shown the reference and the flier's pictures has the flier look down on the region where the walker stands,
compares the walls that these pictures show with the reference, and makes a way around all that stands on the ground
to the front of the most likely one. The walker's own picture of that front confirms it or not: a front that is another,
or was reached in vain, is struck out, and the next is tried.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from lingjing.plugins.geometry import bearing_deg, offset_xy, turn_deg
from lingjing.plugins.policy import Brief, Datum, EntityView, MessageSpec, Observation, Outgoing, Peer, Picture
from lingjing_agents.capability import compose, sends
from lingjing_agents.ground_plane import GroundPoint, GroundRectangle, inside
from lingjing_agents.heuristic.dogs.building_finder import FACE, WALK
from lingjing_agents.heuristic.events import view_of
from lingjing_agents.paths.fewest_commands import fewest_commands, ground_of
from lingjing_agents.perception.building_walls import (
    BuildingWall,
    ColouredPoints,
    ColourSpread,
    find_walls,
    reference_signature,
    signature,
)

REFERENCE = "reference"
MARGIN_M = 12.0
"""How far beyond the region buildings are looked at."""

EYE_M = 0.33
"""How high over the ground a walker's body is."""

APART_M, SEEN_M = 40.0, 15.0
"""How far apart along the region pictures from above are taken at most, so that each wall is seen aslant in one of
them, and how near to such a place one counts."""

NEAR_M, NEARER_M = 9.0, 4.0
"""How near to a door the way ends; who came so near in vain is sent nearer once."""

INSET_M = -5.0
"""The way keeps so far inside the region: there are streets around it."""

LONGEST_M = 25.0
"""How far a walker is taken to go with one command."""

DOOR_BONUS, LONG_BONUS = 0.06, 0.05
"""What a door in a wall, and its being the building's longer side, count when walls look alike."""

SURE = 0.72
"""Likeness from which a wall is gone to before all pictures have come."""

AT_M, STOOD_TICKS, RULED_OUT_M = 5.0, 4, 22.0
"""Who stood so near to the way's end for so many ticks was there in vain; all walls this near are struck out."""

SAME_M = 12.0
"""Walls whose middles are this near are one that was seen better."""

OTHER, FACING_DEG, FACING_M = 0.5, 30.0, 45.0
"""A front less like the reference than this is another, if the walker's picture was taken from this near and looked
towards it."""

FRONT = (slice(0, 36), slice(15, 85))
"""Where in a walker's picture the front is that it faces: rows and columns, in hundredths."""


@dataclass(slots=True)
class ApproachedWall:
    """The wall that is gone to, the end of the way before it, and for how many ticks the walker has stood there."""

    wall: BuildingWall
    end: GroundPoint
    stood: int = 0
    nearer: bool = False


class BuildingGuidance:
    """What one episode has shown of the region and where the walker is being led."""

    def __init__(
        self, follower: Peer, message: MessageSpec, reference: ColourSpread, region: tuple[GroundPoint, ...]
    ) -> None:
        self._follower, self._message, self._reference, self._region = follower, message, reference, region
        self._bounds = GroundRectangle.around(region, MARGIN_M)
        self._path_bounds = GroundRectangle.around(region, INSET_M)
        self._unseen: list[GroundPoint] | None = None
        self._views: tuple[ColouredPoints, ...] = ()
        self._walls: tuple[BuildingWall, ...] | None = None
        self._ruled_out: list[GroundPoint] = []
        self._target: ApproachedWall | None = None

    @staticmethod
    def of(brief: Brief, observation: Observation) -> BuildingGuidance | None:
        """A guide for an agent that may guide a walker whose place it sees and that was shown a reference."""
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
                return BuildingGuidance(peer, message, reference_signature(reference.rgb), smallest)
        return None

    def viewpoints(self, start: GroundPoint, most: int) -> tuple[GroundPoint, ...]:
        """Over which places, `most` at most, to take pictures, flying across the region from the side of `start`."""
        places = viewpoints(self._region, start, most)
        if self._unseen is None:
            self._unseen = list(places)
        return places

    def see(self, observation: Observation) -> None:
        """Take in the pictures from above that came."""
        follower = self._view(observation)
        ground = follower.position[2] - EYE_M if follower is not None and follower.position is not None else 0.0
        for picture in observation.pictures:
            view = ColouredPoints.of(picture, ground, self._bounds) if picture.camera != REFERENCE else None
            if view is not None and len(view.points):
                self._views, self._walls = (*self._views, view), None
                over = picture.pose.position[:2]
                if self._unseen is not None:
                    self._unseen = [place for place in self._unseen if math.dist(place, over) > SEEN_M]
            elif picture.entity == self._follower.resources[0]:
                self._confirm(picture)

    def lead(self, observation: Observation, *, waited: bool) -> tuple[Outgoing, ...]:
        """The way to the most likely front as messages, whenever that is another one than before. Until all pictures
        have come or have been `waited` for long enough only a wall that is very like the reference is gone to."""
        follower = self._view(observation)
        if follower is None or follower.position is None or not self._views:
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

    def _send_to(self, follower: EntityView, wall: BuildingWall, *, nearer: bool) -> tuple[Outgoing, ...]:
        """The way to a wall's door, or to its middle where none shows."""
        assert follower.position is not None
        goal, here = wall.door or wall.middle, follower.position[:2]
        points = np.concatenate([view.points for view in self._views])
        ground = ground_of(points, self._bounds, here)
        within, heading = (NEARER_M if nearer else NEAR_M), follower.heading_deg or 0.0
        way = fewest_commands(ground, self._path_bounds, here, heading, goal, within, LONGEST_M)
        way = way or (offset_xy(goal, wall.bearing_deg, within),)
        self._target = ApproachedWall(wall, way[-1], nearer=nearer)
        unsure = self._likeness(wall) < SURE and len(way) > 1
        steps = [(WALK, place) for place in way]
        steps.insert(len(way) - 1 if unsure else len(way), (FACE, goal))
        return self._tell(steps)

    def _confirm(self, picture: Picture) -> None:
        """Strike out the front that the walker's picture shows to be another."""
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

    def _rule_out(self, target: ApproachedWall) -> None:
        self._ruled_out.append(target.wall.middle)
        self._target = None

    def _view(self, observation: Observation) -> EntityView | None:
        return view_of(observation, self._follower.resources[0])

    def _notice(self, here: GroundPoint) -> None:
        """Strike out what the walker stands near to, if nothing has come of it."""
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
    """Over which places pictures of a region are taken: along its middle, straight on from the side of `start`, because
    a picture is wider than high and its top is where the flier came to."""
    xs, ys = [x for x, _ in region], [y for _, y in region]
    west, south, wide, deep = min(xs), min(ys), max(xs) - min(xs), max(ys) - min(ys)
    east_of, north_of = (start[0] - west) / wide - 0.5, (start[1] - south) / deep - 0.5
    across = abs(east_of) > abs(north_of)
    count = min(most, math.ceil((wide if across else deep) / APART_M))
    stops = [(index + 0.5) / count for index in range(count)]
    if (east_of if across else north_of) > 0.0:
        stops.reverse()
    return tuple((west + (stop if across else 0.5) * wide, south + (0.5 if across else stop) * deep) for stop in stops)
