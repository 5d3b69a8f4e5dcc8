"""The search coordinator's rules: cells to searchers at the start, then one rescue at a time to the rescuer.

It has no body and no pictures; its knowledge comes from messages and public events.
"""

from __future__ import annotations

import math
from typing import ClassVar

from lingjing.plugins.policy import Brief, Decision, Inbox, Observation, Outgoing, Vector
from lingjing_agents.capability import compose, may_send, natural
from lingjing_agents.ground_plane import GroundPoint, position_in
from lingjing_agents.heuristic.events import EventLog
from lingjing_agents.heuristic.sightings import Sighting, confidence_in, name_in
from lingjing_agents.heuristic.target_types import PEOPLE, target_type_of

RESCUE_PATIENCE_S = 350.0
"""Seconds after which a rescue is abandoned, since the order may have been lost. Chosen."""


class SearchCoordinator:
    """Assigns cells, merges reports, and orders one rescue after the other."""

    roles: ClassVar[tuple[str, ...]] = ("coordinator",)
    reads: ClassVar[tuple[str, ...]] = ("report", "status")
    sends: ClassVar[tuple[str, ...]] = ("assignment",)

    def __init__(self, brief: Brief) -> None:
        self._brief = brief
        self._assignment = may_send(brief, "assignment")
        self._searchers, self._rescuers = _split(brief)
        self._owner: dict[str, str] = {}
        self._done: set[str] = set()
        self._target_type = (target_type_of(brief) or (PEOPLE, ""))[0]
        self._sightings = self._target_type.sightings(brief)
        self._log = EventLog(self._target_type.done)
        self._current: Sighting | None = None
        self._current_tick = 0
        self._vessel: GroundPoint | None = None

    def act(self, observation: Observation, inbox: Inbox) -> Decision:
        """Assign cells first; then process messages, close the present rescue and order the next one."""
        if self._assignment is None:
            return Decision()
        self._sightings.heed(observation.weather, observation.time_s)
        messages = self._first_cells() if not self._owner else ()
        for envelope in inbox.messages:
            place = position_in(envelope.body)
            if envelope.category == "report" and place is not None:
                time_s = observation.time_s - self._brief.tick_s
                self._sightings.add(Sighting(*place, time_s, confidence_in(envelope.body)))
            elif envelope.category == "target_status":
                self._hear_status(envelope.sender, name_in(envelope.body, "state"), place, envelope.body.get("cell"))
        if self._log.fresh_rescues(observation.events) and self._current is not None:
            self._close("rescued")
        messages += self._help(observation)
        return Decision(messages=messages + self._next_rescue(observation))

    def _first_cells(self) -> tuple[Outgoing, ...]:
        cells = sorted(self._brief.cells, key=lambda cell: (cell.column, cell.row if cell.column % 2 else -cell.row))
        for index, cell in enumerate(cells):
            if self._searchers:
                self._owner[cell.name] = self._searchers[index * len(self._searchers) // len(cells)]
        return tuple(self._order(owner, "search", cell=cell) for cell, owner in self._owner.items())

    def _hear_status(self, sender: str, state: str | None, place: GroundPoint | None, cell: object) -> None:
        if isinstance(cell, str) and state == "searched":
            self._done.add(cell)
        if sender in self._rescuers and place is not None:
            self._vessel = place
            if state == "missed" and self._current is not None:
                self._close("missed")

    def _help(self, observation: Observation) -> tuple[Outgoing, ...]:
        """Move one cell to an idle searcher from the one with the most open cells (at least two)."""
        left = {name: [cell for cell, owner in self._owner.items() if owner == name] for name in self._searchers}
        left = {name: [cell for cell in cells if cell not in self._done] for name, cells in left.items()}
        idle = [name for name, cells in left.items() if not cells]
        busiest = max(left, key=lambda name: len(left[name]), default=None)
        if not idle or busiest is None or len(left[busiest]) < 2:
            return ()
        cell = left[busiest][-1]
        self._owner[cell] = idle[0]
        return (self._order(idle[0], "search", cell=cell),)

    def _next_rescue(self, observation: Observation) -> tuple[Outgoing, ...]:
        waited_s = (observation.tick - self._current_tick) * self._brief.tick_s
        if self._current is not None and waited_s > RESCUE_PATIENCE_S:
            self._close("missed")
        if self._current is not None or not self._rescuers:
            return ()
        self._current = self._choose(observation.time_s)
        if self._current is None:
            return ()
        self._current_tick = observation.tick
        x, y = self._sightings.where(self._current, observation.time_s)
        place = (round(x, 1), round(y, 1), self._brief.water_level_m)
        return (self._order(self._rescuers[0], self._target_type.task, position=place),)

    def _choose(self, time_s: float) -> Sighting | None:
        def cost(sighting: Sighting) -> tuple[float, float]:
            distance = math.dist(self._vessel, self._sightings.where(sighting, time_s)) if self._vessel else 0.0
            return distance, -sighting.confidence

        return min(self._sightings.of("open"), key=cost, default=None)

    def _close(self, state: str) -> None:
        assert self._current is not None
        self._current.state = "rescued" if state == "rescued" else "missed"
        self._vessel = self._current.x, self._current.y
        self._current = None

    def _order(self, assignee: str, task: str, *, cell: str | None = None, position: Vector | None = None) -> Outgoing:
        assert self._assignment is not None
        recipients = self._searchers if task == "search" else (assignee,)  # all searchers need the owners of cells
        body = {"assignee": assignee, "task": task, "cell": cell, "position": position}
        return compose(self._assignment, body, to=recipients)


def _split(brief: Brief) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return searchers and rescuers among the peers: roles that may send reports search, other bodies rescue."""
    reports = [message for message in brief.messages if message.category == "report"]
    bodies = sorted((peer for peer in brief.peers if peer.resources), key=lambda peer: natural(peer.id))
    searchers = tuple(peer.id for peer in bodies if any(message.is_sent_by(peer.role) for message in reports))
    return searchers, tuple(peer.id for peer in bodies if peer.id not in searchers)
