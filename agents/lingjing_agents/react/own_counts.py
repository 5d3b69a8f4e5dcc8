"""`OwnCounts`: an agent's accepted commands and its claims so far. Missions limit both, and earlier turns are
forgotten.

They are counted from what the agent sent and from its receipts, so that they tell nothing of the limit's effect.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping

import msgspec

from lingjing.plugins.policy import Brief, Datum, Decision, Inbox, is_request_of

_REROUTE = "trafficJam"
"""The record of messages that request another route (`scenarios/std/messages.ljs`)."""


class OwnCounts:
    """The counts of one agent in one episode."""

    def __init__(self, brief: Brief) -> None:
        self._agent = brief.agent
        self._reroutes = {message.kind for message in brief.messages if message.type == _REROUTE}
        self._commands: Counter[str] = Counter()
        self._claims: set[bytes] = set()

    def receive(self, inbox: Inbox) -> None:
        """Count the commands that the receipts accept, by resource."""
        for receipt in inbox.receipts:
            own = receipt.sender == self._agent and is_request_of("command", receipt.request)
            if own and receipt.status == "accepted":
                self._commands[receipt.resource] += 1

    def send(self, decision: Decision) -> None:
        """Count the claims of a decision: each different box of a picture, and each place of a request for a route."""
        for message in decision.messages:
            claim = _claim(message.body, is_reroute=message.kind in self._reroutes)
            if claim is not None:
                self._claims.add(claim)

    def members(self) -> Mapping[str, object]:
        """Return the counts as a member of the state; a count of 0 is left out."""
        counts = {"commands_accepted": dict(sorted(self._commands.items())), "claims": len(self._claims)}
        return {"your_counts": {name: value for name, value in counts.items() if value}}


def _claim(body: Mapping[str, Datum], *, is_reroute: bool) -> bytes | None:
    """Return the identity of a message's claim; None if it claims nothing."""
    if "frame" in body and "box" in body:
        return msgspec.json.encode((body["frame"], body["box"], body.get("class")))
    if is_reroute and "position" in body:
        return msgspec.json.encode(body["position"])
    return None
