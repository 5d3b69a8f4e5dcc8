"""The delivery coordinator's rules: tours for all vans, each sent before the driver has finished the last one."""

from __future__ import annotations

import math
from typing import ClassVar

from lingjing.plugins.policy import Brief, Decision, Inbox, Observation, Outgoing
from lingjing_agents.capability import compose, natural, sends
from lingjing_agents.ground_plane import GroundPoint
from lingjing_agents.heuristic.delivery_view import DeliveryView, look
from lingjing_agents.paths.delivery_tours import DeliveryTour, shared_out, tours

AHEAD = 2
"""Tours that a driver has at a time: the current and the next one, since orders take a tick."""
PATIENCE_TICKS = 25
"""Ticks after which a tour is also sent to another driver. Chosen."""
STILL_TICKS, STILL_M = 4, 3.0
"""Ticks without motion, and motion in metres that counts as none, after which a driver receives its tour again.
Chosen.
"""


class DeliveryCoordinator:
    """Assigns tours and tracks them. Its state belongs to one episode."""

    roles: ClassVar[tuple[str, ...]] = ("coordinator",)
    reads: ClassVar[tuple[str, ...]] = ()
    sends: ClassVar[tuple[str, ...]] = ("tour",)

    def __init__(self, brief: Brief) -> None:
        self._brief = brief
        self._plan = sends(brief, "tour")
        tours = [message for message in brief.messages if message.type == "tour"]
        reached = [peer for peer in brief.peers if any(message.is_for(peer.role) for message in tours)]
        drivers = [peer for peer in reached if peer.resources]
        self._vans = {peer.id: peer.resources[0] for peer in sorted(drivers, key=lambda peer: natural(peer.id))}
        self._waiting: dict[str, list[DeliveryTour]] | None = None
        self._given: dict[str, list[tuple[DeliveryTour, int]]] = {name: [] for name in self._vans}
        self._still: dict[str, tuple[GroundPoint, int]] = {}

    def act(self, observation: Observation, inbox: Inbox) -> Decision:
        """Plan once, then send the next tour to each driver with fewer than `AHEAD` tours."""
        seen = look(observation)
        if self._plan is None or seen.depot is None or not seen.vans:
            return Decision()
        if self._waiting is None:
            self._vans = {name: van for name, van in self._vans.items() if van in seen.vans}
            payload = self._payload(seen)
            made = tours(seen.depot, seen.places, seen.demands_kg, payload)
            self._waiting = shared_out(made, tuple(self._vans))
        messages = self._places(seen) if observation.tick == 0 else ()
        for name in self._vans:
            self._given[name] = [each for each in self._given[name] if _open(each[0], seen)]
            while len(self._given[name]) < AHEAD and (tour := self._next(name)) is not None:
                self._given[name].append((tour, observation.tick))
                messages += (self._say(name, tour),)
        messages += self._remind(observation.tick, seen)
        return Decision(messages=messages + self._rescue(observation.tick))

    def _places(self, seen: DeliveryView) -> tuple[Outgoing, ...]:
        """Return the place of each stop, for drivers that do not observe it: where the mission has a message for it."""
        message = sends(self._brief, "assignment")
        if message is None:
            return ()
        level = self._brief.water_level_m
        return tuple(
            compose(message, {"assignee": next(iter(self._vans)), "task": stop, "position": (*place, level)})
            for stop, place in seen.places.items()
        )

    def _remind(self, tick: int, seen: DeliveryView) -> tuple[Outgoing, ...]:
        reminders: tuple[Outgoing, ...] = ()
        for name, van in self._vans.items():
            view = seen.vans.get(van)
            if view is None or view.position is None:
                continue
            here = view.position[:2]
            if name not in self._still or math.dist(self._still[name][0], here) > STILL_M:
                self._still[name] = here, tick
            elif self._given[name] and tick - self._still[name][1] >= STILL_TICKS:
                self._still[name] = here, tick
                reminders += (self._say(name, self._given[name][0][0]),)
        return reminders

    def _payload(self, seen: DeliveryView) -> float:
        """Return the capacity of a van in kilograms: at the start all are full."""
        loads = [(view.resources or {}).get("load", 0.0) for view in seen.vans.values()]
        return max(loads, default=0.0)

    def _next(self, name: str) -> DeliveryTour | None:
        """Return the driver's own next tour, or the last one of the longest queue."""
        assert self._waiting is not None
        if self._waiting[name]:
            return self._waiting[name].pop(0)
        if self._given[name]:
            return None
        busiest = max(self._waiting, key=lambda other: len(self._waiting[other]) if self._waiting else 0)
        return self._waiting[busiest].pop() if self._waiting[busiest] else None

    def _rescue(self, tick: int) -> tuple[Outgoing, ...]:
        """Send a tour that takes too long to an idle driver."""
        idle = [name for name, tours_given in self._given.items() if not tours_given]
        for name, mine in self._given.items():
            for tour, since in mine[:1]:
                if idle and tick - since > PATIENCE_TICKS:
                    self._given[name] = mine[1:]
                    self._given[idle[0]] = [(tour, tick)]
                    return (self._say(idle[0], tour),)
        return ()

    def _say(self, name: str, tour: DeliveryTour) -> Outgoing:
        assert self._plan is not None
        return compose(self._plan, {"assignee": name, "stops": tour.stops, "load": tour.load}, to=(name,))


def _open(tour: DeliveryTour, seen: DeliveryView) -> bool:
    return any(seen.demands_kg.get(stop, 0.0) > 0.0 for stop in tour.stops)
