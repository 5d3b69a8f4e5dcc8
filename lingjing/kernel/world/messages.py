"""The messages between caller and worker: tagged requests and replies, one msgpack document each."""

from __future__ import annotations

import msgspec

from lingjing.decoding import MsgpackDecoder, msgpack_decoder
from lingjing.kernel.world.contract import WorldBoundary
from lingjing.kernel.world.engine_group import EngineReport
from lingjing.kernel.world.shared import Layout
from lingjing.mission.instance import Instance
from lingjing.mission.schedule import Occurrence
from lingjing.plugins.engine import CaptureRequest
from lingjing.trace.records import BodyState, Command, FrameInfo, Receipt


class WorkerMessage(msgspec.Struct, frozen=True, kw_only=True, tag=True, tag_field="is"):
    """Base of all requests and replies. The tag is the class name."""


class Prepare(WorkerMessage, frozen=True, kw_only=True):
    """Create new engines, with their heavy imports, and close those of the episode before."""

    engines: tuple[str, ...]
    """The names of the engines."""


class Reset(WorkerMessage, frozen=True, kw_only=True):
    """Read the data of an episode. A camera process prepares its pictures as well."""

    instance: Instance
    """The placed instance."""
    city: msgspec.Raw
    """The encoded city (`held_cities.packed`)."""
    coupled: bool = True
    """True if the worker runs whole ticks; False if the caller drives each macro-step, because it hosts engines too."""


class Begin(WorkerMessage, frozen=True, kw_only=True):
    """Reset every prepared engine to the episode of the last `Reset`: boundary 0."""


class Step(WorkerMessage, frozen=True, kw_only=True):
    """Run a whole tick."""

    tick: int
    commands: tuple[Command, ...]
    occurrences: tuple[Occurrence, ...] = ()
    """All occurrences of the mission's events so far."""


class TakeEvents(WorkerMessage, frozen=True, kw_only=True):
    """Take over the mission's events before a tick; the caller drives."""

    occurrences: tuple[Occurrence, ...]
    """All occurrences so far."""


class Submit(WorkerMessage, frozen=True, kw_only=True):
    """Submit commands without advancing; the caller drives."""

    commands: tuple[Command, ...]


class Advance(WorkerMessage, frozen=True, kw_only=True):
    """Advance one macro-step; the caller drives."""

    until: float
    """The end of the macro-step in seconds."""
    foreign: tuple[BodyState, ...]
    """The states of the entities of the caller's engines."""
    ambient: dict[str, tuple[BodyState, ...]] = {}
    """The background movers of the caller's engines, by engine."""


class Capture(WorkerMessage, frozen=True, kw_only=True):
    """Draw the pictures of one boundary. A `PictureReply` with the same `serial` answers each."""

    serial: int
    """The number of the capture."""
    time_s: float
    """Simulated time in seconds."""
    requests: tuple[CaptureRequest, ...]
    """The pictures to draw."""
    states: tuple[BodyState, ...]
    """The states of all entities, then of all background movers."""
    occurrences: tuple[Occurrence, ...] = ()
    """All occurrences of the mission's events before the boundary."""


class Fork(WorkerMessage, frozen=True, kw_only=True):
    """Fork the worker. A socket and a progress memory for the copy accompany the request."""


class Close(WorkerMessage, frozen=True, kw_only=True):
    """Close all engines and end."""


class Ready(WorkerMessage, frozen=True, kw_only=True):
    """The request is done."""

    problems: tuple[str, ...] = ()
    """Errors of engines of the episode before that failed to close."""
    runtime: dict[str, str] = {}
    """The runtime fingerprint of the process (`lingjing.numerics.runtime_fingerprint`) in the answer to a `Reset`,
    otherwise empty."""


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
    """The answer to one request of a `Capture`. A descriptor with the bytes accompanies it."""

    serial: int
    """The number of the capture."""
    index: int
    """The index of the request in the capture."""
    info: FrameInfo | None = None
    """The picture's metadata; None if the engine drew nothing."""
    layout: Layout | None = None
    """The layout of the bytes; None if the engine drew nothing."""


class Forked(WorkerMessage, frozen=True, kw_only=True):
    """The process id of the copy."""

    pid: int


class Closed(WorkerMessage, frozen=True, kw_only=True):
    """The worker is about to end."""

    problems: tuple[str, ...] = ()
    """Errors of engines that failed to close."""


class Refused(WorkerMessage, frozen=True, kw_only=True):
    """The worker rejects the request; its state is intact."""

    message: str


class Failed(WorkerMessage, frozen=True, kw_only=True):
    """The episode is broken."""

    message: str
    """The description, with engine and call."""
    hint: str = ""
    """The hint of the error; "" if it has none."""
    engine: str = ""
    """The engine that failed; "" if none did."""
    traceback: str = ""
    """The traceback, for the engine's author."""


Request = Prepare | Reset | Begin | Step | TakeEvents | Submit | Advance | Capture | Fork | Close
Reply = Ready | Stepped | Reported | Admitted | PictureReply | Forked | Closed | Refused | Failed

_ENCODER = msgspec.msgpack.Encoder()
_REQUESTS: MsgpackDecoder[Request] = msgpack_decoder(Request)
_REPLIES: MsgpackDecoder[Reply] = msgpack_decoder(Reply)


def encoded(message: WorkerMessage) -> bytes:
    """Encode a message."""
    return _ENCODER.encode(message)


def decoded_request(payload: bytes | bytearray) -> Request:
    """Decode a request of the caller."""
    return _REQUESTS.decode(payload)


def decoded_reply(payload: bytes | bytearray) -> Reply:
    """Decode a reply of a worker."""
    return _REPLIES.decode(payload)
