"""The rules of a coordinator of routes, which observes the vehicle's channel alone: inspection, replanning, driving.

Each new route is sent to the inspector as one order per waypoint; where the mission has messages for it, its ends and
its places are named to all. A reported jam causes a request for another route, as long as the limit allows. When all
waypoints are reported, the driver is ordered to the route's end, repeatedly until an event reports its arrival. If a
walker continues from there, the inspector also photographs that stretch, and the walker is guided by these pictures
(`guidance.to_building`).
"""

from __future__ import annotations

import math
from types import MappingProxyType
from typing import ClassVar

from lingjing.plugins.policy import (
    Brief,
    Datum,
    Decision,
    EntityView,
    Envelope,
    Inbox,
    Observation,
    Outgoing,
    Peer,
)
from lingjing_agents.capability import INSPECT, JAMMED, centimetres, compose, sends
from lingjing_agents.ground_plane import GroundPoint, position_in
from lingjing_agents.heuristic.guidance.to_building import BuildingGuidance
from lingjing_agents.heuristic.route_inspector import LOOK, START, names_places
from lingjing_agents.heuristic.sightings import name_in
from lingjing_agents.heuristic.target_types import Detectors

GroundPosition = tuple[float, ...]
"""East and north, possibly with an elevation, in metres."""

DRIVE = "drive"
"""The task name of the order to drive to the route's end."""
REPEAT_TICKS = 4
"""Ticks after which an order to the driver is repeated. Chosen."""
SILENCE_TICKS = 10
"""Ticks without a report of the inspector after which its orders are repeated. Chosen."""
OTHER_ROUTE_TICKS = 3
"""Ticks for which a requested route is awaited before the present one is driven. Chosen: messages take one."""
SAME_JAM_M = 60.0
"""Distance in metres within which two reported jams count as one. Chosen."""
EXACT_JAM_M = 25.0
"""Distance in metres within which two jams count as one if reported places must be exact: jams may be near each
other. Chosen."""
SPARE_MOVES, MOST_LOOKS = 4, 8
"""Moves that are kept for start and drive, and largest number of pictures of the last stretch. Chosen."""
LOOKING_TICKS = 10
"""Ticks after the order to drive for which pictures of the last stretch are awaited. Chosen."""


