"""The message bus B: validate candidate messages, expand them to edges, stage, commit, deliver.

An *edge* is a message on its way to one recipient. In star topology an agent's message goes to the hub; the hub's
message goes to the recipients it names, or to all that the message kind declares. In broadcast topology a message goes
to all other active agents. No message is relayed automatically. With a delay of one tick, a message of boundary t is
staged for t + 1 and readable there. An edge is fixed at validation and delivered only after the engine barrier has
committed the boundary. A message that would arrive after the episode's end is rejected as `expired`. A report is
addressed to the adjudicator first, so it is accepted even if no agent can read it. A link between two agents may drop
edges (out of range, lost); the sender's receipt lists them, and a message without any remaining edge is rejected.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping, Sequence
from itertools import count
from typing import Literal, NamedTuple

import msgspec
from msgspec.structs import replace

from lingjing.kernel.admission import body_check
from lingjing.kernel.budgets import Tally
from lingjing.mission.instance import AgentSpec, Instance, MessageSpec
from lingjing.mission.seeding import integer
from lingjing.plugins.decisions import MESSAGES_PER_CALL
from lingjing.trace.records import Envelope, Outgoing, Receipt
from lingjing.trace.request_ids import request_id


class Bus(msgspec.Struct, frozen=True):
    """The edges in transit."""

    staged: tuple[Envelope, ...] = ()
    """Edges that wait for the barrier."""
    committed: tuple[Envelope, ...] = ()
    """Edges that wait for their delivery tick."""

    def stage(self, envelopes: Sequence[Envelope]) -> Bus:
        """Buffer admitted edges until the boundary commits."""
        return replace(self, staged=self.staged + tuple(envelopes))

    def commit(self) -> Bus:
        """Mark every staged edge deliverable, atomically."""
        return Bus(committed=self.committed + self.staged)

    def deliver(self, tick: int) -> tuple[Bus, tuple[Envelope, ...]]:
        """Remove and return the edges that are readable at `tick`, in order of admission."""
        due = tuple(envelope for envelope in self.committed if envelope.deliver_at <= tick)
        return replace(self, committed=tuple(e for e in self.committed if e.deliver_at > tick)), due


class _Candidate(NamedTuple):
    """A message of a policy's decision."""

    id: str
    """The request id."""
    tick: int
    """The boundary at which it is validated."""
    sender: str
    """The id of the sending agent."""
    message: Outgoing
    """The message as the policy returned it."""
    place: int
    """The index among the messages of its decision, from 0."""


LossReason = Literal["", "out_of_range", "lost"]
"""The reason for which an edge is dropped, also the reason code of the sender's receipt; "" if it is delivered."""

_BITS = 53
"""Random bits of a draw: the precision of a double."""


class RadioConditions(msgspec.Struct, frozen=True):
    """The radio at one boundary, if events change it."""

    everywhere: float
    """Share of lost edges outside of jammed regions, 0..1."""
    jammed: Mapping[str, float] = {}
    """Agent → the greatest loss among the jammed regions in which it has a body."""

    def loss(self, agents: Iterable[str]) -> float:
        """Return the loss of an edge between agents: the worst of its ends."""
        return max((self.everywhere, *(self.jammed.get(agent, 0.0) for agent in agents)))


class _MessageLinks:
    """The links between the agents of one instance. Holds no run-time state.

    A link has two conditions in the instance's `comms`: the radio range, which the city engine evaluates for pairs of
    assets at each boundary, and `loss`, the share of edges that are dropped. An agent without a body, such as a
    coordinator, is in range of all; an agent with several bodies is in range if any of them is. Losses are drawn from a
    stream of their own that depends only on the message and its recipient.
    """

    def __init__(self, instance: Instance) -> None:
        self._path = f"{instance.mission}/comms/loss"
        self._seed = instance.seed
        self._loss = instance.comms.loss
        self._bodies = {agent.id: agent.controls for agent in instance.agents}

    def loss_reason(
        self,
        message: str,
        sender: str,
        recipient: str,
        unreachable_links: Iterable[tuple[str, str]],
        conditions: RadioConditions | None = None,
    ) -> LossReason:
        """Return the reason for which the edge of a message (by id) to one recipient is dropped; "" if it is delivered.

        `unreachable_links` are the pairs of assets that radio does not connect.
        """
        if not self._in_reach(sender, recipient, unreachable_links):
            return "out_of_range"
        loss = self._loss if conditions is None else conditions.loss((sender, recipient))
        if loss > 0.0:
            chance = integer(self._seed, f"{self._path}/{message}/{recipient}", _BITS) / 2**_BITS
            return "lost" if chance < loss else ""
        return ""

    def _in_reach(self, sender: str, recipient: str, unreachable_links: Iterable[tuple[str, str]]) -> bool:
        ours, theirs = self._bodies.get(sender, ()), self._bodies.get(recipient, ())
        if not ours or not theirs:
            return True
        cut_pairs = {frozenset(pair) for pair in unreachable_links}
        return any(frozenset((mine, other)) not in cut_pairs for mine in ours for other in theirs)


