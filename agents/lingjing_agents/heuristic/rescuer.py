"""The rescuer's rules: go to one believed target at a time, the nearest first, until an event reports it as served.

A vessel goes to the commanded place. A vehicle goes only to the nearest road, so it has arrived when it stops.
"""

from __future__ import annotations

import math
from typing import ClassVar

from lingjing.plugins.policy import Action, Brief, Decision, EntityView, Inbox, Observation, Outgoing, Resource
from lingjing_agents.capability import compose, drive, may_send, speed, straight_to
from lingjing_agents.ground_plane import GroundPoint, between, distance_to_segment_m, position_in
from lingjing_agents.heuristic.events import EventLog, view_of
from lingjing_agents.heuristic.sightings import Sighting, confidence_in, name_in
from lingjing_agents.heuristic.target_types import PEOPLE, target_type_of

ROAD_OFF_M = 90.0
"""Distance in metres from a target within which a stopped vehicle is as near as the road allows. Chosen."""
PATIENCE_TICKS = 2
"""Ticks at a target without an event after which it counts as missed. Chosen."""
DOUBT_M = 300.0
"""Additional distance in metres that a confidence of 0 is worth: trades distance against confidence. Chosen."""
STAGING_TICKS = 2.0
"""Length of a hop in ticks while no target is known: a pending `moveTo` blocks the next command. Chosen."""


class Rescuer:
    """Stores reported positions, drives to them one by one, and reports the result of each."""

    roles: ClassVar[tuple[str, ...]] = ("rescuer", "responder")
    reads: ClassVar[tuple[str, ...]] = ("report", "assignment")
    sends: ClassVar[tuple[str, ...]] = ("status",)

    def __init__(self, brief: Brief, body: Resource) -> None:
        self._brief = brief
        self._body = body
        self._target_type = (target_type_of(brief) or (PEOPLE, ""))[0]
        self._afloat = bool(straight_to(body, "x", "y"))
        self._sightings = self._target_type.sightings(brief)
        self._log = EventLog(self._target_type.done)
        self._before: GroundPoint | None = None
        self._sent: Sighting | None = None
        self._target: Sighting | None = None
        self._arrived_tick: int | None = None
        self._status = may_send(brief, "target_status")
        self._stages = True

    def act(self, observation: Observation, inbox: Inbox) -> Decision:
        """Process messages, close the present target, then go on."""
        self._sightings.heed(observation.weather, observation.time_s)
        self._listen(observation, inbox)
        self._heed(inbox)
        own = view_of(observation, self._body.id)
        if own is None or own.position is None:
            return Decision()
        here = own.position[:2]
        messages = self._settle(observation, here)
        self._before = here
        command = None if own.busy else self._move(observation, own, here)
        if command is None and not own.busy:
            messages += self._give_up(observation)
        return Decision(command=command, messages=messages)

    def _listen(self, observation: Observation, inbox: Inbox) -> None:
        for envelope in inbox.messages:
            place = position_in(envelope.body)
            if place is None:
                continue
            if envelope.category == "report" or self._is_order(envelope.category, name_in(envelope.body, "assignee")):
                time_s = observation.time_s - self._brief.tick_s
                self._sightings.add(Sighting(*place, time_s, confidence_in(envelope.body)))

    def _heed(self, inbox: Inbox) -> None:
        """Process receipts: a place without a road is not tried again, neither as staging area nor as target."""
        for receipt in () if self._afloat else inbox.receipts:
            if receipt.resource == self._body.id and receipt.reason == "unreachable":
                if self._target is None:
                    self._stages = False
                else:
                    self._target.state = "missed"

    def _is_order(self, category: str, assignee: str | None) -> bool:
        return category == "assignment" and assignee in {self._brief.agent, self._body.id}

    def _settle(self, observation: Observation, here: GroundPoint) -> tuple[Outgoing, ...]:
        messages: tuple[Outgoing, ...] = ()
        for _ in range(self._log.fresh_rescues(observation.events)):
            done = self._passed(here, observation.time_s)
            if done is None:
                continue
            done.state = "rescued"
            messages += self._tell("rescued", done, observation.time_s)
            if done is self._target:
                self._target, self._arrived_tick = None, None
        return messages

    def _passed(self, here: GroundPoint, time_s: float) -> Sighting | None:
        """Return the open sighting nearest to the path since the last boundary, if near enough to have been served."""

        def off(sighting: Sighting) -> float:
            return distance_to_segment_m(self._sightings.where(sighting, time_s), self._before or here, here)

        near = min(self._sightings.of("open"), key=off, default=None)
        if near is not None and off(near) <= 2 * self._target_type.settle_m:
            return near
        return None if self._afloat else self._target

    def _move(self, observation: Observation, own: EntityView, here: GroundPoint) -> Action | None:
        if self._target is None or self._target.state != "open":
            self._target = self._choose(here, observation.time_s)
            self._arrived_tick = None
        if self._target is None:
            return self._stage(here)
        x, y = self._sightings.where(self._target, observation.time_s)
        if not self._afloat:
            if self._sent is self._target and math.dist(here, (x, y)) <= ROAD_OFF_M:
                return None
            self._sent = self._target
            return drive(self._body, (x, y))
        if math.dist(here, (x, y)) > self._target_type.settle_m / 2:
            lead_s = math.dist(here, (x, y)) / speed(self._body)
            return drive(self._body, self._sightings.where(self._target, observation.time_s + lead_s))
        return None

    def _choose(self, here: GroundPoint, time_s: float) -> Sighting | None:
        def cost(sighting: Sighting) -> float:
            return math.dist(here, self._sightings.where(sighting, time_s)) + DOUBT_M * (1.0 - sighting.confidence)

        return min(self._sightings.of("open"), key=cost, default=None)

    def _stage(self, here: GroundPoint) -> Action | None:
        corners = [corner for region in self._brief.regions for corner in region.polygon]
        if not self._stages or not corners or self._log.rescues:
            return None
        middle = (sum(x for x, _ in corners) / len(corners), sum(y for _, y in corners) / len(corners))
        distance = math.dist(here, middle)
        hop = min(distance, STAGING_TICKS * self._brief.tick_s * speed(self._body))
        if distance < 2 * self._target_type.settle_m:
            return None
        return drive(self._body, between(here, middle, hop / distance))

    def _give_up(self, observation: Observation) -> tuple[Outgoing, ...]:
        """Mark a target without an event as missed after some ticks: a false alarm, or it has drifted away."""
        if self._target is None:
            return ()
        if self._arrived_tick is None:
            self._arrived_tick = observation.tick
        if observation.tick - self._arrived_tick < PATIENCE_TICKS:
            return ()
        missed, self._target, self._arrived_tick = self._target, None, None
        missed.state = "missed"
        return self._tell("missed", missed, observation.time_s)

    def _tell(self, state: str, sighting: Sighting, time_s: float) -> tuple[Outgoing, ...]:
        if self._status is None:
            return ()
        x, y = self._sightings.where(sighting, time_s)
        place = (round(x, 1), round(y, 1), self._brief.water_level_m)
        return (compose(self._status, {"task": self._target_type.task, "state": state, "position": place}),)
