"""`OwnCounts` and `OwnOrders`: an agent's accepted commands and messages, its claims, and its newest orders to others.

Missions limit the former, and earlier turns are forgotten. They are taken from what the agent sent and from its
receipts, so that they tell nothing of an order's or a limit's effect.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import msgspec

from lingjing.plugins.geometry import bearing_deg
from lingjing.plugins.policy import Brief, Datum, Decision, Inbox, LimitSpec, Observation, Receipt, is_request_of
from lingjing_agents.ground_plane import position_in

_REROUTE = "trafficJam"
"""The record of messages that request another route (`scenarios/std/messages.ljs`)."""

_ORDER = "assignment"
"""The category of messages that are orders."""

MOST_ORDERS = 12
"""Orders in a state, the newest, so that a large fleet fits in a request. Chosen."""


class OwnCounts:
    """The counts of one agent in one episode."""

    def __init__(self, brief: Brief) -> None:
        self._agent = brief.agent
        self._limits = tuple(limit for limit in brief.limits if not limit.stage)
        self._reroutes = {message.kind for message in brief.messages if message.type == _REROUTE}
        self._commands: Counter[tuple[str, str]] = Counter()
        self._messages: Counter[str] = Counter()
        self._claims: set[bytes] = set()
        self._verbs: dict[int, str] = {}

    def receive(self, inbox: Inbox) -> None:
        """Count the commands and messages that the receipts accept, by resource and verb, and by kind."""
        for receipt in inbox.receipts:
            if receipt.sender != self._agent or receipt.status != "accepted":
                continue
            if is_request_of("command", receipt.request):
                self._commands[receipt.resource, self._verbs.get(receipt.tick, "")] += 1
            elif is_request_of("message", receipt.request):
                self._messages[receipt.resource] += 1

    def send(self, decision: Decision, tick: int) -> None:
        """Count the claims of a decision: each different box of a picture, and each place of a request for a route.
        `tick` is the decision's; its command is admitted one tick later."""
        if decision.command is not None:
            self._verbs[tick + 1] = decision.command.verb
        for message in decision.messages:
            claim = _claim(message.body, is_reroute=message.kind in self._reroutes)
            if claim is not None:
                self._claims.add(claim)

    def members(self) -> Mapping[str, object]:
        """Return the counts and what they leave of the limits as members of the state; a count of 0 is left out."""
        commands: Counter[str] = Counter()
        for (resource, _), count in self._commands.items():
            commands[resource] += count
        counts = {
            "commands_accepted": dict(sorted(commands.items())),
            "messages_accepted": dict(sorted(self._messages.items())),
            "claims": len(self._claims),
        }
        left = {limit.name: max(0, limit.most - self._used(limit)) for limit in self._limits}
        return {"your_counts": {name: value for name, value in counts.items() if value}, "limits_left_at_most": left}

    def _used(self, limit: LimitSpec) -> int:
        used = 0
        for item in limit.counts:
            if item.kind == "claims":
                used += len(self._claims)
            elif item.kind == "message":
                used += self._messages[item.name]
            else:
                used += sum(
                    count
                    for (resource, verb), count in self._commands.items()
                    if resource == item.resource and item.name in ("", verb)
                )
        return used


@dataclass(frozen=True, slots=True)
class _Order:
    """An order that was sent."""

    kind: str
    body: Mapping[str, Datum]
    sent: int
    """The tick of the decision."""


class OwnOrders:
    """The newest order of one agent to each assignee, as long as it was not rejected."""

    def __init__(self, brief: Brief) -> None:
        self._agent = brief.agent
        self._kinds = {message.kind for message in brief.messages if message.category == _ORDER}
        self._bodies = {peer.id: peer.resources for peer in brief.peers}
        self._orders: dict[str, _Order] = {}
        self._before: dict[str, _Order] = {}
        """The orders before those of the last decision, which a rejected receipt restores."""

    def send(self, decision: Decision, tick: int) -> None:
        """Store the orders of a decision."""
        self._before = dict(self._orders)
        for message in decision.messages:
            if message.kind in self._kinds:
                assignee = str(message.body.get("assignee", ""))
                self._orders.pop(assignee, None)
                self._orders[assignee] = _Order(message.kind, message.body, tick)

    def receive(self, inbox: Inbox) -> None:
        """Take back the orders that were rejected."""
        for receipt in inbox.receipts:
            if self._is_rejected_order(receipt):
                self._take_back(receipt.resource, receipt.tick - 1)

    def members(self, observation: Observation) -> Mapping[str, object]:
        """Return the newest orders as a member of the state, with the way that is left to the places of orders."""
        newest = list(self._orders.items())[-MOST_ORDERS:]
        return {"your_last_orders": [self._in_words(name, order, observation) for name, order in newest]}

    def _is_rejected_order(self, receipt: Receipt) -> bool:
        is_own = receipt.sender == self._agent and is_request_of("message", receipt.request)
        return is_own and receipt.status == "rejected" and receipt.resource in self._kinds

    def _take_back(self, kind: str, sent: int) -> None:
        """Restore the orders before those of a kind and a tick. With several of them, none is known to be in force."""
        for assignee in [name for name, order in self._orders.items() if (order.kind, order.sent) == (kind, sent)]:
            del self._orders[assignee]
            if assignee in self._before:
                self._orders[assignee] = self._before[assignee]

    def _in_words(self, assignee: str, order: _Order, observation: Observation) -> dict[str, object]:
        left = dict(self._way_left(assignee, order, observation))
        return {"kind": order.kind, **order.body, "sent_at_tick": order.sent, **left}

    def _way_left(self, assignee: str, order: _Order, observation: Observation) -> Iterator[tuple[str, float]]:
        """Yield distance and bearing from the assignee's body to the order's position, where both are known."""
        goal = position_in(order.body)
        names = self._bodies.get(assignee, (assignee,))
        places = [view.position for view in observation.entities if view.id in names and view.position is not None]
        if goal is not None and len(places) == 1:
            here = places[0][:2]
            yield "distance_left_m", round(math.dist(here, goal), 1)
            yield "bearing_deg", round(bearing_deg(here, goal), 1)


def _claim(body: Mapping[str, Datum], *, is_reroute: bool) -> bytes | None:
    """Return the identity of a message's claim; None if it claims nothing."""
    if "frame" in body and "box" in body:
        return msgspec.json.encode((body["frame"], body["box"], body.get("class")))
    if is_reroute and "position" in body:
        return msgspec.json.encode(body["position"])
    return None
