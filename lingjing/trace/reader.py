"""Reading of a trace: the records of one episode, and its pictures on demand.

A file that was cut or damaged is read as a prefix: the header, the boundaries before the damage, and no outcome.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any, Literal, TypeVar, get_args, overload

import msgspec
import numpy as np
import numpy.typing as npt

from lingjing.articles import with_article
from lingjing.collector import collector_at_rest
from lingjing.decoding import from_json
from lingjing.errors import UsageError
from lingjing.mission.clock import clock_fault
from lingjing.suggest import nearest_or
from lingjing.trace import images
from lingjing.trace.chunks import BROKEN
from lingjing.trace.container import StoredMessage, chunk_messages, ends_properly, scan
from lingjing.trace.records import (
    CUT_SHORT,
    DIGEST_VERSION,
    FORMAT,
    BoundaryRecord,
    DigestVersion,
    EngineFrame,
    FrameInfo,
    Header,
    Outcome,
)
from lingjing.trace.tables import (
    BodyRow,
    CommandRow,
    DecisionRow,
    EventRow,
    FrameLibrary,
    MessageRow,
    PictureRow,
    ReceiptRow,
    TableName,
    TickRow,
    data_frame,
    table_rows,
)
from lingjing.trace.topics import (
    BOUNDARY,
    CAMERAS,
    CHANNELS,
    ENGINE_FRAME,
    FRAME,
    HEADER,
    OUTCOME,
    RECORDS,
    camera_topic,
)

TOPICS_READ = (CAMERAS, RECORDS)
"""Prefixes of the topics that are read. The messages on other topics are derived from these."""

RECORD_RATIO = 200
RECORD_BYTES = 2**24
"""Limit of the JSON of all records in a file: `RECORD_BYTES` plus `RECORD_RATIO` times the size of the file. Chosen, to
bound the memory that an untrusted file can use."""

SHOWN_PICTURES = 3
"""Number of camera pictures that a notebook shows of a trace (chosen)."""

RecordT = TypeVar("RecordT", bound=msgspec.Struct)


@dataclass(frozen=True, slots=True)
class StoredPicture:
    """A decoded stored picture. See `lingjing.plugins.policy.Picture` for shapes and units."""

    info: FrameInfo
    """Id, entity, camera, tick, pose and boxes."""
    rgb: npt.NDArray[np.uint8]
    """Colours, height × width × 3."""
    depth: npt.NDArray[np.float32] | None = None
    """Distances along the optical axis, height × width, metres; None if the camera stores none."""
    semantic: npt.NDArray[np.uint8] | None = None
    """Class ids, height × width; None if the camera stores none."""
    instance: npt.NDArray[np.uint16] | None = None
    """Numbers of entities, height × width; None if the camera stores none."""


@dataclass(frozen=True, slots=True)
class ChannelLocation:
    """The place of one channel of a picture in the file.

    The MCAP channel and the log time identify a message, because a camera takes one picture at a time.
    """

    channel: int
    """Number of the MCAP channel."""
    time_ns: int
    """Log time in nanoseconds."""
    chunk_at: int
    """Byte offset of the chunk."""


@dataclass(frozen=True, repr=False)
class Trace:
    """The records of one episode: what `lingjing.read` returns.

    >>> trace = lingjing.read("runs/first/trace.mcap")
    >>> trace.header.instance.mission, trace.complete
    ('first', True)
    >>> next((row.tick, row.z_m) for row in trace.rows("bodies") if row.entity == "uav[1]")
    (0, 1.075)
    >>> list(trace.to_frame("ticks", "pandas")["tick"][:3])  # needs pandas
    [0, 1, 2]
    >>> {picture.rgb.shape for picture in trace.pictures(camera="nadir")}
    {(720, 1280, 3)}
    """

    path: Path
    header: Header = field(repr=False)
    boundaries: tuple[BoundaryRecord, ...] = field(repr=False)
    """All boundaries of a complete trace, else those before the place where the file was cut."""
    outcome: Outcome | None
    """The outcome; None if the end of the episode was not recorded."""
    complete: bool
    """True if the episode ended by itself and its file is whole."""
    places: Mapping[str, Mapping[str, ChannelLocation]] = field(repr=False, default_factory=dict)
    """The places of stored pictures, by picture id, then by topic."""
    engine_frames: tuple[EngineFrame, ...] = field(repr=False, default=())
    """The frames of foreign engines' sessions, in order; () without such engines."""

    def __repr__(self) -> str:
        """One line."""
        instance, reason = self.header.instance, "no outcome" if self.outcome is None else self.outcome.reason
        held = f"{len(self.boundaries)} boundaries, {len(self.frames)} pictures"
        return f"<Trace {instance.mission}-{instance.mode} seed {instance.seed}: {reason}, {held}, {self.path}>"

    def _repr_html_(self) -> str:
        """Return the content of the trace as a table, the overview picture and three camera pictures, for notebooks."""
        from lingjing.notebook_tables import html_table, thumbnail

        overview, problem = self._overview
        chosen = _spread(list(self.frames), SHOWN_PICTURES)
        instance, outcome = self.header.instance, self.outcome
        values = {
            "policies": ", ".join(f"{binding.agent}: {binding.policy}" for binding in self.header.bindings),
            "complete": self.complete,
            "reason": "no outcome" if outcome is None else outcome.reason,
            "score": "N/A" if outcome is None else f"{outcome.score:g}",
            "boundaries": len(self.boundaries),
            "pictures": len(self.frames),
            "file": self.path,
        }
        title = f"{instance.mission}-{instance.mode}, seed {instance.seed}"
        small = [thumbnail(self.jpeg(name)) for name in chosen]
        return html_table(title, values | ({"overview": problem} if problem else {}), overview, small)

    def _repr_png_(self) -> bytes | None:
        """Return the overview picture, that of the folder or a new one; None if it cannot be drawn."""
        return self._overview[0]

    @cached_property
    def _overview(self) -> tuple[bytes | None, str]:
        """The overview picture, or the reason why there is none."""
        from lingjing.notebook_tables import bytes_of, drawn_by

        stored = bytes_of(self.path.with_name("overview.png"))
        return (stored, "") if stored is not None else drawn_by("lingjing.analysis.overview:overview_png", self)

    @cached_property
    def frames(self) -> dict[str, FrameInfo]:
        """All pictures of the complete boundaries by id, in the order of capture."""
        return {frame.id: frame for record in self.boundaries for frame in record.frames}

    def jpeg(self, frame_id: str) -> bytes:
        """Return the stored JPEG. Raises `UsageError` if there is no such picture."""
        from lingjing.trace.foxglove import image_bytes

        message = self.stored(frame_id, "")
        if message is None:
            raise UsageError(f"the picture {frame_id} is missing in {self.path}")
        return image_bytes(message)

    def picture(self, frame_id: str) -> StoredPicture:
        """Decode a picture. Raises `UsageError` if there is no such picture, `LingjingError` if it is broken."""
        from lingjing.trace.foxglove import image_bytes, raw_bytes

        info = self._info(frame_id)
        depth, semantic = self._message(info, "depth"), self._message(info, "semantic")
        instance = self._message(info, "instance")
        return StoredPicture(
            info=info,
            rgb=images.decode_jpeg(self.jpeg(frame_id)),
            depth=None if depth is None else images.decode_depth(*raw_bytes(depth)),
            semantic=None if semantic is None else images.decode_semantic(image_bytes(semantic)),
            instance=None if instance is None else images.decode_instances(*raw_bytes(instance)),
        )

    def pictures(self, *, entity: str | None = None, camera: str | None = None) -> Iterator[StoredPicture]:
        """Yield the decoded pictures in the order of capture, of one entity or camera if it is named.

        Raises `UsageError` for an entity or a camera that has none in this trace, `LingjingError` if one is broken.
        """
        for value, known, what in (
            (entity, [info.entity for info in self.frames.values()], "entity"),
            (camera, [info.camera for info in self.frames.values()], "camera"),
        ):
            if value is not None and value not in known:
                there = ", ".join(dict.fromkeys(known)) or "none"
                hint = nearest_or(value, known, f"with pictures: {there}")
                raise UsageError(f"{self.path} holds no picture of the {what} `{value}`", hint=hint)
        chosen = [
            info.id for info in self.frames.values() if entity in (None, info.entity) and camera in (None, info.camera)
        ]
        return map(self.picture, chosen)  # decoded one by one: all at once may not fit into the memory

    @overload
    def rows(self, table: Literal["ticks"] = "ticks") -> list[TickRow]: ...
    @overload
    def rows(self, table: Literal["bodies"]) -> list[BodyRow]: ...
    @overload
    def rows(self, table: Literal["decisions"]) -> list[DecisionRow]: ...
    @overload
    def rows(self, table: Literal["commands"]) -> list[CommandRow]: ...
    @overload
    def rows(self, table: Literal["receipts"]) -> list[ReceiptRow]: ...
    @overload
    def rows(self, table: Literal["messages"]) -> list[MessageRow]: ...
    @overload
    def rows(self, table: Literal["events"]) -> list[EventRow]: ...
    @overload
    def rows(self, table: Literal["pictures"]) -> list[PictureRow]: ...
    def rows(self, table: TableName = "ticks") -> Any:
        """Return the rows of a table (`lingjing.trace.tables`). Raises `UsageError` for an unknown table."""
        return table_rows(self, table)

    def to_frame(self, table: TableName = "ticks", library: FrameLibrary = "pandas") -> Any:
        """Return a table as a data frame of pandas or polars, with the columns of `rows`.

        Raises `UsageError` for an unknown table or library, and for a library that is not installed.
        """
        return data_frame(self, table, library)

    def stored(self, frame_id: str, channel: str) -> bytes | None:
        """Return the message with one channel of a picture, or None if the picture lacks the channel.

        `channel` is "" for colour, or one of `topics.CHANNELS`. Raises `UsageError` if there is no such picture.
        """
        return self._message(self._info(frame_id), channel)

    def _info(self, frame_id: str) -> FrameInfo:
        if frame_id not in self.frames:
            some = ", ".join(list(self.frames)[:3])
            raise UsageError(f"no picture {frame_id} in {self.path}", hint=f"it holds {len(self.frames)}: {some} …")
        return self.frames[frame_id]

    def _message(self, info: FrameInfo, channel: str) -> bytes | None:
        place = self.places.get(info.id, {}).get(camera_topic(info, channel))
        return None if place is None else _read(self.path, place)


