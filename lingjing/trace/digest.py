"""What two episodes are compared by: a hash chain over boundaries, one over pictures, one value per policy input.

`next_digest` covers decisions, states, receipts, messages and events, but no wall clock, no pixels and nothing that is
derived from the rest: fields whose name ends in `_wall_s`, `wall_s`, `digest` itself, what `FrameInfo` says of pixels
and renderer, `ObservationRecord.sha256` and the occurrences of coordination relations are blanked.
`next_frames_digest` covers the pixels. Both chains start from `START`.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import msgspec

from lingjing.trace.encoding import settled, to_json
from lingjing.trace.records import CUT_SHORT, BoundaryRecord, Envelope, FrameInfo, ObservationRecord, Outcome, Receipt

if TYPE_CHECKING:
    from lingjing.trace.reader import Trace

START = ""
"""What both chains start from."""


def next_digest(previous: str, record: BoundaryRecord) -> str:
    """SHA-256 (hex) over the digest before and this record without wall clock, pixels and relations.

    Raises `InfrastructureError` if the record holds a number that is not finite.
    """
    return hashlib.sha256(previous.encode() + b"\n" + to_json(timeless(settled(record)))).hexdigest()


def next_frames_digest(previous: str, frames: Iterable[FrameInfo]) -> str:
    """SHA-256 (hex) over the digest before and each picture's id and hash; unchanged if there are none."""
    for frame in frames:
        pixels = f"{frame.sha256}\n{frame.channels_sha256}"
        previous = hashlib.sha256(f"{previous}\n{frame.id}\n{pixels}".encode()).hexdigest()
    return previous


def input_digest(
    observation: ObservationRecord,
    messages: Sequence[Envelope] = (),
    receipts: Sequence[Receipt] = (),
    pictures: Sequence[FrameInfo] = (),
) -> str:
    """SHA-256 (hex) of one complete policy input, for `ObservationRecord.sha256`.

    `pictures` are the observation's frames: their id, pose, time and the hashes of all their channels count, their
    ground truth does not.
    """
    whole = hashlib.sha256(to_json(settled(msgspec.structs.replace(observation, sha256=""))))
    for record in (*messages, *receipts, *(msgspec.structs.replace(frame, boxes=(), faint=()) for frame in pictures)):
        whole.update(b"\n" + to_json(settled(record)))
    return whole.hexdigest()


def verify(trace: Trace, *, pixels: bool = False) -> str | None:
    """None if the records of a trace agree with each other, else one sentence that names the first that does not.

    Every digest must follow from its records, the outcome from the last boundary. With `pixels` every stored JPEG is
    hashed as well; depth and class ids are not: what was hashed is the depth before it was rounded for the file.
    """
    return _chain_fault(trace) or _outcome_fault(trace) or (_pixel_fault(trace) if pixels else None)


def _chain_fault(trace: Trace) -> str | None:
    digest = START
    for place, record in enumerate(trace.boundaries):
        if record.tick != place:
            return f"boundary {place} says that it is boundary {record.tick}"
        digest = next_digest(digest, record)
        if digest != record.digest:
            return f"boundary {record.tick} does not follow from the one before: its digest is not that of its content"
    return None


def _outcome_fault(trace: Trace) -> str | None:
    if trace.outcome is None:
        return None
    last = trace.boundaries[-1].digest if trace.boundaries else START
    if trace.outcome.digest != last:
        return "the outcome's digest is not that of the last boundary"
    pixels = START
    for record in trace.boundaries:
        pixels = next_frames_digest(pixels, record.frames)
    if trace.outcome.frames_digest != pixels:
        return "the outcome's frames digest does not follow from the pictures' hashes"
    return _ending_fault(trace.outcome, trace.boundaries[-1]) if trace.boundaries else None


def _ending_fault(outcome: Outcome, last: BoundaryRecord) -> str | None:
    """What the outcome claims against the last boundary, from which it was made."""
    claims = (
        ("ticks", outcome.ticks, last.tick),
        ("score", outcome.score, last.reward),
        ("subtask completion rate", outcome.scr, last.scr),
        ("success", outcome.success, outcome.reason == "success"),
    )
    for name, claimed, found in claims:
        if claimed != found:
            return f"the outcome's {name} is {claimed}, that of the last boundary {found}"
    if outcome.reason not in CUT_SHORT and last.done != (outcome.reason != "budget"):
        ended = "had ended" if last.done else "was not over"
        return f"the outcome's reason is `{outcome.reason}`, but at the last boundary the episode {ended}"
    return None


def _pixel_fault(trace: Trace) -> str | None:
    for record in trace.boundaries:
        for frame in record.frames:
            if hashlib.sha256(trace.jpeg(frame.id)).hexdigest() != frame.sha256:
                return f"the picture {frame.id} is not the one that was hashed"
    return None


def timeless(record: BoundaryRecord) -> BoundaryRecord:
    """The record as its digest covers it: without wall clock, pixels, relations and the digest itself."""
    replace = msgspec.structs.replace
    return replace(
        record,
        engines=tuple(replace(engine, wait_wall_s=0.0) for engine in record.engines),
        frames=tuple(replace(frame, sha256="", channels_sha256="", renderer="") for frame in record.frames),
        observations=tuple(replace(seen, sha256="") for seen in record.observations),
        decisions=tuple(replace(made, policy_wall_s=0.0) for made in record.decisions),
        relations=(),
        digest="",
        wall_s=0.0,
    )
