"""The communication links between agents: which edges of a message get through.

A link has two conditions, both of the instance's `comms`: the reach of radio, which the city engine works out for
pairs of assets at each boundary (`unheard`), and `loss`, the share of edges that never arrive. An agent without a
body, such as a coordinator, is in reach of all; one with several is where any of them is. Which edges are lost comes
from a stream of its own: it depends on the message and its recipient alone.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Literal

from lingjing.mission.instance import Instance
from lingjing.mission.seeding import integer

LossReason = Literal["", "out_of_range", "lost"]
"""Why an edge does not get through; "" if it does. Also the reason code of the sender's receipt."""

_BITS = 53


class MessageLinks:
    """The links of one instance; holds no run-time state."""

    def __init__(self, instance: Instance) -> None:
        self._path = f"{instance.mission}/comms/loss"
        self._seed = instance.seed
        self._loss = instance.comms.loss
        self._bodies = {agent.id: agent.controls for agent in instance.agents}

    def cut(self, message: str, sender: str, recipient: str, unheard: Iterable[tuple[str, str]]) -> LossReason:
        """Whether the edge of a message (by id) to one recipient is cut, given the pairs of assets out of reach."""
        if not self._in_reach(sender, recipient, unheard):
            return "out_of_range"
        if self._loss > 0.0:
            chance = integer(self._seed, f"{self._path}/{message}/{recipient}", _BITS) / 2**_BITS
            return "lost" if chance < self._loss else ""
        return ""

    def _in_reach(self, sender: str, recipient: str, unheard: Iterable[tuple[str, str]]) -> bool:
        ours, theirs = self._bodies.get(sender, ()), self._bodies.get(recipient, ())
        if not ours or not theirs:
            return True
        silent = {frozenset(pair) for pair in unheard}
        return any(frozenset((one, other)) not in silent for one in ours for other in theirs)
