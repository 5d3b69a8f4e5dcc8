"""What caller and worker say to each other: tagged requests and replies, one msgpack document each."""

from __future__ import annotations

import msgspec

from lingjing.kernel.world.contract import WorldBoundary
from lingjing.kernel.world.engine_group import EngineReport
from lingjing.kernel.world.shared import Layout
from lingjing.mission.instance import Instance
from lingjing.plugins.engine import CaptureRequest
from lingjing.trace.records import BodyState, Command, FrameInfo, Receipt


class WorkerMessage(msgspec.Struct, frozen=True, kw_only=True, tag=True, tag_field="is"):
    """Base of all requests and replies; the tag is the class name."""


class Prepare(WorkerMessage, frozen=True, kw_only=True):
    """Create fresh engines of these names (heavy imports happen now) and close those of the episode before."""

    engines: tuple[str, ...]


class Reset(WorkerMessage, frozen=True, kw_only=True):
    """Take in what an episode is played on. `coupled`: the worker conducts whole ticks; otherwise the caller drives
    each macro-step because it hosts other engines of the episode. A camera makes its pictures ready as well."""

    instance: Instance
    city: msgspec.Raw
    coupled: bool = True


class Begin(WorkerMessage, frozen=True, kw_only=True):
    """Reset every prepared engine to the episode of the last `Reset`: boundary 0."""


class Step(WorkerMessage, frozen=True, kw_only=True):
    """A whole tick."""

    tick: int
    commands: tuple[Command, ...]


class Submit(WorkerMessage, frozen=True, kw_only=True):
    """Admission alone, when the caller drives."""

    commands: tuple[Command, ...]


class Advance(WorkerMessage, frozen=True, kw_only=True):
    """One macro-step, when the caller drives; `foreign` are the states of its own engines' entities, `ambient` those
    of their background movers by engine."""

    until: float
    foreign: tuple[BodyState, ...]
    ambient: dict[str, tuple[BodyState, ...]] = {}


class Capture(WorkerMessage, frozen=True, kw_only=True):
    """Pictures of one boundary; each is answered by a `PictureReply` of the same `serial`."""

    serial: int
    time_s: float
    requests: tuple[CaptureRequest, ...]
    states: tuple[BodyState, ...]


class Fork(WorkerMessage, frozen=True, kw_only=True):
    """Copy yourself; with it come a socket and a progress memory for the copy."""


class Close(WorkerMessage, frozen=True, kw_only=True):
    """Close all engines and end."""


class Ready(WorkerMessage, frozen=True, kw_only=True):
    """Done. `problems` are engines of the episode before that failed to close; after a `Reset`, `taken` is what the
    process runs (`lingjing.numerics.runtime_fingerprint`)."""

    problems: tuple[str, ...] = ()
    taken: dict[str, str] = {}


class Stepped(WorkerMessage, frozen=True, kw_only=True):
    """The boundary that was reached."""

    boundary: WorldBoundary


class Reported(WorkerMessage, frozen=True, kw_only=True):
    """The boundaries of the worker's engines, when the caller drives."""

    reports: tuple[EngineReport, ...]


class Admitted(WorkerMessage, frozen=True, kw_only=True):
    """Admission receipts by command id."""

    receipts: dict[str, Receipt]


class PictureReply(WorkerMessage, frozen=True, kw_only=True):
    """The answer to request `index` of a `Capture`: a descriptor with the bytes comes along, or `info` is None."""

    serial: int
    index: int
    info: FrameInfo | None = None
    layout: Layout | None = None


class Forked(WorkerMessage, frozen=True, kw_only=True):
    """The process id of the copy."""

    pid: int


class Closed(WorkerMessage, frozen=True, kw_only=True):
    """The worker is about to end; `problems` are engines that failed to close."""

    problems: tuple[str, ...] = ()


class Refused(WorkerMessage, frozen=True, kw_only=True):
    """The request cannot be met, and nothing is broken."""

    message: str


class Failed(WorkerMessage, frozen=True, kw_only=True):
    """The episode is broken. `message` names engine and call; `traceback` is for who wrote the engine."""

    message: str
    hint: str = ""
    traceback: str = ""


Request = Prepare | Reset | Begin | Step | Submit | Advance | Capture | Fork | Close
Reply = Ready | Stepped | Reported | Admitted | PictureReply | Forked | Closed | Refused | Failed

_ENCODER = msgspec.msgpack.Encoder()
_REQUESTS: msgspec.msgpack.Decoder[Request] = msgspec.msgpack.Decoder(Request)
_REPLIES: msgspec.msgpack.Decoder[Reply] = msgspec.msgpack.Decoder(Reply)


def encoded(message: WorkerMessage) -> bytes:
    """The message as it travels."""
    return _ENCODER.encode(message)


def decoded_request(payload: bytes | bytearray) -> Request:
    """What the caller asked."""
    return _REQUESTS.decode(payload)


def decoded_reply(payload: bytes | bytearray) -> Reply:
    """What the worker answered."""
    return _REPLIES.decode(payload)
