"""The rules of a driver on an inspected route: wait, drive to the ordered place, and repeat the command if necessary.

Every order with a position is an order to drive there, whatever its task name: other coordinators (an oracle, a model)
use other words.
"""

from __future__ import annotations

import math
from typing import ClassVar

from lingjing.plugins.policy import Brief, Decision, Inbox, Observation, Resource
from lingjing_agents.capability import drive
from lingjing_agents.ground_plane import GroundPoint, position_in
from lingjing_agents.heuristic.events import view_of
from lingjing_agents.heuristic.sightings import name_in

ARRIVED_M = 20.0
"""Distance in metres at which the driver counts as arrived. Chosen."""
PAUSE_TICKS = 2
"""Ticks between a rejection and the next command. Chosen."""


class RouteDriver:
    """One vehicle that waits until it is ordered. Its state belongs to one episode."""

    roles: ClassVar[tuple[str, ...]] = ("driver",)
    reads: ClassVar[tuple[str, ...]] = ("assignment",)
    sends: ClassVar[tuple[str, ...]] = ()

    def __init__(self, brief: Brief, body: Resource) -> None:
        self._brief, self._body = brief, body
        self._goal: GroundPoint | None = None
        self._next_tick = 0

    def act(self, observation: Observation, inbox: Inbox) -> Decision:
        """Drive if ordered and idle. Pause after a rejection, since the permit may follow a tick later."""
        for envelope in inbox.messages:
            mine = name_in(envelope.body, "assignee") in {self._brief.agent, self._body.id}
            if envelope.category == "assignment" and mine:
                self._goal = position_in(envelope.body) or self._goal
        if any(receipt.status == "rejected" for receipt in inbox.receipts):
            self._next_tick = observation.tick + PAUSE_TICKS
        own = view_of(observation, self._body.id)
        if own is None or own.position is None or own.busy or self._goal is None or observation.tick < self._next_tick:
            return Decision()
        if math.dist(own.position[:2], self._goal) <= ARRIVED_M:
            return Decision()
        return Decision(command=drive(self._body, self._goal))
