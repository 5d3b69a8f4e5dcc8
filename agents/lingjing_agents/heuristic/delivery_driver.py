"""The delivery driver's rules: one tour after the other, back to the depot in between, with a report of each delivery.

Without a hub all drivers compute the same tours and share them in the common order. Each announces a tour's stops when
it starts; a driver without tours takes over the last one of the longest queue. With a hub the tours come from it.
"""

from __future__ import annotations

import math
from typing import ClassVar

from lingjing.plugins.policy import Action, Brief, Decision, EntityView, Inbox, Observation, Outgoing, Resource
from lingjing_agents.capability import compose, drive, rated, sends, team
from lingjing_agents.ground_plane import GroundPoint, position_in
from lingjing_agents.heuristic.delivery_view import LOADED, DeliveryView, look
from lingjing_agents.heuristic.events import view_of
from lingjing_agents.heuristic.order_book import DELIVER, OrderBook, told_orders
from lingjing_agents.heuristic.sightings import name_in
from lingjing_agents.paths.delivery_tours import DeliveryTour, shared_out, tours

NEAR_M = 25.0
"""Distance in metres at which a driver stops before a stop: deliveries happen within 30 m."""
DEPOT_M = 48.0
"""Distance in metres at which a driver stops before the depot: vans are loaded within 50 m."""
CLAIM_TICKS = 15
"""Ticks for which an announced stop is left to its driver. Chosen."""
HUB_PATIENCE_TICKS = 6
"""Ticks after which drivers plan without a silent hub. Chosen."""


