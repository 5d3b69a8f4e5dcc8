"""The rules of a counter of people: photograph each line once, report the count, send a walker to the longest line.

Several counters share the lines, each at its own flight levels, and receive each other's counts. The first of them
sends the nearest walker.
"""

from __future__ import annotations

import math
from typing import ClassVar

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
from lingjing_agents.capability import centimetres, compose, fly, nadir_camera, photo, rated, sends, sighting
from lingjing_agents.flight_levels import FlightLevels
from lingjing_agents.ground_plane import position_in
from lingjing_agents.heuristic.events import view_of
from lingjing_agents.perception.people_in_line import PeopleLine, find_line

REACHED_M, VIEW_M = 3.0, 8.0
"""Distance in metres at which a place counts as reached, and largest offset from a picture's centre for a count.
Chosen.
"""
ABOVE_M = 45.0
"""Flight level in metres. Chosen: above roofs, and low enough that a person is a dozen pixels wide."""
TRIES = 3
"""Pictures without a detection after which a line counts as empty. Chosen."""
AGAIN_TICKS = 12
"""Ticks after which the order to a walker is repeated, since messages may be lost. A counter without lines of its own
waits as long for the counts of others before it counts theirs. Chosen.
"""


class LineCounter:
    """One camera over a few known places. Its state belongs to one episode."""

    roles: ClassVar[tuple[str, ...]] = ("counter",)
    reads: ClassVar[tuple[str, ...]] = ("count",)
    sends: ClassVar[tuple[str, ...]] = ("count", "assignment")

    def __init__(self, brief: Brief, body: Resource) -> None:
        camera = nadir_camera(body)
        assert camera is not None
        self._brief, self._body, self._camera = brief, body, camera
        self._tally, self._order = sends(brief, "count"), sends(brief, "assignment")
        self._class = brief.classes[0] if brief.classes else ""
        mates = sorted((brief.agent, *(peer.id for peer in brief.peers if peer.role == brief.role)))
        self._rank, self._mates = mates.index(brief.agent), len(mates)
        low, high = rated(body, "band_low_m", 0.0), rated(body, "band_high_m", ABOVE_M)
        self._z = FlightLevels(self._rank, self._mates, low, high).level(min(ABOVE_M, high))
        self._people: dict[str, int] = {}
        self._tries: dict[str, int] = {}
        self._said_at, self._counted_at = -AGAIN_TICKS, 0

    def act(self, observation: Observation, inbox: Inbox) -> Decision:
        """Count in the new pictures, then go to the next place or announce the longest line."""
        places = {view.id: view.position for view in observation.entities if view.type == self._class and view.position}
        messages: list[Outgoing] = []
        known = len(self._people)
        self._listen(inbox, places)
        for picture in observation.pictures:
            if picture.entity == self._body.id:
                messages += self._count(picture, places)
        if len(self._people) > known:
            self._counted_at = observation.tick
        own = view_of(observation, self._body.id)
        if own is None or own.position is None or own.busy or own.status == DEAD:
            return Decision(messages=tuple(messages))
        left = [name for name in places if name not in self._people]
        if left:
            mine = [name for number, name in enumerate(places) if number % self._mates == self._rank and name in left]
            waits = not mine and observation.tick < self._counted_at + AGAIN_TICKS
            if waits:  # an early helper would block the view of the other counters
                return Decision(messages=tuple(messages))
            return Decision(command=self._visit(own, places, mine or left), messages=tuple(messages))
        return Decision(messages=(*messages, *self._send(places, observation)))

    def _listen(self, inbox: Inbox, places: dict[str, Vector]) -> None:
        """Store the counts of other counters."""
        for envelope in inbox.messages:
            people, where = envelope.body.get("people"), position_in(envelope.body)
            if isinstance(people, int | float) and where is not None and places:
                nearest = min(places, key=lambda name: math.dist(places[name][:2], where))
                self._people.setdefault(nearest, round(people))

    def _count(self, picture: Picture, places: dict[str, Vector]) -> list[Outgoing]:
        for name, place in places.items():
            if name in self._people or math.dist(picture.pose.position[:2], place[:2]) > VIEW_M:
                continue
            line = find_line(picture.rgb, picture.pose, place[:2], place[2])
            self._tries[name] = self._tries.get(name, 0) + 1
            if line is not None:
                self._people[name] = line.people
                return self._count_message(picture, place, line)
            if self._tries[name] >= TRIES:
                self._people[name] = 0
        return []

    def _count_message(self, picture: Picture, place: Vector, line: PeopleLine) -> list[Outgoing]:
        if self._tally is None:
            return []
        where, people = centimetres(place), float(line.people)
        return [sighting(self._tally, picture.frame, self._class, line.box, where, line.confidence, people=people)]

    def _visit(self, own: EntityView, places: dict[str, Vector], left: list[str]) -> Action:
        """Climb above the roofs, fly to the nearest place without a count, and take a picture there."""
        assert own.position is not None
        here = own.position
        if own.status == "grounded":
            return fly(self._body, *here[:2], self._z)
        place = min((math.dist(here[:2], places[name][:2]), places[name]) for name in left)[1]
        if math.dist(here[:2], place[:2]) > REACHED_M or abs(here[2] - self._z) > REACHED_M:
            return fly(self._body, *place[:2], self._z)
        return photo(self._body, self._camera)

    def _send(self, places: dict[str, Vector], observation: Observation) -> list[Outgoing]:
        """Send the nearest walker to the longest line; only the first counter does so."""
        walkers = [peer for peer in self._brief.peers if peer.resources and peer.role != self._brief.role]
        late = observation.tick >= self._said_at + AGAIN_TICKS
        if self._order is None or not places or not walkers or not late or self._rank:
            return []
        self._said_at = observation.tick
        longest = places[max(places, key=lambda name: self._people[name])]
        views = {peer.id: view_of(observation, peer.resources[0]) for peer in walkers}
        known = {name: view.position for name, view in views.items() if view is not None and view.position is not None}
        walker = min(known, key=lambda name: math.dist(known[name][:2], longest[:2]), default=walkers[0].id)
        body: dict[str, Datum] = {"assignee": walker, "task": "join", "position": centimetres(longest)}
        return [compose(self._order, body, to=(walker,))]
