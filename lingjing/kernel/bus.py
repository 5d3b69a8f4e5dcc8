"""The message bus B: validate candidate messages, expand them to edges, stage, commit, deliver.

Star: an agent's message goes to the hub; the hub's goes to the recipients it names, or to all that the message kind
declares. Broadcast: to all other active agents. Nothing is relayed by itself. With a delay of one tick, what is
produced on boundary t is staged for t+1 and readable there. An edge is fixed at validation and delivered only after
the engine barrier has committed the boundary. What nobody could read any more is refused as `expired`. A report is
for the adjudicator first: it is accepted also when nobody else can read it. What a link does not carry (out of range,
lost) is no edge; the sender's receipt says so, and a message of which nothing gets through is refused.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping, Sequence
from itertools import count
from typing import Literal, NamedTuple

import msgspec
from msgspec.structs import replace

from lingjing.kernel.admission import body_check
from lingjing.kernel.budgets import Tally
from lingjing.kernel.links import MessageLinks
from lingjing.mission.instance import AgentSpec, Instance, MessageSpec
from lingjing.plugins.decisions import MESSAGES_PER_CALL
from lingjing.trace.records import Envelope, Outgoing, Receipt
from lingjing.trace.request_ids import request_id


class Bus(msgspec.Struct, frozen=True):
    """Edges on their way: `staged` wait for the barrier, `committed` for their delivery tick."""

    staged: tuple[Envelope, ...] = ()
    committed: tuple[Envelope, ...] = ()

    def stage(self, envelopes: Sequence[Envelope]) -> Bus:
        """Buffer admitted edges until the boundary commits."""
        return replace(self, staged=self.staged + tuple(envelopes))

    def commit(self) -> Bus:
        """Mark every staged edge deliverable, atomically."""
        return Bus(committed=self.committed + self.staged)

    def deliver(self, tick: int) -> tuple[Bus, tuple[Envelope, ...]]:
        """Take out what is readable at `tick`, in the order it was admitted."""
        due = tuple(envelope for envelope in self.committed if envelope.deliver_at <= tick)
        return replace(self, committed=tuple(e for e in self.committed if e.deliver_at > tick)), due


class _Candidate(NamedTuple):
    """A message that a policy sent, and its place among those of the call."""

    id: str
    tick: int
    sender: str
    message: Outgoing
    place: int


class MessageRouter:
    """ValidateAndExpand for one instance: envelope validation and topology expansion."""

    def __init__(self, instance: Instance) -> None:
        self._instance = instance
        self._comms = instance.comms
        self._agents = {agent.id: agent for agent in instance.agents}
        self._kinds: Mapping[str, MessageSpec] = {message.kind: message for message in instance.messages}
        self._bodies = {message.kind: body_check(message) for message in instance.messages}
        self._links = MessageLinks(instance)

    def expand(
        self,
        candidates: Iterable[tuple[str, Sequence[Outgoing]]],
        tick: int,
        frames: Container[str],
        tally: Tally | None = None,
        unheard: Sequence[tuple[str, str]] = (),
        unsaid: Container[str] = (),
    ) -> tuple[tuple[Envelope, ...], tuple[Receipt, ...]]:
        """Admitted edges [M̂] and bus receipts [C^M] of the candidates, in policy order. `frames` are the ids of the
        pictures taken so far: a report may only speak of one of them. `tally` counts what is admitted.
        `unheard` are the pairs of entities that radio does not reach between. Ids that are `unsaid` are nobody's: those
        of messages that were taken out before, so that the others keep their own, and the losses that go by them."""
        edges: list[Envelope] = []
        receipts: list[Receipt] = []
        sent = [(sender, place, message) for sender, each in candidates for place, message in enumerate(each)]
        ids = (request_id("message", tick, number) for number in count(1))
        free = (name for name in ids if name not in unsaid)
        for name, (sender, place, message) in zip(free, sent, strict=False):
            candidate = _Candidate(name, tick, sender, message, place)
            new, receipt = self._counted(candidate, frames, unheard, tally)
            edges.extend(new)
            receipts.append(receipt)
        return tuple(edges), tuple(receipts)

    def _counted(
        self, one: _Candidate, frames: Container[str], unheard: Sequence[tuple[str, str]], tally: Tally | None
    ) -> tuple[tuple[Envelope, ...], Receipt]:
        """As `_expanded`, within the counted budgets and allowances."""
        edges, receipt = self._expanded(one, frames, unheard)
        if tally is None or receipt.status != "accepted":
            return edges, receipt
        reason, detail = tally.message(one.sender, one.message.kind)
        if reason:
            return (), self._receipt(one, "rejected", reason, detail)
        tally.take_message(one.sender, one.message.kind)
        return edges, receipt

    def _expanded(
        self, one: _Candidate, frames: Container[str], unheard: Sequence[tuple[str, str]]
    ) -> tuple[tuple[Envelope, ...], Receipt]:
        reason, detail = self._fault(one, frames)
        if reason:
            return (), self._receipt(one, "rejected", reason, detail)
        spec = self._kinds[one.message.kind]
        deliver_at = one.tick + self._comms.delay_ticks - 1
        recipients, reason, detail = self._recipients(self._agents[one.sender], one.message)
        if not reason and one.tick <= self._instance.budget.ticks < deliver_at:
            recipients, reason, detail = (), "expired", "the episode ends before it could be read"
        heard, cuts = self._over_links(one, recipients, unheard)
        if recipients and not heard:
            reason, detail = cuts
        if reason in ("out_of_range", "lost") and spec.category == "report":
            return (), self._receipt(one, "accepted", reason, f"adjudicated; {detail}")
        if reason in ("no_recipient", "expired") and spec.category == "report":
            return (), self._receipt(one, "accepted", "", f"adjudicated; {detail}")
        if reason:
            return (), self._receipt(one, "rejected", reason, detail)
        size = len(msgspec.json.encode(one.message.body))
        edges = tuple(
            Envelope(
                id=one.id,
                tick=one.tick,
                sender=one.sender,
                recipient=recipient,
                kind=one.message.kind,
                category=spec.category,
                body=one.message.body,
                bytes=size,
                deliver_at=deliver_at,
            )
            for recipient in heard
        )
        detail = "; ".join(part for part in (", ".join(heard), cuts[1]) if part)
        return edges, self._receipt(one, "accepted", cuts[0], detail)

    def _over_links(
        self, one: _Candidate, recipients: Sequence[str], unheard: Sequence[tuple[str, str]]
    ) -> tuple[tuple[str, ...], tuple[str, str]]:
        """Who hears the message, and the reason code and detail for those who do not, or two empty strings."""
        fates = {recipient: self._links.cut(one.id, one.sender, recipient, unheard) for recipient in recipients}
        heard = tuple(recipient for recipient in recipients if not fates[recipient])
        parts = [
            (reason, ", ".join(recipient for recipient in recipients if fates[recipient] == reason))
            for reason in ("out_of_range", "lost")
            if reason in fates.values()
        ]
        words = {"out_of_range": "out of range", "lost": "lost on the way to"}
        return heard, (parts[0][0] if parts else "", "; ".join(f"{words[reason]}: {who}" for reason, who in parts))

    def _fault(self, one: _Candidate, frames: Container[str]) -> tuple[str, str]:
        """The reason code and detail of an envelope that must be refused, or two empty strings."""
        sender, message = one.sender, one.message
        agent, spec = self._agents.get(sender), self._kinds.get(message.kind)
        if agent is None:
            return "unknown_agent", f"`{sender}` is not active in this episode"
        if one.place >= MESSAGES_PER_CALL:
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

    def _receipt(self, one: _Candidate, status: Literal["accepted", "rejected"], reason: str, detail: str) -> Receipt:
        return Receipt(
            request=one.id,
            tick=one.tick,
            sender=one.sender,
            resource=one.message.kind,
            status=status,
            reason=reason,
            detail=detail,
            by="bus",
            time_s=(one.tick - 1) * self._instance.clock.tick_s,
        )