def read_trace(path: str | Path) -> Trace:
    """Read a `trace.mcap` or a `.part`, whole or cut, or the one in the folder of a run.

    >>> trace = lingjing.read("runs/first")
    >>> trace.outcome.reason
    'budget'

    Raises `UsageError` for a file that cannot be read, is no trace, was written in another version of the format, or
    was cut before the end of its header.
    """
    path = _in_folder(Path(path))
    records = TraceBuilder(path)
    with collector_at_rest():
        for stored in scan(path, passed_over=CAMERAS, only=TOPICS_READ):
            records.take(stored)
    return records.trace()


def _spread(names: list[str], count: int) -> list[str]:
    """Return up to `count` names at even distances, the first and the last one among them."""
    if len(names) <= count:
        return names
    return [names[round(number * (len(names) - 1) / (count - 1))] for number in range(count)]


def _in_folder(path: Path) -> Path:
    """Return the trace in a run's folder, complete or not; any other path unchanged."""
    names = ("trace.mcap", "trace.mcap.part") if path.is_dir() else ()
    return next((path / name for name in names if (path / name).is_file()), path)


class UnknownFormatError(UsageError):
    """The error for a trace in a format of another version."""


class _AnyHeader(msgspec.Struct):
    """The fields that a header has in every version."""

    format: str = ""
    digest_version: int = 1


