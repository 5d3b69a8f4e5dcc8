"""The parts of a boundary record that are derived from published values."""

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
    """Return the record of one agent's observation, with picture ids and the digest of its complete policy input.

    The digest counts a picture with the pose that the agent received: the true pose of a reference picture would reveal
    the target's position. With `blank` the digest leaves out pixels.
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
    shown = [msgspec.structs.replace(frames[picture.frame], pose=picture.pose) for picture in observation.pictures]
    if blank:
        shown = [msgspec.structs.replace(frame, sha256="", channels_sha256="") for frame in shown]
    return msgspec.structs.replace(record, sha256=input_digest(record, inbox.messages, inbox.receipts, shown))


def inbox_record(agent: str, inbox: Inbox) -> InboxRecord:
    """Return the record of one agent's inbox: message ids and receipts."""
    return InboxRecord(agent=agent, messages=tuple(edge.id for edge in inbox.messages), receipts=inbox.receipts)


def substitutions(decisions: Sequence[DecisionRecord], tick: int, time_s: float) -> tuple[Receipt, ...]:
    """Return one receipt for each policy output that was replaced, addressed to the agent itself."""
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
