"""The bridge inspector's rules: follow the bridge from its near end and report damage in each picture.

Pictures overlap, so that a gap that one cuts off is whole in the next. A gap is reported from every picture that shows
it whole, because adjudication gives no feedback. At the far end the inspector returns, half a step aside of its first
pictures.
"""

from __future__ import annotations

import math
from itertools import pairwise
from types import MappingProxyType
from typing import ClassVar

import numpy as np

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
    Region,
    Resource,
    Vector,
)
from lingjing_agents.capability import centimetres, fly, may_send, nadir_camera, photo, rated, sighting, team
from lingjing_agents.flight_levels import FlightLevels
from lingjing_agents.ground_plane import GroundPoint
from lingjing_agents.heuristic.events import view_of
from lingjing_agents.heuristic.picture_lattice import footprint
from lingjing_agents.heuristic.target_types import GAPS, Detectors, target_type_of

STEP = 0.8
"""Distance between pictures as a share of a picture's extent along the line. Chosen."""
REACHED_M = 12.0
"""Distance in metres at which a waypoint counts as reached. Chosen."""
DECK_M = 12.0
"""Assumed height of the deck above the water in metres. Chosen."""
TAKES_TICKS = 2
"""Ticks from a picture until the report of it has taken effect: one to send it, one for the engine."""
SURE = 0.5
"""Least confidence of a report. Chosen."""


class BridgeInspector:
    """One camera that follows one line. Its state belongs to one episode."""

    roles: ClassVar[tuple[str, ...]] = ("inspector",)
    reads: ClassVar[tuple[str, ...]] = ()
    sends: ClassVar[tuple[str, ...]] = ("report",)

    def __init__(self, brief: Brief, body: Resource, detectors: Detectors = MappingProxyType({})) -> None:
        camera = nadir_camera(body)
        assert camera is not None
        self._brief, self._body, self._camera = brief, body, camera
        self._target_type, self._class = target_type_of(brief) or (GAPS, brief.classes[0] if brief.classes else "gap")
        self._find = self._target_type.detector(self._class, detectors)
        self._report = may_send(brief, "report")
        mates = team(brief)
        floor, ceiling = rated(body, "band_low_m", 0.0), rated(body, "band_high_m", math.inf)
        z = brief.water_level_m + min(max(brief.settings.get("altitude", 60.0), floor), ceiling)
        self._z = FlightLevels(mates.index(brief.agent), len(mates), floor, ceiling, anchor_m=z).level(z)
        self._line: list[GroundPoint] = []
        self._visits: list[tuple[int, GroundPoint]] = []
        self._reported: list[GroundPoint] = []
        self._leg = 0
        self._looked = True

    def act(self, observation: Observation, inbox: Inbox) -> Decision:
        """Report what the new pictures show, then go one step on."""
        messages: tuple[Outgoing, ...] = ()
        for picture in observation.pictures:
            if picture.entity == self._body.id and picture.camera == self._camera.name:
                messages += self._look(picture)
                self._looked = True
        own = view_of(observation, self._body.id)
        if own is None or own.position is None or own.busy or own.status == DEAD:
            return Decision(messages=messages)
        return Decision(command=self._move(own.position, observation.tick), messages=messages)

    def _look(self, picture: Picture) -> tuple[Outgoing, ...]:
        if self._report is None:
            return ()
        finds = self._find(picture, self._brief.water_level_m)
        reports = []
        for find in finds:
            place = box_to_plane(picture.pose, find.box, self._brief.water_level_m + DECK_M)
            if find.confidence < SURE or place is None:
                continue
            if all(math.dist(place[:2], known) > self._target_type.merge_m for known in self._reported):
                self._reported.append(place[:2])
                self._visits.append((picture.tick + TAKES_TICKS, place[:2]))
            where = centimetres(place)
            reports.append(sighting(self._report, picture.frame, self._class, find.box, where, find.confidence))
        return tuple(reports)

    def _move(self, here: Vector, tick: int) -> Action | None:
        """Fly over the reported places first: a report may have to precede the inspection. Then follow the line."""
        if self._visits:
            until, place = self._visits[0]
            if math.dist(here[:2], place) > REACHED_M:
                return fly(self._body, *place, self._z)
            if tick < until:
                return None
            self._visits = self._visits[1:]
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
                return self._move(here, tick)
            there = (*self._line[0], self._z)
        self._looked = False
        return fly(self._body, *there)

    def _plan(self, here: GroundPoint) -> list[GroundPoint]:
        """Return the next leg from end to end. Every second one is shifted by half a step."""
        region = longest(self._brief.regions)
        if region is None:
            return []
        step = STEP * footprint(self._camera, self._z - self._brief.water_level_m - DECK_M)[1]
        line = centreline(region.polygon, here, step)
        if self._leg % 2:
            line = tuple(((a[0] + b[0]) / 2, (a[1] + b[1]) / 2) for a, b in pairwise(line))
        self._leg += 1
        return list(line)


def longest(regions: tuple[Region, ...]) -> Region | None:
    """Return the region with the largest ratio of length to width, or None."""
    return max((region for region in regions if len(region.polygon) >= 3), key=_slenderness, default=None)


def centreline(polygon: tuple[GroundPoint, ...], start: GroundPoint, step_m: float) -> tuple[GroundPoint, ...]:
    """Return points about `step_m` apart along the centre of a polygon, from the end nearest to `start` (east, north;
    m).
    """
    points = np.array(polygon)
    middle = points.mean(axis=0)
    axis = np.linalg.svd(points - middle)[2][0]
    across = np.array((-axis[1], axis[0]))
    along = (points - middle) @ axis
    low, high = float(along.min()), float(along.max())
    count = max(2, math.ceil((high - low) / step_m) + 1)
    line: list[GroundPoint] = []
    for station in np.linspace(low + 1e-3 * (high - low), high - 1e-3 * (high - low), count):
        offset = _middle(points, middle + station * axis, axis, across)
        if offset is not None:
            x, y = middle + station * axis + offset * across
            line.append((float(x), float(y)))
    if line and math.dist(line[-1], start) < math.dist(line[0], start):
        line.reverse()
    return tuple(line)


def _middle(points: np.ndarray, origin: np.ndarray, axis: np.ndarray, across: np.ndarray) -> float | None:
    """Return the offset across the axis of the centre of the polygon's section through `origin`; None without a
    section.
    """
    crossings = []
    for a, b in zip(points, np.roll(points, -1, axis=0), strict=True):
        da, db = float((a - origin) @ axis), float((b - origin) @ axis)
        if (da < 0.0) != (db < 0.0):
            hit = a + (b - a) * (da / (da - db))
            crossings.append(float((hit - origin) @ across))
    return (min(crossings) + max(crossings)) / 2.0 if crossings else None


def _slenderness(region: Region) -> float:
    points = np.array(region.polygon)
    spread = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return float(spread[0] / max(spread[1], 1e-6))