class DeliveryDriver:
    """One van. Its state belongs to one episode."""

    roles: ClassVar[tuple[str, ...]] = ("driver",)
    reads: ClassVar[tuple[str, ...]] = ("tour", "assignment")
    sends: ClassVar[tuple[str, ...]] = ("assignment", "delivery")

    def __init__(self, brief: Brief, body: Resource) -> None:
        self._brief, self._body = brief, body
        self._claim, self._handover = sends(brief, "assignment"), sends(brief, "delivery")
        self._payload = rated(body, "payload_kg", 0.0)
        self._shares: dict[str, list[DeliveryTour]] = {name: [] for name in team(brief)}
        self._planned = False
        self._tour: DeliveryTour | None = None
        self._given: dict[str, float] = {}
        self._claims: dict[str, int] = {}
        self._loading = False
        self._before: tuple[dict[str, float], float] | None = None
        self._book = OrderBook()
        self._has_told = False

    def act(self, observation: Observation, inbox: Inbox) -> Decision:
        """Process messages, report deliveries, then drive on."""
        observed, own = look(observation), view_of(observation, self._body.id)
        if own is None or own.position is None or observed.depot is None:
            return Decision()
        orders = () if self._has_told else told_orders(self._brief, observed)
        self._has_told = True
        self._book.learn(inbox)
        seen = self._book.completed(observed, own)
        self._listen(inbox, seen, observation.tick)
        self._plan(observation.tick, seen)
        messages = orders + self._tell(seen, own)
        if self._tour is None or not self._left(self._tour, seen):
            messages += self._next_tour(observation.tick, seen)
        command = self._unblock(own) if own.busy else self._move(seen, own)
        return Decision(command=command, messages=messages)

    # -- assignment of tours

    def _plan(self, tick: int, seen: DeliveryView) -> None:
        late = self._brief.hub is not None and tick >= HUB_PATIENCE_TICKS and not any(self._shares.values())
        if self._planned or (self._brief.hub is not None and not late) or not seen.demands_kg:
            return
        if set(seen.places) != set(seen.demands_kg):  # places or demands are not known yet
            return
        assert seen.depot is not None
        plan = tours(seen.depot, seen.places, seen.demands_kg, self._payload)
        self._shares = shared_out(plan, team(self._brief))
        self._planned = True

    def _listen(self, inbox: Inbox, seen: DeliveryView, tick: int) -> None:
        for envelope in inbox.messages:
            stops = envelope.body.get("stops")
            assignee = name_in(envelope.body, "assignee")
            if isinstance(stops, (tuple, list)) and assignee in {self._brief.agent, self._body.id}:
                known = tuple(str(stop) for stop in stops if str(stop) in seen.places)
                self._planned = True
                each = self._payload / max(1, len(known))
                self._book.expect(known, each, seen)
                self._shares[self._brief.agent].append(DeliveryTour(known, (each,) * len(known), 0.0))
            elif envelope.category == "assignment" and name_in(envelope.body, "task") == DELIVER:
                place = position_in(envelope.body)
                if place is not None and seen.places and envelope.sender != self._brief.agent:
                    stop = min(seen.places, key=lambda name: math.dist(seen.places[name], place))
                    self._hear_claim(envelope.sender, stop, tick)

    def _hear_claim(self, sender: str, stop: str, tick: int) -> None:
        """Process another driver's announcement of a stop: a tour with this stop moves to that driver."""
        self._claims[stop] = tick
        if sender not in self._shares:
            return
        for owner, queue in self._shares.items():
            for tour in [tour for tour in queue if stop in tour.stops]:
                split = sum(stop in other.stops for each in self._shares.values() for other in each) > 1
                if owner != sender and not split:
                    queue.remove(tour)
                    self._shares[sender].append(tour)

    def _next_tour(self, tick: int, seen: DeliveryView) -> tuple[Outgoing, ...]:
        queue = self._shares[self._brief.agent]
        self._tour, self._given = None, {}
        while queue:
            tour = queue.pop(0)
            if any(seen.demands_kg.get(stop, 0.0) > 0.0 for stop in tour.stops):
                self._tour = tour
                return self._say_claim(tour, seen)
        if self._brief.hub is None and not self._planned:
            return ()
        return self._take_over(tick, seen) if self._brief.hub is None or tick > self._brief.ticks * 0.6 else ()

    def _take_over(self, tick: int, seen: DeliveryView) -> tuple[Outgoing, ...]:
        """Take over the last tour of the driver with the most tours (at least one that has not started)."""
        left = {
            name: [tour for tour in queue if all(seen.demands_kg.get(stop, 0.0) > 0.0 for stop in tour.stops)]
            for name, queue in self._shares.items()
            if name != self._brief.agent
        }
        busiest = max(left, key=lambda name: len(left[name]), default=None)
        if busiest is not None and len(left[busiest]) >= 2:
            self._tour = left[busiest][-1]
            self._shares[busiest].remove(self._tour)
            return self._say_claim(self._tour, seen)
        return self._mop_up(tick, seen)

    def _mop_up(self, tick: int, seen: DeliveryView) -> tuple[Outgoing, ...]:
        """Take the longest tour over the open demands that no driver has announced recently."""
        free = {
            stop: left
            for stop, left in seen.demands_kg.items()
            if stop in seen.places and left > 0.0 and tick - self._claims.get(stop, -CLAIM_TICKS) >= CLAIM_TICKS
        }
        assert seen.depot is not None
        rest = tours(seen.depot, seen.places, free, self._payload)
        if not rest:
            return ()
        self._tour = rest[0]
        return self._say_claim(self._tour, seen)

    def _say_claim(self, tour: DeliveryTour, seen: DeliveryView) -> tuple[Outgoing, ...]:
        if self._claim is None:
            return ()
        announcements = []
        for stop in tour.stops:
            place = (*(round(value, 1) for value in seen.places[stop]), self._brief.water_level_m)
            announcements.append(
                compose(self._claim, {"assignee": self._brief.agent, "task": DELIVER, "position": place})
            )
        return tuple(announcements)

    # -- deliveries

    def _tell(self, seen: DeliveryView, own: EntityView) -> tuple[Outgoing, ...]:
        """Report a delivery: the load and a stop's demand have both decreased."""
        load = (own.resources or {}).get(LOADED, 0.0)
        before, self._before = self._before, (seen.demands_kg, load)
        if before is None or load >= before[1] or own.position is None:
            return ()
        here = own.position[:2]
        fallen = [stop for stop, left in seen.demands_kg.items() if before[0].get(stop, left) - left > 1e-6]
        stop = min(fallen, key=lambda name: math.dist(seen.places[name], here), default=None)
        if stop is None:
            return ()
        dropped = min(before[1] - load, before[0][stop] - seen.demands_kg[stop])
        self._given[stop] = self._given.get(stop, 0.0) + dropped
        if self._handover is None:
            return ()
        left = seen.demands_kg[stop]
        return (compose(self._handover, {"stop": stop, "delivered": dropped, "left": left}),)

    def _left(self, tour: DeliveryTour, seen: DeliveryView) -> list[str]:
        """Return the stops of the tour that still need this van's goods."""
        return [
            stop
            for stop, amount in zip(tour.stops, tour.amounts, strict=True)
            if seen.demands_kg.get(stop, 0.0) > 0.0 and self._given.get(stop, 0.0) < amount - 1e-6
        ]

    # -- motion

    def _move(self, seen: DeliveryView, own: EntityView) -> Action | None:
        assert own.position is not None
        assert seen.depot is not None
        load = (own.resources or {}).get(LOADED, 0.0)
        left = self._left(self._tour, seen) if self._tour is not None else []
        here = own.position[:2]
        wanted = min(self._payload, sum(seen.demands_kg[stop] for stop in left))
        at_depot = math.dist(here, seen.depot) <= DEPOT_M
        self._loading = False
        if left and (load >= wanted - 1e-6 or (load > 0.0 and not at_depot and load >= 0.5 * self._payload)):
            return self._drive(here, seen.places[left[0]], NEAR_M)
        if left or self._shares[self._brief.agent] or load < self._payload:
            self._loading = True
            return self._drive(here, seen.depot, DEPOT_M)
        return None

    def _unblock(self, own: EntityView) -> Action | None:
        """Leave the queue before the depot once the van is full."""
        full = (own.resources or {}).get(LOADED, 0.0) >= self._payload - 1e-6
        if not (self._loading and full and own.status == "waiting"):
            return None
        self._loading = False
        return Action(verb="stop", resource=self._body.id)

    def _drive(self, here: GroundPoint, there: GroundPoint, near_m: float) -> Action | None:
        return drive(self._body, there) if math.dist(here, there) > near_m else None
