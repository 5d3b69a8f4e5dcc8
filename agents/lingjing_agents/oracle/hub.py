"""The hub: relays messages and sends orders when they can be carried out."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence

from lingjing.plugins.policy import STOP, Brief, Datum, Envelope, InspectionSpec, Outgoing
from lingjing.plugins.tasks import Task
from lingjing_agents.capability import CLEAR, INSPECT
from lingjing_agents.ground_plane import position_in
from lingjing_agents.oracle.ability import Ability
from lingjing_agents.oracle.composing import MessageComposer
from lingjing_agents.oracle.privileged_state import InstanceIndex, PrivilegedState
from lingjing_agents.oracle.routes import RouteWatch, another_way, is_blocked, jams, jams_on

REPEAT_TICKS = 6
"""Ticks without progress after which an order is repeated, if messages can be lost. Chosen."""


class _HubAbility(Ability):
    """The hub of a star topology, or the agent without a body in a broadcast topology, which leads without relaying."""

    def __init__(self, brief: Brief, plan: InstanceIndex, composer: MessageComposer) -> None:
        self._brief, self._plan, self._composer = brief, plan, composer
        self._roles = {peer.id: peer.role for peer in brief.peers}
        self._loses = brief.loss > 0.0 or brief.range_m is not None
        self._ordered: dict[tuple[str, str], int] = {}
        self._followed: dict[str, tuple[int, int]] = {}
        self._since: dict[str, int] = {}
        self._named: dict[str, set[int]] = {}
        self._asked: set[tuple[str, str]] = set()
        self._replans = {inspection.replan for inspection in plan.instance.inspections}
        self._watches = {spec.asset: RouteWatch(spec.asset) for spec in plan.instance.inspections}

    def say(self, truth: PrivilegedState) -> list[Outgoing]:
        """Return orders and relayed messages."""
        messages: list[Outgoing] = []
        for message in truth.inbox.messages:
            messages += self._pass_on(message, truth)
        # requests for another route before mere reports of a jam, so that a jam causes one request
        for message in sorted(truth.inbox.messages, key=lambda received: received.kind not in self._replans):
            messages += self._another_way(message, truth)
        return messages + self._cells(truth) + self._inspections(truth) + self._tasks(truth)

    def _pass_on(self, message: Envelope, truth: PrivilegedState) -> list[Outgoing]:
        """Relay a message to the roles that a relation names: unchanged, or as an order to its position."""
        relayed: list[Outgoing] = []
        if self._brief.hub is None:
            return relayed
        for relation in self._plan.instance.relations:
            kind = relation.carries or relation.by
            if kind in self._replans or kind != message.kind or relation.source != self._roles.get(message.sender):
                continue
            to = tuple(name for name, role in self._roles.items() if role == relation.target and name != message.sender)
            if not to:
                continue
            if self._composer.kind(message.kind) is not None:
                relayed += self._composer.say(message.kind, message.body, to)
            elif (place := position_in(message.body)) is not None and not is_blocked(truth, place):
                relayed += self._order_there(message, [name for name in to if self._may_go(name, message, truth)])
        return relayed

    def _may_go(self, agent: str, message: Envelope, truth: PrivilegedState) -> bool:
        """Return whether an agent may go to the reported place. To a blocking object go only the agents that can serve
        it.
        """
        reported = message.body.get("class")
        blocking = {jam.id for jam in jams(truth) if jam.type == reported}
        dealt = (task for task in truth.left if task.target in blocking)
        return not blocking or any(self._plan.owners[body.id].id == agent for body in self._plan.able(*dealt))

    def _another_way(self, message: Envelope, truth: PrivilegedState) -> list[Outgoing]:
        """Return a request for another route after an inspector's report of a jam, once for each jam.

        If the new route passes the same jam, there is no way around it.
        """
        requests: list[Outgoing] = []
        place = position_in(message.body)
        if place is None or message.body.get("state") == CLEAR:
            return requests
        for inspection in self._plan.instance.inspections:
            route = truth.routes.get(inspection.asset)
            if route is None or message.sender not in self._inspectors(inspection):
                continue
            for jam in jams_on(truth, route):
                near = math.dist(truth.place(jam.id), place) <= inspection.within_m + (jam.blocked_m or 0.0)
                is_reported = near and message.body.get("class", jam.type) == jam.type
                if is_reported and (inspection.name, jam.id) not in self._asked:
                    self._asked.add((inspection.name, jam.id))
                    if message.kind != inspection.replan:
                        requests += self._composer.say(inspection.replan, another_way(truth, route, jam))
        return requests

    def _inspectors(self, inspection: InspectionSpec) -> list[str]:
        owners = [self._plan.owners[name].id for name in inspection.by if name in self._plan.owners]
        return [agent for agent in dict.fromkeys(owners) if agent in self._roles]

    def _order_there(self, message: Envelope, to: Sequence[str]) -> list[Outgoing]:
        body: dict[str, Datum] = {"position": message.body["position"]}
        orders: list[Outgoing] = []
        for name in to:
            orders += self._composer.order(name, str(message.body.get("class", "go")), body, (name,))
        return orders

    def _cells(self, truth: PrivilegedState) -> list[Outgoing]:
        """Return, at the start, an order for each guided agent with its part of the search cells."""
        roles = {relation.target for relation in self._plan.instance.relations if relation.kind == "guidance"}
        if truth.tick != 0 or not self._brief.cells:
            return []
        mates = [name for name, role in self._roles.items() if role in roles]
        orders: list[Outgoing] = []
        for number, name in enumerate(mates):
            cell = self._brief.cells[number % len(self._brief.cells)]
            orders += self._composer.order(name, "search", {"cell": cell.name}, (name,))
        return orders

    def _inspections(self, truth: PrivilegedState) -> list[Outgoing]:
        """Return, for each new route, its ends and places, and orders to its inspectors with all waypoints that were
        not inspected yet."""
        orders: list[Outgoing] = []
        for inspection in self._plan.instance.inspections:
            route = truth.routes.get(inspection.asset)
            seen = truth.known.inspected.get(inspection.name, ())
            if route is None or not self._is_due(inspection.name, route.number, len(seen), truth.tick):
                continue
            if route.number not in self._named.setdefault(inspection.name, set()) and route.waypoints:
                self._named[inspection.name].add(route.number)
                orders += self._composer.way(self._plan.entities[inspection.asset].position, route.waypoints)
            for agent in self._inspectors(inspection):
                for number, waypoint in enumerate(route.waypoints):
                    if number not in seen:
                        orders += self._composer.order(agent, INSPECT, {"position": waypoint}, (agent,))
        return orders

    def _is_due(self, inspection: str, route: int, seen: int, tick: int) -> bool:
        """Return whether a route is new, or its inspection has made no progress for so long that an order may be
        lost.
        """
        before = self._followed.get(inspection, (0, 0))
        is_new = before[0] != route
        if before == (route, seen) and not (self._loses and tick - self._since[inspection] >= REPEAT_TICKS):
            return False
        self._followed[inspection], self._since[inspection] = (route, seen), tick
        return is_new or before == (route, seen)

    def _tasks(self, truth: PrivilegedState) -> list[Outgoing]:
        """Return orders to serve targets, as soon as that is permitted and the target reported where it must be."""
        orders: list[Outgoing] = []
        waiting = {vehicle for vehicle, watch in self._watches.items() if watch.is_to_wait(truth)}
        for task in truth.left:
            if task.moves_goods or task.target in truth.unreported:
                continue
            name = self._performer(truth, task, waiting)
            if name and self._is_to_order(name, task, truth.tick):
                self._ordered[name, task.target] = truth.tick
                body: dict[str, Datum] = {"position": truth.states[task.target].position}
                orders += self._composer.order(name, task.name, body, (name,))
        return orders

    def _is_to_order(self, agent: str, task: Task, tick: int) -> bool:
        """Return whether an agent has no order for a target yet, or one so old that it may be lost."""
        before = self._ordered.get((agent, task.target))
        again = self._loses and bool(self._watches) and before is not None and tick - before >= REPEAT_TICKS
        return before is None or again

    def _performer(self, truth: PrivilegedState, task: Task, waiting: Collection[str]) -> str:
        able = [
            body.id
            for body in self._plan.able(task)
            if body.id not in waiting
            and self._plan.owners[body.id].id in self._roles
            and not any(truth.forbidden(body.id, verb.name) for verb in body.verbs if verb.name != STOP)
        ]
        if not able:
            return ""
        return self._plan.owners[min(able, key=lambda name: truth.distance(name, task.target))].id


def hub_abilities(brief: Brief, plan: InstanceIndex, composer: MessageComposer) -> list[Ability]:
    """Return the hub's ability for the hub, or without a hub for an agent with peers and no body."""
    bodiless = brief.hub is None and bool(brief.peers) and not any(body.embodied for body in brief.resources)
    return [_HubAbility(brief, plan, composer)] if brief.hub == brief.agent or bodiless else []