class MessageRouter:
    """ValidateAndExpand for one instance: envelope validation and topology expansion."""

    def __init__(self, instance: Instance) -> None:
        self._instance = instance
        self._comms = instance.comms
        self._agents = {agent.id: agent for agent in instance.agents}
        self._kinds: Mapping[str, MessageSpec] = {message.kind: message for message in instance.messages}
        self._bodies = {message.kind: body_check(message) for message in instance.messages}
        self._links = _MessageLinks(instance)
        self._conditions: RadioConditions | None = None

    def expand(
        self,
        candidates: Iterable[tuple[str, Sequence[Outgoing]]],
        tick: int,
        frames: Container[str],
        tally: Tally | None = None,
        unreachable_links: Sequence[tuple[str, str]] = (),
        removed_ids: Container[str] = (),
        conditions: RadioConditions | None = None,
    ) -> tuple[tuple[Envelope, ...], tuple[Receipt, ...]]:
        """Return admitted edges [M̂] and bus receipts [C^M] of the candidates, in policy order.

        `frames` are the ids of the pictures taken so far, the only ones that a report may cite. `tally` counts admitted
        messages. `unreachable_links` are the pairs of entities that radio does not connect. `removed_ids` are ids that
        are skipped: those of messages that a branch removed, so that the other messages keep their ids and the losses
        derived from them. `conditions` are those of the radio, if events change it.
        """
        self._conditions = conditions
        edges: list[Envelope] = []
        receipts: list[Receipt] = []
        sent = [(sender, place, message) for sender, each in candidates for place, message in enumerate(each)]
        ids = (request_id("message", tick, number) for number in count(1))
        free = (name for name in ids if name not in removed_ids)
        for name, (sender, place, message) in zip(free, sent, strict=False):
            candidate = _Candidate(name, tick, sender, message, place)
            new, receipt = self._counted(candidate, frames, unreachable_links, tally)
            edges.extend(new)
            receipts.append(receipt)
        return tuple(edges), tuple(receipts)

    def _counted(
        self,
        candidate: _Candidate,
        frames: Container[str],
        unreachable_links: Sequence[tuple[str, str]],
        tally: Tally | None,
    ) -> tuple[tuple[Envelope, ...], Receipt]:
        """Return the envelopes and the receipt of `_expanded`; a used-up budget or allowance rejects the message."""
        edges, receipt = self._expanded(candidate, frames, unreachable_links)
        if tally is None or receipt.status != "accepted":
            return edges, receipt
        reason, detail = tally.message(candidate.sender, candidate.message.kind)
        if reason:
            return (), self._receipt(candidate, "rejected", reason, detail)
        tally.count_message(candidate.sender, candidate.message.kind)
        return edges, receipt

    def _expanded(
        self, candidate: _Candidate, frames: Container[str], unreachable_links: Sequence[tuple[str, str]]
    ) -> tuple[tuple[Envelope, ...], Receipt]:
        reason, detail = self._fault(candidate, frames)
        if reason:
            return (), self._receipt(candidate, "rejected", reason, detail)
        spec = self._kinds[candidate.message.kind]
        deliver_at = candidate.tick + self._comms.delay_ticks - 1
        recipients, reason, detail = self._recipients(self._agents[candidate.sender], candidate.message)
        if not reason and candidate.tick <= self._instance.budget.ticks < deliver_at:
            recipients, reason, detail = (), "expired", "the episode ends before it could be read"
        reached, cuts = self._over_links(candidate, recipients, unreachable_links)
        if recipients and not reached:
            reason, detail = cuts
        if reason in ("out_of_range", "lost") and spec.category == "report":
            return (), self._receipt(candidate, "accepted", reason, f"adjudicated; {detail}")
        if reason in ("no_recipient", "expired") and spec.category == "report":
            return (), self._receipt(candidate, "accepted", "", f"adjudicated; {detail}")
        if reason:
            return (), self._receipt(candidate, "rejected", reason, detail)
        size = len(msgspec.json.encode(candidate.message.body))
        edges = tuple(
            Envelope(
                id=candidate.id,
                tick=candidate.tick,
                sender=candidate.sender,
                recipient=recipient,
                kind=candidate.message.kind,
                category=spec.category,
                body=candidate.message.body,
                bytes=size,
                deliver_at=deliver_at,
            )
            for recipient in reached
        )
        detail = "; ".join(part for part in (", ".join(reached), cuts[1]) if part)
        return edges, self._receipt(candidate, "accepted", cuts[0], detail)

    def _over_links(
        self, candidate: _Candidate, recipients: Sequence[str], unreachable_links: Sequence[tuple[str, str]]
    ) -> tuple[tuple[str, ...], tuple[str, str]]:
        """Return the recipients that the message reaches, with reason code and description of the losses (empty without
        losses).
        """
        fates = {
            recipient: self._links.loss_reason(
                candidate.id, candidate.sender, recipient, unreachable_links, self._conditions
            )
            for recipient in recipients
        }
        reached = tuple(recipient for recipient in recipients if not fates[recipient])
        parts = [
            (reason, ", ".join(recipient for recipient in recipients if fates[recipient] == reason))
            for reason in ("out_of_range", "lost")
            if reason in fates.values()
        ]
        words = {"out_of_range": "out of range", "lost": "lost on the way to"}
        return reached, (
            parts[0][0] if parts else "",
            "; ".join(f"{words[reason]}: {names}" for reason, names in parts),
        )

    def _fault(self, candidate: _Candidate, frames: Container[str]) -> tuple[str, str]:
        """Return the reason code and description of an envelope's fault, or two empty strings."""
        sender, message = candidate.sender, candidate.message
        agent, spec = self._agents.get(sender), self._kinds.get(message.kind)
        if agent is None:
            return "unknown_agent", f"`{sender}` is not active in this episode"
        if candidate.place >= MESSAGES_PER_CALL:
            return "too_many", f"at most {MESSAGES_PER_CALL} messages a call"
        if spec is None:
            return "unknown_kind", f"`{message.kind}` is not declared; open: {', '.join(self._kinds) or 'none'}"
        if not spec.is_sent_by(agent.role):
            return "no_authority", f"role `{agent.role}` may not send `{message.kind}`"
        size = len(msgspec.json.encode(message.body))
        if size > self._comms.payload_bytes:
            return "payload", f"{size} bytes, at most {self._comms.payload_bytes}"
        detail = self._bodies[message.kind].fault(message.body, frames)
        return ("bad_field", detail) if detail else ("", "")

    def _recipients(self, agent: AgentSpec, message: Outgoing) -> tuple[tuple[str, ...], str, str]:
        others = tuple(name for name in self._agents if name != agent.id)
        if self._comms.mode == "broadcast":
            return (others, "", "") if others else ((), "no_recipient", "no other agent is active")
        hub = self._comms.hub
        if hub is None or agent.id != hub:
            return ((hub,), "", "") if hub in self._agents else ((), "no_recipient", "no hub is active")
        return self._from_hub(others, message)

    def _from_hub(self, others: tuple[str, ...], message: Outgoing) -> tuple[tuple[str, ...], str, str]:
        spec = self._kinds[message.kind]
        allowed = tuple(name for name in others if spec.is_for(self._agents[name].role))
        unknown = [name for name in message.to if name not in allowed]
        if unknown:
            return (), "bad_recipient", f"`{unknown[0]}` cannot receive `{message.kind}`; open: {', '.join(allowed)}"
        chosen = tuple(name for name in allowed if name in message.to) if message.to else allowed
        return (chosen, "", "") if chosen else ((), "no_recipient", f"nobody may receive `{message.kind}`")

    def _receipt(
        self, candidate: _Candidate, status: Literal["accepted", "rejected"], reason: str, detail: str
    ) -> Receipt:
        return Receipt(
            request=candidate.id,
            tick=candidate.tick,
            sender=candidate.sender,
            resource=candidate.message.kind,
            status=status,
            reason=reason,
            detail=detail,
            by="bus",
            time_s=(candidate.tick - 1) * self._instance.clock.tick_s,
        )
