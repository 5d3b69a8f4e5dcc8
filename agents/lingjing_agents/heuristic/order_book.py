"""Orders that an agent learns from messages, because it observes no places or no demands of stops.

A place comes as an assignment with the stop's name as task, an open demand as a delivery report. The plan of a
coordinator has no demands: of a stop in a tour the van's share of its load is assumed.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

from lingjing.plugins.policy import Brief, Datum, EntityView, Inbox, Outgoing
from lingjing_agents.capability import compose, sends
from lingjing_agents.ground_plane import GroundPoint, position_in
from lingjing_agents.heuristic.delivery_view import LOADED, DeliveryView
from lingjing_agents.heuristic.sightings import name_in

DELIVER = "deliver"
"""The task name of an announcement, which is no stop's name."""
REACH_M = 30.0
"""Distance in metres within which a van delivers."""
WAIT_TICKS = 2
"""Ticks beside a stop without a delivery after which it wants nothing more. Chosen."""


class OrderBook:
    """The told places and open demands of one agent."""

    def __init__(self) -> None:
        self._places: dict[str, GroundPoint] = {}
        self._left: dict[str, float] = {}
        self._load: float | None = None
        self._beside: dict[str, int] = {}

    def learn(self, inbox: Inbox) -> None:
        """Read places and open demands in messages."""
        for envelope in inbox.messages:
            place, task = position_in(envelope.body), name_in(envelope.body, "task")
            if envelope.category == "assignment" and place is not None and task not in (None, DELIVER):
                self._places[str(task)] = place
            stop, left = name_in(envelope.body, "stop"), envelope.body.get("left")
            if stop is not None and isinstance(left, int | float):
                self._left[stop] = float(left)

    def expect(self, stops: tuple[str, ...], each_kg: float, seen: DeliveryView) -> None:
        """Assume an open demand at stops of a tour without a known demand."""
        for stop in stops:
            if stop not in seen.demands_kg or self._left.get(stop, math.inf) <= 0.0:
                self._left[stop] = each_kg

    def completed(self, seen: DeliveryView, own: EntityView) -> DeliveryView:
        """Return the view with the told places and demands. What is observed has priority."""
        places = {**self._places, **seen.places}
        self._count_own(seen, places, own)
        demands = {**{name: left for name, left in self._left.items() if name in places}, **seen.demands_kg}
        return DeliveryView(places, demands, seen.depot, seen.vans)

    def _count_own(self, seen: DeliveryView, places: Mapping[str, GroundPoint], own: EntityView) -> None:
        """Subtract what the own van has just delivered from the nearest stop with an unobserved demand."""
        load, before = (own.resources or {}).get(LOADED, 0.0), self._load
        self._load = load
        unobserved = [
            name for name in self._left if name not in seen.demands_kg and name in places and self._left[name] > 0.0
        ]
        if own.position is None or before is None or not unobserved:
            return
        here = own.position[:2]
        near = min(unobserved, key=lambda name: math.dist(places[name], here))
        if math.dist(places[near], here) > REACH_M:
            return
        self._beside[near] = 0 if load < before else self._beside.get(near, 0) + 1
        if load < before:
            self._left[near] = max(0.0, self._left[near] - (before - load))
        elif load > 0.0 and self._beside[near] >= WAIT_TICKS:
            self._left[near] = 0.0


def told_orders(brief: Brief, seen: DeliveryView) -> tuple[Outgoing, ...]:
    """Return messages with all places, or all demands, that an agent observes without the others."""
    messages: list[Outgoing] = []
    place_message, demand_message = sends(brief, "assignment"), sends(brief, "delivery")
    for stop in sorted(set(seen.places) - set(seen.demands_kg)):
        if place_message is not None:
            place = (*seen.places[stop], brief.water_level_m)
            messages.append(compose(place_message, {"assignee": brief.agent, "task": stop, "position": place}))
    for stop in sorted(set(seen.demands_kg) - set(seen.places)):
        if demand_message is not None:
            body: dict[str, Datum] = {"stop": stop, "delivered": 0.0, "left": seen.demands_kg[stop]}
            messages.append(compose(demand_message, body))
    return tuple(messages)
