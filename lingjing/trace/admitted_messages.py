"""The messages that the bus admitted at one boundary, each once, whatever the number of its recipients.

A report is adjudicated even without a recipient: the agent is alone, the radio link is lost, or the tick is the last
one. Such a message has no edge in the trace. It is reconstructed from the sender's decision and the receipt.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from lingjing.mission.instance import Datum, Instance
from lingjing.trace.records import BoundaryRecord


@dataclass(frozen=True, slots=True)
class AdmittedMessage:
    """An admitted message."""

    id: str
    tick: int
    sender: str
    kind: str
    category: str
    """The category that the mission declares for `kind`."""
    body: Mapping[str, Datum]
    recipients: tuple[str, ...] = ()
    """Agent ids in the order of the bus. Empty if the message reached no agent."""


def categories_of(instance: Instance) -> Mapping[str, str]:
    """Return the declared category of each message kind."""
    return {spec.kind: spec.category for spec in instance.messages}


def admitted_at(record: BoundaryRecord, categories: Mapping[str, str]) -> tuple[AdmittedMessage, ...]:
    """Return the admitted messages of one boundary: those with recipients first, then those without."""
    messages: dict[str, AdmittedMessage] = {}
    for edge in record.messages:
        recipients = (*(messages[edge.id].recipients if edge.id in messages else ()), edge.recipient)
        messages[edge.id] = AdmittedMessage(
            edge.id, edge.tick, edge.sender, edge.kind, edge.category, edge.body, recipients
        )
    for message in _accepted(record, categories):
        messages.setdefault(message.id, message)
    return tuple(messages.values())


def _accepted(record: BoundaryRecord, categories: Mapping[str, str]) -> Iterator[AdmittedMessage]:
    """Yield all accepted messages, without recipients. The bus issues one receipt per candidate, in policy order."""
    candidates = [(entry.agent, message) for entry in record.decisions for message in entry.decision.messages]
    receipts = [receipt for receipt in record.receipts if receipt.by == "bus"]
    for (sender, message), receipt in zip(candidates, receipts, strict=False):
        if receipt.status == "accepted" and message.kind in categories:
            yield AdmittedMessage(
                receipt.request, record.tick, sender, message.kind, categories[message.kind], message.body
            )