class RouteCoordinator:
    """Inspects, replans and drives one route. Its state belongs to one episode."""

    roles: ClassVar[tuple[str, ...]] = ("coordinator",)
    reads: ClassVar[tuple[str, ...]] = ("status",)
    sends: ClassVar[tuple[str, ...]] = ("assignment", "trafficJam", "guidance", "endpoints", "waypoint")

    def __init__(self, brief: Brief, detectors: Detectors = MappingProxyType({})) -> None:
        self._brief, self._detectors = brief, detectors
        self._order, self._jammed = sends(brief, "assignment"), sends(brief, "trafficJam")
        self._ends, self._place = sends(brief, "endpoints"), sends(brief, "waypoint")
        self._inspector, self._driver = _inspector_and_driver(brief)
        limits = [value for name, value in brief.settings.items() if name.startswith("replan")]
        self._replans_left = min(limits, default=math.inf)
        self._route: tuple[GroundPosition, ...] = ()
        self._ordered_tick = self._heard_tick = self._drive_tick = -1
        self._asked_tick = -1
        self._told: set[int] = set()
        self._asked: list[GroundPoint] = []
        self._arrived = False
        self._is_exact = names_places(brief)
        self._start: GroundPosition | None = None
        self._guidance: BuildingGuidance | None = None

    def act(self, observation: Observation, inbox: Inbox) -> Decision:
        """Order the inspection of a new route; otherwise process reports, replan or drive, and guide the walker."""
        decision = self._have_route(observation, inbox)
        led = self._have_led(observation)
        return Decision(messages=decision.messages + led) if led else decision

    def _have_led(self, observation: Observation) -> tuple[Outgoing, ...]:
        """Return guidance for the walker, once the route is verified."""
        if observation.tick == 0:
            self._guidance = BuildingGuidance.of(self._brief, observation, self._detectors)
        if self._guidance is None:
            return ()
        self._guidance.see(observation)
        if self._drive_tick < 0:
            return ()
        return self._guidance.lead(observation, waited=observation.tick - self._drive_tick > LOOKING_TICKS)

    def _have_route(self, observation: Observation, inbox: Inbox) -> Decision:
        self._arrived = self._arrived or any(
            event.kind.startswith("arrive") and len(event.entities) > 1 for event in observation.events
        )
        if self._arrived:
            return Decision()
        route = next((view.route for view in observation.entities if view.route), None)
        if self._start is None and self._is_exact:
            self._start = next((_before(view) for view in observation.entities if view.route), None)
        if route is not None and route != self._route and self._drive_tick < 0:
            self._route, self._told = route, set()
            return Decision(messages=self._name_way(observation) + self._have_inspected(observation.tick))
        messages: tuple[Outgoing, ...] = ()
        for envelope in inbox.messages:
            messages += self._hear(envelope, observation.tick)
        if not self._route:
            return Decision(messages=messages)
        if len(self._told) >= len(self._route):
            return Decision(messages=messages + self._have_driven(observation.tick))
        if observation.tick - max(self._ordered_tick, self._heard_tick) > SILENCE_TICKS:
            messages += self._have_inspected(observation.tick)
        return Decision(messages=messages)

    def _name_way(self, observation: Observation) -> tuple[Outgoing, ...]:
        """Return the messages that name the ends and the places of a new route, if the mission has them."""
        start = next((view.position for view in observation.entities if view.route and view.position), None)
        messages: list[Outgoing] = []
        if self._ends is not None and start is not None:
            ends: dict[str, Datum] = {"start": centimetres(start), "target": centimetres(self._route[-1])}
            messages.append(compose(self._ends, ends))
        if self._place is not None:
            for number, point in enumerate(self._route, 1):
                messages.append(compose(self._place, {"number": number, "position": centimetres(point)}))
        return tuple(messages)

    def _have_inspected(self, tick: int) -> tuple[Outgoing, ...]:
        self._ordered_tick = tick
        first = len(self._told) if len(self._told) < len(self._route) else 0
        if self._order is None:
            return ()
        end = self._route[-1][0], self._route[-1][1]
        last = self._guidance.viewpoints(end, self._looks()) if self._guidance is not None else ()
        inspect = [self._send(self._inspector, INSPECT, place) for place in self._route[first:]]
        start = (self._send(self._inspector, START, self._start),) if self._start is not None else ()
        return (*start, *inspect, *(self._send(self._inspector, LOOK, (*place, 0.0)) for place in last))

    def _looks(self) -> int:
        """Return the number of pictures of the last stretch that the moves allow, two moves each; at least one."""
        limits = [value for name, value in self._brief.settings.items() if name.startswith("moves")]
        left = min(limits, default=math.inf) - 2 * len(self._route) - SPARE_MOVES
        return max(1, int(min(left / 2.0, MOST_LOOKS)))

    def _have_driven(self, tick: int) -> tuple[Outgoing, ...]:
        if self._order is None or (self._drive_tick >= 0 and tick - self._drive_tick < REPEAT_TICKS):
            return ()
        if self._asked_tick >= 0 and tick - self._asked_tick < OTHER_ROUTE_TICKS:
            return ()  # the jam was at the last waypoint, and another route may come
        self._drive_tick = tick
        return (self._send(self._driver, DRIVE, self._route[-1]),)

    def _hear(self, envelope: Envelope, tick: int) -> tuple[Outgoing, ...]:
        task, place = name_in(envelope.body, "task"), position_in(envelope.body)
        if task is None or not task.startswith(INSPECT) or place is None or envelope.tick <= self._ordered_tick:
            return ()
        self._heard_tick = tick
        self._told.add(len(self._told))
        if name_in(envelope.body, "state") != JAMMED or self._jammed is None or self._replans_left < 1:
            return ()
        same_m = EXACT_JAM_M if self._is_exact else SAME_JAM_M
        if any(math.dist(place, before) < same_m for before in self._asked):
            return ()  # the new route passes the same jam: there is no way around it
        self._replans_left -= 1
        self._asked_tick = tick
        self._asked.append(place)
        body: dict[str, Datum] = {
            "waypoint": len(self._told),
            "position": (*place, self._brief.water_level_m),
            "confidence": 0.8,
        }
        return (compose(self._jammed, body),)

    def _send(self, assignee: str, task: str, place: GroundPosition) -> Outgoing:
        assert self._order is not None
        where = centimetres(place)
        return compose(self._order, {"assignee": assignee, "task": task, "position": where}, to=(assignee,))


def _before(view: EntityView) -> GroundPosition | None:
    """Return a place on the first waypoint's lane, as far before it as the vehicle, which may stand at the kerb."""
    if view.position is None or view.heading_deg is None or not view.route:
        return view.position
    x, y, *_ = view.route[0]
    far, heading = math.dist((x, y), view.position[:2]), math.radians(view.heading_deg)
    return x - far * math.sin(heading), y - far * math.cos(heading), 0.0


def _inspector_and_driver(brief: Brief) -> tuple[str, str]:
    """Return the inspector and the driver: of the peers with bodies that receive orders, inspectors may report jams."""
    orders = [message for message in brief.messages if message.type == "assignment"]
    reached = [peer for peer in brief.peers if peer.resources and any(order.is_for(peer.role) for order in orders)]
    seers = [peer for peer in reached if _may_send(brief, peer, "trafficJam")]
    others = [peer for peer in reached if peer not in seers and not _may_send(brief, peer, "report")]
    return (seers[0].id if seers else ""), (others[0].id if others else "")


def _may_send(brief: Brief, peer: Peer, kind: str) -> bool:
    return any(message.type == kind and message.is_sent_by(peer.role) for message in brief.messages)
