"""Digests for the comparison of episodes: chains over boundaries and over pictures, and one hash per policy input.

`next_digest` covers decisions, states, receipts, messages and events in the form of `lingjing.trace.digest_form`. That
form leaves out wall-clock values, pixels, free text and derived values. `Header.digest_version` names its version. A
trace of version 1 is verified in its own version and compared with new records in the current one
(`current_digests`). `next_frames_digest` covers the pixels. Both chains start from `START`.
"""

from __future__ import annotations

import hashlib
from collections import deque
from collections.abc import Iterable, Iterator, Sequence
from typing import TYPE_CHECKING

import msgspec

from lingjing.trace.digest_form import current_form, first_form
from lingjing.trace.encoding import normalise, to_json
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
"""The first value of both chains."""


_FIRST, _CURRENT = msgspec.json.Encoder(), msgspec.json.Encoder(order="deterministic")
"""Version 1 keeps the order of fields and mappings. The mappings of a normalised record are sorted already."""


def next_digest(previous: str, record: BoundaryRecord, version: DigestVersion = DIGEST_VERSION) -> str:
    """Return the SHA-256 (hex) over the previous digest and this record in the form of `version`.

    Raises `InfrastructureError` if the record holds a number that is not finite.
    """
    plain = normalise(record)
    encoded = _FIRST.encode(first_form(plain)) if version == 1 else _CURRENT.encode(current_form(plain))
    return hashlib.sha256(previous.encode() + b"\n" + encoded).hexdigest()


def digest_chain(records: Iterable[BoundaryRecord], version: DigestVersion) -> Iterator[str]:
    """Yield the digest of each boundary from 0 on, computed from the records."""
    digest = START
    for record in records:
        digest = next_digest(digest, record, version)
        yield digest


def current_digests(trace: Trace) -> tuple[str, ...]:
    """Return the digest of each boundary in the current version: stored, or computed for an older trace.

    A replay has digests of the current version, whatever the version of its trace.
    """
    if trace.header.digest_version == DIGEST_VERSION:
        return tuple(record.digest for record in trace.boundaries)
    return tuple(digest_chain(trace.boundaries, DIGEST_VERSION))


def last_digest(trace: Trace, version: DigestVersion) -> str:
    """Return the digest of the last boundary in `version`, or `START` if there is no boundary."""
    if trace.header.digest_version == version:
        return trace.boundaries[-1].digest if trace.boundaries else START
    return deque(digest_chain(trace.boundaries, version), maxlen=1)[0] if trace.boundaries else START


def next_frames_digest(previous: str, frames: Iterable[FrameInfo]) -> str:
    """Return the SHA-256 (hex) over the previous digest and each picture's id and hashes.

    Returns `previous` if there are no pictures.
    """
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
    """Return the SHA-256 (hex) of one complete policy input, for `ObservationRecord.sha256`.

    `pictures` are the observation's frames. Their ids, poses, times and channel hashes are covered. Their ground truth
    is not, because policies do not receive it.
    """
    total = hashlib.sha256(to_json(normalise(msgspec.structs.replace(observation, sha256=""))))
    for record in (*messages, *receipts, *(msgspec.structs.replace(frame, boxes=(), faint=()) for frame in pictures)):
        total.update(b"\n" + to_json(normalise(record)))
    return total.hexdigest()


def verify(trace: Trace, *, pixels: bool = False) -> str | None:
    """Return None if the records of a trace are consistent, else one sentence that names the first inconsistent one.

    Every digest must match its record, and the outcome must match the last boundary. With `pixels`, every stored JPEG
    must match its hash. Depth and class ids cannot be checked: their hash covers the depth before rounding.
    """
    return _chain_fault(trace) or _outcome_fault(trace) or (_pixel_fault(trace) if pixels else None)


def _chain_fault(trace: Trace) -> str | None:
    digests = digest_chain(trace.boundaries, trace.header.digest_version)
    for place, (record, digest) in enumerate(zip(trace.boundaries, digests, strict=True)):
        if record.tick != place:
            return f"boundary {record.tick} is in the place of boundary {place}"
        if digest != record.digest:
            return f"boundary {record.tick} does not match its digest, or the digest of the boundary before it"
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
    """Return the first contradiction between the outcome and the last boundary, or None."""
    claims = (
        ("ticks", outcome.ticks, last.tick),
        ("score", outcome.score, last.reward),
        ("subtask completion rate", outcome.scr, last.scr),
        ("success", outcome.success, outcome.reason == "success"),
    )
    for name, claimed, recorded in claims:
        if claimed != recorded:
            return f"the outcome's {name} is {claimed}, that of the last boundary {recorded}"
    if outcome.reason not in CUT_SHORT and last.done != (outcome.reason != "budget"):
        ended = "had ended" if last.done else "was not over"
        return f"the outcome's reason is `{outcome.reason}`, but at the last boundary the episode {ended}"
    return None


def _pixel_fault(trace: Trace) -> str | None:
    for record in trace.boundaries:
        for frame in record.frames:
            if hashlib.sha256(trace.jpeg(frame.id)).hexdigest() != frame.sha256:
                return f"the picture {frame.id} does not match its hash"
    return None
