"""What agents said and the bus admitted at one boundary: one entry for each message, however many heard it, none
included.

A report is adjudicated even if nobody is there to hear it (an agent on its own, a lost radio link, the last tick):
such a message has no edge in the trace, only its sender's decision and the receipt that accepted it.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from lingjing.mission.instance import Datum, Instance
from lingjing.trace.records import BoundaryRecord


@dataclass(frozen=True, slots=True)
class AdmittedMessage:
    """An admitted message of `tick`; `category` as the mission declares its kind, `recipients` in the bus's order."""

    id: str
    tick: int
    sender: str
    kind: str
    category: str
    body: Mapping[str, Datum]
    recipients: tuple[str, ...] = ()


def categories_of(instance: Instance) -> Mapping[str, str]:
    """What each kind of message counts as."""
    return {spec.kind: spec.category for spec in instance.messages}


def admitted_at(record: BoundaryRecord, categories: Mapping[str, str]) -> tuple[AdmittedMessage, ...]:
    """The admitted messages of one boundary: those that somebody was sent, then those for nobody."""
    found: dict[str, AdmittedMessage] = {}
    for edge in record.messages:
        heard = (*(found[edge.id].recipients if edge.id in found else ()), edge.recipient)
        found[edge.id] = AdmittedMessage(edge.id, edge.tick, edge.sender, edge.kind, edge.category, edge.body, heard)
    for lone in _unheard(record, categories):
        found.setdefault(lone.id, lone)
    return tuple(found.values())


def _unheard(record: BoundaryRecord, categories: Mapping[str, str]) -> Iterator[AdmittedMessage]:
    """The boundary's accepted messages: the bus answers each candidate with one receipt, in policy order."""
    said = [(made.agent, message) for made in record.decisions for message in made.decision.messages]
    answers = [receipt for receipt in record.receipts if receipt.by == "bus"]
    for (sender, message), answer in zip(said, answers, strict=False):
        if answer.status == "accepted" and message.kind in categories:
            yield AdmittedMessage(
                answer.request, record.tick, sender, message.kind, categories[message.kind], message.body
            )
