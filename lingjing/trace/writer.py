"""Writing of one episode's trace.

During the episode the file is named `trace.mcap.part`. Only a clean end renames it to `trace.mcap`. After the header
and after every boundary all bytes are passed to the operating system. The file of a killed process can therefore be
read to its last complete boundary.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from types import TracebackType
from typing import Self

from lingjing.errors import InfrastructureError, LingjingError, UsageError
from lingjing.trace import foxglove, images
from lingjing.trace.container import ContainerWriter
from lingjing.trace.encoding import to_json
from lingjing.trace.images import Depth, Instances, Semantic
from lingjing.trace.records import BoundaryRecord, EngineFrame, FrameInfo, Header, Outcome, TraceRecord
from lingjing.trace.schemas import container_schema
from lingjing.trace.surroundings import NO_SURROUNDINGS, Surroundings
from lingjing.trace.topics import RECORDS
from lingjing.trace.viewer_messages import TimedMessage, ViewerMessages

PictureParts = (
    tuple[FrameInfo, bytes, Depth | None, Semantic | None]
    | tuple[FrameInfo, bytes, Depth | None, Semantic | None, Instances | None]
)
"""A picture to store: its record, its JPEG, depth (`images.quantise_depth`), class ids and instance numbers. These are
None if the camera does not declare them; the last may be left out."""

PART = ".part"
"""Suffix of the file's name until the episode has ended by itself."""


def part_path(path: Path) -> Path:
    """Return the name of a trace during its episode. An episode that was cut short keeps it."""
    return path.with_name(path.name + PART)


def trace_removed_error(part: Path) -> InfrastructureError:
    """Return the error for a trace file that was removed during its episode."""
    return InfrastructureError(
        f"the trace {part} was removed, or its folder was, while the episode was played",
        hint="do not change the folder of a run before the run has ended",
        cause="trace",
    )


def trace_tampered_error(path: Path, cause: str) -> InfrastructureError:
    """Return the error for a trace with a file or name that another program changed during the episode."""
    return InfrastructureError(
        f"the trace {path} was changed by another program while the episode was played: {cause}",
        hint="do not change the folder of a run before the run has ended",
        cause="trace",
    )


class TraceWriter:
    """Writer of one episode's trace. The trace is sealed, and signed if there is a `key`.

    `surroundings` are the inputs for viewers. Use the writer as a context manager: if neither `finish` nor `abandon` is
    called, it leaves a closed `.part`.

    Raises `UsageError` if `path` or its `.part` exists, or if the file cannot be written.
    """

    def __init__(
        self, path: Path, header: Header, key: bytes = b"", surroundings: Surroundings = NO_SURROUNDINGS
    ) -> None:
        self.path = path
        self._key = key
        self.part = part_path(path)
        self._shown = ViewerMessages(header.instance, surroundings)
        self._pictures = 0
        self._open = True
        self._container = self._create()
        self._guarded(lambda: self._begin(header))

    def boundary(self, record: BoundaryRecord, pictures: Sequence[PictureParts] = ()) -> None:
        """Write the boundary's pictures and derived messages, then the record itself, and flush."""
        self._guarded(lambda: self._boundary(record, pictures))

    def engine_frames(self, frames: Sequence[EngineFrame]) -> None:
        """Write frames of foreign engines, before the boundary that they led to."""

        def write() -> None:
            for frame in frames:
                self._own("engine_frame", frame, self._container.last_ns, frame.number)

        self._guarded(write)

    def finish(self, outcome: Outcome) -> Path:
        """Write the outcome, close the file, rename it to its final name, and return that name.

        Raises `InfrastructureError` if the file or its name was changed by another program, and `UsageError` if it
        cannot be written or renamed.
        """
        self._guarded(lambda: self._end(outcome))
        try:
            self.part.rename(self.path)
        except FileNotFoundError:
            raise trace_removed_error(self.part) from None
        except (IsADirectoryError, NotADirectoryError) as error:
            raise trace_tampered_error(self.path, error.strerror or str(error)) from None
        except OSError as error:
            hint = f"the file is complete under the name {self.part.name}"
            message = f"cannot rename the trace to {self.path}: {error.strerror}"
            raise UsageError(message, hint=hint) from error
        return self.path

    def abandon(self, outcome: Outcome | None = None) -> Path:
        """Close the file of an episode that was cut short. It keeps the suffix `.part`. Return its path."""
        if self._open:
            self._guarded(lambda: self._end(outcome))
        return self.part

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self._open:
            self.abandon()

    def _create(self) -> ContainerWriter:
        if self.path.exists() or self.part.exists():
            existing = self.path if self.path.exists() else self.part
            raise UsageError(f"{existing} exists already", hint="a trace is never overwritten: choose another folder")
        try:
            return ContainerWriter(self.part, self._key)
        except OSError as error:
            hint = "choose another place with -o, or make room"
            raise UsageError(f"cannot write the trace {self.part}: {error.strerror}", hint=hint) from error

    def _begin(self, header: Header) -> None:
        self._own("header", header, 0)
        self._show(self._shown.beginning(hidden=True))
        self._container.flush()

    def _boundary(self, record: BoundaryRecord, pictures: Sequence[PictureParts]) -> None:
        now = nanoseconds(record.time_s)
        written = [self._picture(*picture) for picture in pictures]
        if written:
            self._container.end_chunk()  # a reader of the records need not unpack the pictures
        for frame, number in written:
            self._own("frame", frame, nanoseconds(frame.time_s), number)
        self._show(self._shown.boundary(record))
        self._own("boundary", record, now, record.tick)
        self._container.flush()

    def _picture(
        self,
        frame: FrameInfo,
        jpeg: bytes,
        depth: Depth | None,
        semantic: Semantic | None,
        instance: Instances | None = None,
    ) -> tuple[FrameInfo, int]:
        """Write the messages of a picture. Return its record and its number in the file."""
        self._pictures += 1
        packed = None if depth is None else images.encode_depth(depth)
        ids = None if semantic is None else images.encode_semantic(semantic)
        numbers = None if instance is None else images.encode_instances(instance)
        for topic, schema, data in foxglove.frame_messages(frame, jpeg, packed, ids, numbers):
            self._container.add(topic, schema, nanoseconds(frame.time_s), data, self._pictures)
        return frame, self._pictures

    def _own(self, name: str, record: TraceRecord, time_ns: int, sequence: int = 0) -> None:
        self._container.add(f"{RECORDS}{name}", container_schema(name), time_ns, to_json(record), sequence)

    def _show(self, messages: Iterable[TimedMessage]) -> None:
        for time_s, (topic, schema, data) in messages:
            self._container.add(topic, schema, nanoseconds(time_s), data)

    def _end(self, outcome: Outcome | None) -> None:
        self._open = False
        self._show(self._shown.ending())
        if outcome is not None:
            self._own("outcome", outcome, self._container.last_ns)
        self._container.finish()

    def _guarded(self, action: Callable[[], None]) -> None:
        if not self._open:
            raise LingjingError(f"the trace {self.part} is closed")
        try:
            action()
        except OSError as error:
            self._open = False
            self._container.close()
            raise UsageError(
                f"cannot write the trace {self.part}: {error.strerror}",
                hint="the part that was written before can be read",
            ) from error


def nanoseconds(time_s: float) -> int:
    """Return a simulation time in seconds as MCAP log time in nanoseconds."""
    return round(time_s * 1e9)