class TraceBuilder:
    """The records that were read from a file so far."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._taken = self._most = 0
        self.lies_at(path)
        self.header: Header | None = None
        self.outcome: Outcome | None = None
        self.boundaries: list[BoundaryRecord] = []
        self.pictures: list[tuple[FrameInfo, int]] = []
        self.places: dict[tuple[str, int], ChannelLocation] = {}
        self.engine_frames: list[EngineFrame] = []

    def lies_at(self, path: Path) -> None:
        """Set the present path of the file, and adjust the limit of its records to its size."""
        self.path = path
        self._most = RECORD_BYTES + RECORD_RATIO * (path.stat().st_size if path.is_file() else 0)

    def trace(self) -> Trace:
        """Return the trace as far as it was read. Raises `UsageError` if there was no header."""
        if self.header is None:
            raise UsageError(
                f"{self.path} holds no episode",
                hint="it was cut before its first record, or it was written by another program",
            )
        cut_short = self.outcome is None or self.outcome.reason in CUT_SHORT
        return Trace(
            path=self.path,
            header=self.header,
            boundaries=tuple(self.boundaries),
            outcome=self.outcome,
            complete=not cut_short and ends_properly(self.path),
            places={info.id: self._located(info, time_ns) for info, time_ns in self.pictures},
            engine_frames=tuple(self.engine_frames),
        )

    def take(self, stored: StoredMessage) -> None:
        """Add the record of one message. Derived messages are ignored. Raises `UsageError` for an invalid record."""
        if stored.topic.startswith(CAMERAS):
            place = ChannelLocation(stored.channel, stored.time_ns, stored.chunk_at)
            self.places[stored.topic, stored.time_ns] = place
        elif stored.topic == BOUNDARY:
            self.boundaries.append(self._decoded(stored, BoundaryRecord))
        elif stored.topic == FRAME:
            self.pictures.append((self._decoded(stored, FrameInfo), stored.time_ns))
        elif stored.topic == ENGINE_FRAME:
            self.engine_frames.append(self._decoded(stored, EngineFrame))
        elif stored.topic == HEADER:
            self.header = self._header(stored)
        elif stored.topic == OUTCOME:
            self.outcome = self._decoded(stored, Outcome)

    def _located(self, info: FrameInfo, time_ns: int) -> dict[str, ChannelLocation]:
        """Return the places of the channels of a picture, by topic."""
        topics = (camera_topic(info, channel) for channel in ("", *CHANNELS))
        return {topic: place for topic in topics if (place := self.places.get((topic, time_ns))) is not None}

    def _header(self, stored: StoredMessage) -> Header:
        """Decode the header. Raises `UnknownFormatError` if it names an unknown version."""
        versions = self._decoded(stored, _AnyHeader)
        if versions.format != FORMAT:
            raise UnknownFormatError(
                f"{self.path} is of the format `{versions.format[:40]}`; this version reads {FORMAT}",
                hint="read it with the version that wrote it",
            )
        if versions.digest_version not in get_args(DigestVersion):
            raise UnknownFormatError(
                f"{self.path} has digests of version {versions.digest_version}; "
                f"this version reads 1 to {DIGEST_VERSION}",
                hint="read it with the version that wrote it",
            )
        header = self._decoded(stored, Header)
        if fault := _header_fault(header):
            raise UsageError(f"{self.path} describes no episode: {fault}", hint="it was written by another program")
        return msgspec.structs.replace(header, digest_version=versions.digest_version)

    def _decoded(self, stored: StoredMessage, kind: type[RecordT]) -> RecordT:
        self._taken += len(stored.data)
        if self._taken > self._most:
            raise UsageError(
                f"{self.path} holds more records than a trace of its size", hint="it was written by another program"
            )
        try:
            return from_json(stored.data, kind)
        except (msgspec.ValidationError, msgspec.DecodeError, RecursionError) as error:
            raise UsageError(
                f"{self.path} holds {with_article(stored.topic)} record that this version cannot read: {error}",
                hint="it was written by another version",
            ) from error


def _header_fault(header: Header) -> str:
    """Return the first impossible value of a header, in words, or "".

    Readers divide by the length of a tick and by the size of a picture, so these must be positive.
    """
    clock = header.instance.clock
    if fault := clock_fault(clock.tick_s, clock.sync_s):
        return fault
    for entity in header.instance.entities:
        for camera in entity.cameras:
            if not (camera.width > 0 and camera.height > 0 and 0.0 < camera.hfov_deg < 180.0):
                size = f"{camera.width} x {camera.height} pixels, {camera.hfov_deg:g} degrees wide"
                return f"the camera `{camera.name}` of `{entity.id}` is {size}"
    return ""


def _read(path: Path, place: ChannelLocation) -> bytes:
    try:
        for stored in chunk_messages(path, place.chunk_at):
            if (stored.channel, stored.time_ns) == (place.channel, place.time_ns):
                return stored.data
    except BROKEN as error:
        raise UsageError(f"{path} is damaged: the picture at byte {place.chunk_at} cannot be read: {error}") from error
    raise UsageError(f"{path} has changed since it was read")
