"""The digests that episodes are compared by: a hash chain over boundaries, one over pictures, one per policy input.

`next_digest` covers decisions, states, receipts, messages and events in the form of `lingjing.trace.digest_form`: no
wall clock, no pixels, no free text, nothing that is derived from the rest. `Header.digest_version` names the form; a
trace of version 1 is verified in its own form, and compared with new records in the current one (`current_digests`).
`next_frames_digest` covers the pixels. Both chains start from `START`.
"""

from __future__ import annotations

import hashlib
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING

import msgspec

from lingjing.trace.digest_form import current_form, first_form
from lingjing.trace.encoding import settled, to_json
from lingjing.trace.records import (
    CUT_SHORT,
    DIGEST_VERSION,
    BoundaryRecord,
    DigestVersion,
    Envelope,
    FrameInfo,
    ObservationRecord,
    Outcome,
    Receipt,
)

if TYPE_CHECKING:
    from lingjing.trace.reader import Trace

START = ""
"""What both chains start from."""


_FIRST, _CURRENT = msgspec.json.Encoder(), msgspec.json.Encoder(order="deterministic")
"""Version 1 keeps the order of the fields and of mappings, which a normalised record has sorted already."""


def next_digest(previous: str, record: BoundaryRecord, version: DigestVersion = DIGEST_VERSION) -> str:
    """SHA-256 (hex) over the digest before and this record in the form of that version.

    Raises `InfrastructureError` if the record holds a number that is not finite.
    """
    plain = settled(record)
    encoded = _FIRST.encode(first_form(plain)) if version == 1 else _CURRENT.encode(current_form(plain))
    return hashlib.sha256(previous.encode() + b"\n" + encoded).hexdigest()


def digest_chain(records: Iterable[BoundaryRecord], version: DigestVersion) -> Iterator[str]:
    """The digest of each boundary from 0 on, computed from the records."""
    digest = START
    for record in records:
        digest = next_digest(digest, record, version)
        yield digest


def current_digests(trace: Trace) -> tuple[str, ...]:
    """The digest of each boundary of a trace in the current version: the stored ones, or computed for an older trace.

    What is played again has digests of the current version, whatever the version of its trace.
    """
    if trace.header.digest_version == DIGEST_VERSION:
        return tuple(record.digest for record in trace.boundaries)
    return tuple(digest_chain(trace.boundaries, DIGEST_VERSION))


def last_digest(trace: Trace, version: DigestVersion) -> str:
    """The digest of the last boundary in that version; `START` if there is none."""
    if trace.header.digest_version == version:
        return trace.boundaries[-1].digest if trace.boundaries else START
    return deque(digest_chain(trace.boundaries, version), maxlen=1)[0] if trace.boundaries else START


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
    digests = digest_chain(trace.boundaries, trace.header.digest_version)
    for place, (record, digest) in enumerate(zip(trace.boundaries, digests, strict=True)):
        if record.tick != place:
            return f"boundary {place} says that it is boundary {record.tick}"
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
