"""The inspector's rules: follow a long thing from its near end and look at every picture for what is wrong with it.

Pictures overlap, so that a gap that one cuts off is whole in the next; it is reported from every picture that shows it
whole: nobody says whether a report was believed. At the far end the inspector turns and comes back, half a step
aside of where it looked before.
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
    Inbox,
    Observation,
    Outgoing,
    Picture,
    Resource,
    Vector,
)
from lingjing_agents.capability import centimetres, fly, may_send, nadir_camera, photo, rated, sighting, team
from lingjing_agents.flight_levels import FlightLevels
from lingjing_agents.ground_plane import GroundPoint
from lingjing_agents.heuristic.centreline import centreline, longest
from lingjing_agents.heuristic.events import view_of
from lingjing_agents.heuristic.picture_lattice import footprint
from lingjing_agents.heuristic.target_types import GAPS, TrainedDetectors, target_type_of

STEP = 0.8
"""Distance between pictures as a share of how far one reaches along the line."""
REACHED_M = 12.0
DECK_M = 12.0
"""How high over the water the deck lies that is looked at, more or less."""
SURE = 0.5


class BridgeInspector:
    """One camera that follows one line. All state is of this episode."""

    roles: ClassVar[tuple[str, ...]] = ("inspector",)
    reads: ClassVar[tuple[str, ...]] = ()
    sends: ClassVar[tuple[str, ...]] = ("report",)

    def __init__(self, brief: Brief, body: Resource, trained: TrainedDetectors = MappingProxyType({})) -> None:
        camera = nadir_camera(body)
        assert camera is not None
        self._brief, self._body, self._camera = brief, body, camera
        self._target_type, self._class = target_type_of(brief) or (GAPS, brief.classes[0] if brief.classes else "gap")
        self._find = trained.get(self._class, self._target_type.find)
        self._report = may_send(brief, "report")
        mates = team(brief)
        floor, ceiling = rated(body, "band_low_m", 0.0), rated(body, "band_high_m", math.inf)
        z = brief.water_level_m + min(max(brief.settings.get("altitude", 60.0), floor), ceiling)
        self._z = FlightLevels(mates.index(brief.agent), len(mates), floor, ceiling, anchor_m=z).level(z)
        self._line: list[GroundPoint] = []
        self._leg = 0
        self._looked = True

    def act(self, observation: Observation, inbox: Inbox) -> Decision:
        """Look at what came, say what it shows, then go one step on."""
        messages: tuple[Outgoing, ...] = ()
        for picture in observation.pictures:
            if picture.entity == self._body.id and picture.camera == self._camera.name:
                messages += self._look(picture)
                self._looked = True
        own = view_of(observation, self._body.id)
        if own is None or own.position is None or own.busy or own.status == DEAD:
            return Decision(messages=messages)
        return Decision(command=self._move(own.position), messages=messages)

    def _look(self, picture: Picture) -> tuple[Outgoing, ...]:
        if self._report is None:
            return ()
        finds = self._find(picture.rgb, picture.pose, self._brief.water_level_m)
        found = []
        for find in finds:
            place = box_to_plane(picture.pose, find.box, self._brief.water_level_m + DECK_M)
            if find.confidence < SURE or place is None:
                continue
            where = centimetres(place)
            found.append(sighting(self._report, picture.frame, self._class, find.box, where, find.confidence))
        return tuple(found)

    def _move(self, here: Vector) -> Action | None:
        if not self._line:
            self._line = self._plan(here[:2])
        if not self._line:
            return None
        there = (*self._line[0], self._z)
        if math.dist(here, there) <= REACHED_M:
            if not self._looked and self._camera.capture != "each_tick":
                return photo(self._body, self._camera)
            self._line.pop(0)
            if not self._line:
                return self._move(here)
            there = (*self._line[0], self._z)
        self._looked = False
        return fly(self._body, *there)

    def _plan(self, here: GroundPoint) -> list[GroundPoint]:
        """The next leg from end to end; every second one begins half a step farther in."""
        region = longest(self._brief.regions)
        if region is None:
            return []
        step = STEP * footprint(self._camera, self._z - self._brief.water_level_m - DECK_M)[1]
        line = centreline(region.polygon, here, step)
        if self._leg % 2:
            line = tuple(((a[0] + b[0]) / 2, (a[1] + b[1]) / 2) for a, b in pairwise(line))
        self._leg += 1
        return list(line)
