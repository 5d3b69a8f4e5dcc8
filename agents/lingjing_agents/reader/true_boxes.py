"""`TrueBoxes`: detectors that answer with the true boxes of the pictures of an agent.

A queue of vehicles has no box of its own, because it is no object: its box is that of neighbouring vehicles.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Iterable, Mapping

from lingjing.plugins.geometry import box_to_plane
from lingjing.plugins.policy import Brief, FrameInfo, Picture
from lingjing_agents.ground_plane import GroundPoint
from lingjing_agents.heuristic.target_types import ANY_VEHICLE, QUEUES, VEHICLES, Detector, Detectors
from lingjing_agents.perception.images import ImageBox
from lingjing_agents.perception.people_at_sea import FoundBox

GAP_M = 14.0
"""Distance between the centres of two vehicles of a queue in metres, at most. Chosen: a truck's length and a gap."""

QUEUE_OF = 4
"""Vehicles of a queue, at least. Chosen, as `perception.road_queues` does."""


class TrueBoxes:
    """The true boxes of an agent's pictures, less a withheld share.

    `withheld` is that share, 0 to 1. Which boxes it comprises depends on picture and entity alone, so it is the same in
    every process.
    """

    def __init__(self, withheld: float = 0.0) -> None:
        self._withheld = withheld
        self._frames: dict[str, FrameInfo] = {}

    def keep(self, frames: Iterable[FrameInfo]) -> None:
        """Store the boxes of new pictures."""
        self._frames.update((frame.id, frame) for frame in frames)

    def detectors(self, brief: Brief) -> Detectors:
        """Return a detector for each class of the mission's reports, one for queues and one for their vehicles."""
        boxes: dict[str, Detector] = {name: self._of_class(name) for name in brief.classes}
        queues = next((name for name in brief.classes if any(word in name for word in QUEUES)), QUEUES[0])
        return {**boxes, queues: self._queues, ANY_VEHICLE: self._vehicles}

    def _of_class(self, name: str) -> Detector:
        def find(picture: Picture, level_m: float) -> tuple[FoundBox, ...]:
            return tuple(FoundBox(box, 1.0) for cls, box in self._boxes(picture) if cls == name)

        return find

    def _queues(self, picture: Picture, level_m: float) -> tuple[FoundBox, ...]:
        """Return the boxes of queues, the longest first."""
        vehicles: dict[ImageBox, GroundPoint] = {}
        for vehicle in self._vehicles(picture, level_m):
            place = box_to_plane(picture.pose, vehicle.box, level_m)
            if place is not None:
                vehicles[vehicle.box] = place[:2]
        groups = [group for group in _neighbours(vehicles) if len(group) >= QUEUE_OF]
        return tuple(FoundBox(_around(group), 1.0) for group in sorted(groups, key=lambda group: (-len(group), group)))

    def _vehicles(self, picture: Picture, level_m: float) -> tuple[FoundBox, ...]:
        """Return the boxes of vehicles that are not parked."""
        return tuple(
            FoundBox(box, 1.0)
            for cls, box in self._boxes(picture)
            if VEHICLES.intersection(cls.split("_")) and "parked" not in cls
        )

    def _boxes(self, picture: Picture) -> Iterable[tuple[str, ImageBox]]:
        """Yield class and box of everything in a picture that is not withheld."""
        frame = self._frames.get(picture.frame)
        for number, box in enumerate((*frame.boxes, *frame.others) if frame is not None else ()):
            draw = zlib.crc32(f"{picture.frame} {box.entity or number}".encode())
            if draw >= self._withheld * 2**32:
                yield box.cls, box.box


def _neighbours(places: Mapping[ImageBox, GroundPoint]) -> list[list[ImageBox]]:
    """Return the groups of boxes that are connected by steps of at most `GAP_M`."""
    left, groups = sorted(places), []
    while left:
        group = [left.pop(0)]
        for box in group:
            near = [other for other in left if math.dist(places[box], places[other]) <= GAP_M]
            group += near
            left = [other for other in left if other not in near]
        groups.append(group)
    return groups


def _around(boxes: Iterable[ImageBox]) -> ImageBox:
    """Return the smallest box around boxes."""
    lefts, tops, rights, bottoms = zip(*boxes, strict=True)
    return min(lefts), min(tops), max(rights), max(bottoms)
