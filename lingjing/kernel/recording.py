"""The parts of a boundary record that are derived from what was published."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import msgspec

from lingjing.plugins.policy import Inbox, Observation
from lingjing.trace.digest import input_digest
from lingjing.trace.records import DecisionRecord, FrameInfo, InboxRecord, ObservationRecord, Receipt
from lingjing.trace.request_ids import request_id


def observation_record(
    observation: Observation, inbox: Inbox, frames: Mapping[str, FrameInfo], *, blank: bool = False
) -> ObservationRecord:
    """What one agent saw, pictures by id, with the digest of its complete policy input (without pixels if `blank`).

    A picture counts with the pose that the agent was told: a reference picture's true one would tell where it hides.
    """
    record = ObservationRecord(
        agent=observation.agent,
        entities=observation.entities,
        cells=observation.cells,
        events=observation.events,
        frames=tuple(picture.frame for picture in observation.pictures),
        absent=observation.absent,
        privileged=observation.privileged is not None,
        weather=observation.weather,
    )
    shown = [msgspec.structs.replace(frames[one.frame], pose=one.pose) for one in observation.pictures]
    if blank:
        shown = [msgspec.structs.replace(frame, sha256="", channels_sha256="") for frame in shown]
    return msgspec.structs.replace(record, sha256=input_digest(record, inbox.messages, inbox.receipts, shown))


def inbox_record(agent: str, inbox: Inbox) -> InboxRecord:
    """What one agent's inbox held: message ids and receipts."""
    return InboxRecord(agent=agent, messages=tuple(edge.id for edge in inbox.messages), receipts=inbox.receipts)


def substitutions(decisions: Sequence[DecisionRecord], tick: int, time_s: float) -> tuple[Receipt, ...]:
    """One receipt for each policy output that had to be replaced, addressed to the agent itself."""
    return tuple(
        Receipt(
            request=request_id("policy answer", tick, made.agent),
            tick=tick,
            sender=made.agent,
            resource="",
            status="substituted",
            reason=made.substituted,
            detail=made.detail,
            by="policy",
            time_s=time_s,
        )
        for made in decisions
        if made.substituted
    )
