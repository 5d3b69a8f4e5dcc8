"""The searcher's rules: fly to a waypoint, take a picture, detect targets, report them, go on.

The targets and their detector follow from the classes in the brief (`target_types`). A doubtful detection is
photographed again, from lower or from directly above, before it is reported. Targets that team mates have reported are
not reported again. In a broadcast topology a searcher may command the vessel itself if no other agent seems to.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from types import MappingProxyType
from typing import ClassVar

from lingjing.plugins.geometry import box_to_plane, ground_footprint, offset_xy
from lingjing.plugins.policy import (
    DEAD,
    Action,
    Brief,
    Datum,
    Decision,
    EntityView,
    Inbox,
    Observation,
    Outgoing,
    Picture,
    Resource,
    Vector,
)
from lingjing_agents.capability import (
    centimetres,
    compose,
    drive,
    fly,
    may_send,
    nadir_camera,
    natural,
    photo,
    rated,
    sighting,
    team,
    vessel,
)
from lingjing_agents.flight_levels import LAYER_M, FlightLevels, crowded, overhead
from lingjing_agents.ground_plane import GroundPoint, position_in
from lingjing_agents.heuristic.events import EventLog, view_of
from lingjing_agents.heuristic.picture_lattice import PictureWaypoint
from lingjing_agents.heuristic.search_plan import ALIGNED_DEG, SearchPlan, off_course_deg
from lingjing_agents.heuristic.sightings import Sighting, confidence_in, name_in
from lingjing_agents.heuristic.target_types import PEOPLE, Detectors, target_type_of
from lingjing_agents.perception.people_at_sea import FoundBox

CONFIRMED = 0.3
"""Least confidence of a detection in a second picture. Chosen."""
REACHED_M = 12.0
"""Distance in metres at which a waypoint counts as reached. Chosen."""
TURN_HOP_M = 5.0
"""Length in metres of the hop that turns an aircraft along the lane: it changes its heading only in motion. Chosen."""
PATIENCE_TICKS = 3
"""Ticks that an aircraft on the ground waits for one overhead. Chosen."""
HUB_PATIENCE_TICKS = 3
"""Ticks after which a searcher starts without orders of the hub. Chosen."""
ATTEMPTS = 2
"""Number of flights, turns or pictures for one waypoint. Chosen."""
LOOKS = 3
"""Number of second pictures of one place. Chosen."""
BOAT_PATIENCE_TICKS = 4
"""Ticks without motion after which a searcher commands the vessel. Chosen."""


@dataclass(slots=True)
class _PictureGoal:
    """A picture to take."""

    waypoint: PictureWaypoint
    """The place from which it is taken."""
    doubt: FoundBox | None = None
    """The doubtful detection that it is to confirm; None for a first picture."""
    flights: int = 0
    """Number of flights so far."""
    turns: int = 0
    """Number of turning hops so far."""
    shots: int = 0
    """Number of pictures so far."""


class AerialSearcher:
    """One airborne camera. Its state belongs to one episode."""

    roles: ClassVar[tuple[str, ...]] = ("searcher",)
    reads: ClassVar[tuple[str, ...]] = ("report", "assignment", "status")
    sends: ClassVar[tuple[str, ...]] = ("report", "assignment", "status")

    def __init__(
        self,
        brief: Brief,
        body: Resource,
        detectors: Detectors = MappingProxyType({}),
        *,
        sure: float = 0.5,
        doubtful: float = 0.05,
    ) -> None:
        camera = nadir_camera(body)
        assert camera is not None
        self._brief, self._body, self._camera = brief, body, camera
        self._sure, self._doubtful = sure, doubtful
        self._report = may_send(brief, "report")
        self._status = may_send(brief, "target_status")
        self._assignment = may_send(brief, "assignment")
        self._target_type, self._class = target_type_of(brief) or (
            PEOPLE,
            brief.classes[0] if brief.classes else "person",
        )
        self._find = self._target_type.detector(self._class, detectors)
        self._sightings = self._target_type.sightings(brief)
        self._log = EventLog(self._target_type.done)
        height = brief.settings.get("altitude", 100.0) * self._target_type.aloft
        lowest = rated(body, "band_low_m", 20.0)
        self._lowest_m = lowest
        mates = team(brief)
        ceiling = rated(body, "band_high_m", math.inf)
        highest = ceiling - brief.water_level_m - LAYER_M * (len(mates) - 1)
        self._sweep = SearchPlan(
            brief,
            camera,
            max(min(height, highest), lowest),
            max(lowest, self._target_type.lowest * min(height, highest)),
            overlap=self._target_type.overlap,
        )
        self._layers = FlightLevels(
            index=mates.index(brief.agent),
            count=len(mates),
            low_m=lowest,
            high_m=ceiling,
            anchor_m=self._sweep.height_m + brief.water_level_m,
        )
        self._mates = frozenset(name for peer in brief.peers if peer.id in mates for name in peer.resources)
        self._waited = 0
        self._goal: _PictureGoal | None = None
        self._second_looks: list[_PictureGoal] = []
        self._doubted: list[GroundPoint] = []
        self._ordered = brief.hub is None
        self._boat = vessel(brief, embodied=False)
        self._boat_at: tuple[GroundPoint, int] | None = None
        self._claimed: set[str] = set()
        self._outbox: list[Outgoing] = []

    def act(self, observation: Observation, inbox: Inbox) -> Decision:
        """Process messages and pictures, then report, then move."""
        self._sightings.heed(observation.weather, observation.time_s)
        self._listen(observation, inbox)
        self._log.fresh_rescues(observation.events)
        messages: tuple[Outgoing, ...] = ()
        for picture in observation.pictures:
            if picture.entity == self._body.id:
                messages += self._look(picture)
        messages += self._progress()
        own = view_of(observation, self._body.id)
        if own is None or own.position is None:
            return Decision(messages=messages)
        if own.status == DEAD:
            return Decision(messages=messages)
        command = self._send_boat(observation) if own.busy else self._move(observation, own)
        queued, self._outbox = tuple(self._outbox), []
        return Decision(command=command, messages=messages + queued)

    # -- messages of others

    def _listen(self, observation: Observation, inbox: Inbox) -> None:
        for envelope in inbox.messages:
            place = position_in(envelope.body)
            cell = name_in(envelope.body, "cell")
            if envelope.category == "report" and place is not None:
                heard_s = observation.time_s - self._brief.tick_s
                self._sightings.add(Sighting(*place, heard_s, confidence_in(envelope.body)))
            elif envelope.category == "assignment" and cell is not None:
                self._hear_assignment(envelope.sender, cell, name_in(envelope.body, "assignee"))
            elif envelope.category == "target_status":
                self._hear_status(observation, name_in(envelope.body, "state"), cell, place)

    def _hear_assignment(self, sender: str, cell: str, assignee: str | None) -> None:
        self._ordered = True
        mine = self._sweep.owner.get(cell) == self._brief.agent
        rival = sender == assignee and natural(sender) > natural(self._brief.agent)
        if assignee is not None and not (mine and rival and cell in self._claimed):
            self._sweep.owner[cell] = assignee

    def _hear_status(
        self, observation: Observation, state: str | None, cell: str | None, place: GroundPoint | None
    ) -> None:
        if state == "searched" and cell is not None:
            self._sweep.open_cells.discard(cell)
        if state in {"missed", "rescued"} and place is not None:
            known = self._sightings.nearest(place, observation.time_s, within=self._sightings.merge_m)
            if known is not None:
                known.state = "missed" if state == "missed" else "rescued"

    # -- pictures

    def _look(self, picture: Picture) -> tuple[Outgoing, ...]:
        ground = ground_footprint(picture.pose, self._brief.water_level_m)
        if ground is not None:
            self._sweep.map.mark(ground)
        goal, self._goal = self._goal, None
        if goal is not None and goal.doubt is None:
            self._sweep.drop(goal.waypoint)
        again = goal is not None and goal.doubt is not None
        messages: tuple[Outgoing, ...] = ()
        for find in self._find(picture, self._brief.water_level_m):
            messages += self._judge(picture, find, again=again)
        return messages

    def _judge(self, picture: Picture, find: FoundBox, *, again: bool) -> tuple[Outgoing, ...]:
        place = box_to_plane(picture.pose, find.box, self._brief.water_level_m + self._target_type.raised_m)
        if place is None or find.confidence < (CONFIRMED if again else self._doubtful):
            return ()
        known = self._sightings.nearest(place[:2], picture.time_s, within=self._sightings.merge_m)
        if known is not None and known.state != "missed":
            return ()
        aside = _aside(find) > self._target_type.aside
        if aside or (find.confidence < self._sure and not again):
            self._doubt(find, place)
            return ()
        return self._say(picture, find, place)

    def _doubt(self, find: FoundBox, place: Vector) -> None:
        """Plan a second picture from directly above, unless one is planned or enough were taken."""
        low = max(self._sweep.height_m * self._target_type.confirm, self._sweep.lowest_m)
        near = self._target_type.merge_m / 2 if self._target_type.aside < 1.0 else 0.0
        planned = [goal.waypoint for goal in self._second_looks]
        tried = sum(math.dist(spot, place[:2]) <= near for spot in self._doubted)
        if tried >= LOOKS or any(math.dist((goal.x, goal.y), place[:2]) < near for goal in planned):
            return
        self._doubted.append(place[:2])
        self._second_looks.append(_PictureGoal(PictureWaypoint(place[0], place[1], low, ""), doubt=find))

    def _say(self, picture: Picture, find: FoundBox, place: Vector) -> tuple[Outgoing, ...]:
        if self._report is None:
            return ()
        cell = min(self._brief.cells, key=lambda cell: (math.dist(cell.centre, place[:2]), cell.name)).name
        known = self._sightings.add(Sighting(place[0], place[1], picture.time_s, find.confidence, cell))
        known.state = "open"
        where = centimetres(place)
        more: dict[str, Datum] = {"cell": cell, "hover": False}
        return (sighting(self._report, picture.frame, self._class, find.box, where, find.confidence, **more),)

    def _progress(self) -> tuple[Outgoing, ...]:
        done = self._sweep.finished_cells() if self._ordered else ()
        if self._status is None:
            return ()
        return tuple(compose(self._status, {"task": "search", "state": "searched", "cell": cell}) for cell in done)

    # -- motion

    def _move(self, observation: Observation, own: EntityView) -> Action | None:
        assert own.position is not None
        if not self._ordered and observation.tick >= HUB_PATIENCE_TICKS:
            self._ordered = True  # the hub sends nothing: all searchers use the common partition
        if self._goal is None or self._goal.flights > ATTEMPTS or self._goal.shots > ATTEMPTS:
            if self._goal is not None:
                self._sweep.drop(self._goal.waypoint)
            self._goal = self._choose(own.position[:2], observation.time_s)
        if self._goal is None:
            return None
        if own.status == "grounded":
            others = [
                view.position
                for view in observation.entities
                if view.id in self._mates and view.position is not None and view.status != DEAD
            ]
            if crowded(own.position, others):
                return self._take_off(self._goal, own.position, others)
        return self._pursue(self._goal, own.position, own.heading_deg)

    def _take_off(self, goal: _PictureGoal, here: Vector, others: list[Vector]) -> Action | None:
        """Return a vertical take-off between other pads, or None while another aircraft is overhead."""
        if overhead(here, others) and self._waited < PATIENCE_TICKS:
            self._waited += 1
            return None
        return fly(self._body, here[0], here[1], self._height(goal))

    def _height(self, goal: _PictureGoal) -> float:
        return self._layers.level(goal.waypoint.height_m + self._brief.water_level_m)

    def _pursue(self, goal: _PictureGoal, here: Vector, heading_deg: float | None) -> Action:
        z = self._height(goal)
        target = (goal.waypoint.x, goal.waypoint.y, z)
        if self._target_type.raised_m > 0.0 and here[2] < self._lowest_m + self._brief.water_level_m - REACHED_M:
            return fly(self._body, here[0], here[1], z)
        if math.dist(here, target) > REACHED_M:
            goal.flights += 1
            return fly(self._body, *target)
        course = goal.waypoint.course_deg
        if course is not None and heading_deg is not None and off_course_deg(course, heading_deg) > ALIGNED_DEG:
            goal.turns += 1
            if goal.turns <= ATTEMPTS:
                return fly(self._body, *offset_xy(here, course, TURN_HOP_M), target[2])
        goal.shots += 1
        return photo(self._body, self._camera)

    def _choose(self, here: GroundPoint, time_s: float) -> _PictureGoal | None:
        if not self._ordered:
            return None
        while self._second_looks:
            goal = self._second_looks.pop(0)
            place = (goal.waypoint.x, goal.waypoint.y)
            known = self._sightings.nearest(place, time_s, within=self._sightings.merge_m)
            if known is None or known.state == "missed":
                return goal
        waypoint = self._sweep.next_waypoint(here)
        if waypoint is None and self._claim():
            waypoint = self._sweep.next_waypoint(here)
        if waypoint is None and not self._all_found():
            self._sweep.next_pass()
            self._claimed.clear()
            waypoint = self._sweep.next_waypoint(here)
        return None if waypoint is None else _PictureGoal(waypoint)

    def _claim(self) -> bool:
        """Take over a cell of the busiest team mate and announce it, in a broadcast topology. Return whether one was
        taken over.

        If two searchers claim the same cell, the claim of the first name holds. In a star topology the hub decides.
        """
        cell = self._sweep.claim() if self._brief.hub is None else None
        if cell is None or self._assignment is None:
            return False
        self._sweep.owner[cell] = self._brief.agent
        self._claimed.add(cell)
        body: dict[str, Datum] = {"assignee": self._brief.agent, "task": "search", "cell": cell}
        self._outbox.append(compose(self._assignment, body))
        return True

    def _all_found(self) -> bool:
        known = [self._brief.settings[name] for name in self._target_type.counts if name in self._brief.settings]
        return bool(known) and self._log.rescues >= known[0]

    def _send_boat(self, observation: Observation) -> Action | None:
        """Command the vessel to the nearest open sighting if it has not moved for a while; its crew usually does so."""
        boat = view_of(observation, self._boat.id) if self._boat is not None else None
        if self._boat is None or boat is None or boat.position is None:
            return None
        here = boat.position[:2]
        if self._boat_at is None or math.dist(self._boat_at[0], here) > 2.0:
            self._boat_at = here, observation.tick
        if observation.tick - self._boat_at[1] < BOAT_PATIENCE_TICKS:
            return None
        sighting = self._sightings.nearest(here, observation.time_s, state="open")
        if sighting is None:
            return None
        self._boat_at = here, observation.tick
        return drive(self._boat, self._sightings.where(sighting, observation.time_s))


def _aside(find: FoundBox) -> float:
    """Return the distance of a detection from the picture's centre: the larger share of its width or height, 0 to
    0.5.
    """
    x0, y0, x1, y1 = find.box
    return max(abs(x0 + x1 - 1.0), abs(y0 + y1 - 1.0)) / 2.0
