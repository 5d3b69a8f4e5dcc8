"""`TraceWriter`: header, boundaries and outcome of one episode into `trace.mcap`.

While the episode runs the file is called `trace.mcap.part`; only a clean end gives it its name. After the header and
after every boundary everything is handed to the operating system, so that a killed process leaves a file that reads
to its last complete boundary.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np
import numpy.typing as npt

from lingjing.errors import InfrastructureError, LingjingError, UsageError
from lingjing.trace import foxglove, images
from lingjing.trace.container import ContainerWriter
from lingjing.trace.encoding import to_json
from lingjing.trace.records import BoundaryRecord, FrameInfo, Header, Outcome, TraceRecord
from lingjing.trace.schemas import container_schema
from lingjing.trace.shown import ShownEpisode, Timed
from lingjing.trace.surroundings import NO_SURROUNDINGS, Surroundings
from lingjing.trace.topics import RECORDS

PictureParts = tuple[FrameInfo, bytes, npt.NDArray[np.float32] | None, npt.NDArray[np.uint8] | None]
"""A picture to store: what is known of it, its JPEG, and depth and class ids where the camera declares them."""

PART = ".part"


def part_path(path: Path) -> Path:
    """What a trace is called while its episode runs, and for good if the episode was cut short."""
    return path.with_name(path.name + PART)


def gone(part: Path) -> InfrastructureError:
    """The error for a trace that somebody took away while its episode was played."""
    return InfrastructureError(
        f"the trace {part} is gone: it, or its folder, was removed while the episode was played",
        hint="leave the folder of a run alone until it has ended",
    )


def disturbed(path: Path, why: str) -> InfrastructureError:
    """The error for a trace whose file or name somebody meddled with while its episode was played."""
    return InfrastructureError(
        f"the trace {path} was meddled with while the episode was played: {why}",
        hint="leave the folder of a run alone until it has ended",
    )


class TraceWriter:
    """One episode's trace, sealed, and signed if there is a `key`; with the `surroundings` for viewers. Use it as a
    context manager: an episode that ends in neither `finish` nor `abandon` leaves a closed `.part`.

    Raises `UsageError` if `path` or its `.part` is there already, or when the file cannot be written.
    """

    def __init__(
        self, path: Path, header: Header, key: bytes = b"", surroundings: Surroundings = NO_SURROUNDINGS
    ) -> None:
        self.path = path
        self._key = key
        self.part = part_path(path)
        self._shown = ShownEpisode(header.instance, surroundings)
        self._pictures = 0
        self._open = True
        self._container = self._create()
        self._guarded(lambda: self._begin(header))

    def boundary(self, record: BoundaryRecord, pictures: Sequence[PictureParts] = ()) -> None:
        """Write the boundary's pictures and derived messages, the record itself last, and flush."""
        self._guarded(lambda: self._boundary(record, pictures))

    def finish(self, outcome: Outcome) -> Path:
        """Write the outcome, close the file, give it its name, and return that."""
        self._guarded(lambda: self._end(outcome))
        try:
            self.part.rename(self.path)
        except FileNotFoundError:
            raise gone(self.part) from None
        except (IsADirectoryError, NotADirectoryError) as error:
            raise disturbed(self.path, error.strerror or str(error)) from None
        except OSError as error:
            hint = f"it is whole under the name {self.part.name}"
            raise UsageError(f"cannot name the trace {self.path}: {error.strerror}", hint=hint) from error
        return self.path

    def abandon(self, outcome: Outcome | None = None) -> Path:
        """End an episode that was cut short: the file is closed whole but stays `.part`, whose path is returned."""
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
            taken = self.path if self.path.exists() else self.part
            raise UsageError(f"{taken} is there already", hint="a trace is never overwritten: choose another folder")
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
        taken = [self._picture(*picture) for picture in pictures]
        if taken:
            self._container.end_chunk()  # so that who reads records need not unpack pictures
        for frame, number in taken:
            self._own("frame", frame, nanoseconds(frame.time_s), number)
        self._show(self._shown.boundary(record))
        self._own("boundary", record, now, record.tick)
        self._container.flush()

    def _picture(
        self,
        frame: FrameInfo,
        jpeg: bytes,
        depth: npt.NDArray[np.float32] | None,
        semantic: npt.NDArray[np.uint8] | None,
    ) -> tuple[FrameInfo, int]:
        """Write what the topics of the camera hold of a picture; its number in the file."""
        self._pictures += 1
        packed = None if depth is None else images.encode_depth(depth)
        ids = None if semantic is None else images.encode_semantic(semantic)
        for topic, schema, data in foxglove.frame_messages(frame, jpeg, packed, ids):
            self._container.add(topic, schema, nanoseconds(frame.time_s), data, self._pictures)
        return frame, self._pictures

    def _own(self, name: str, record: TraceRecord, time_ns: int, sequence: int = 0) -> None:
        self._container.add(f"{RECORDS}{name}", container_schema(name), time_ns, to_json(record), sequence)

    def _show(self, messages: Iterable[Timed]) -> None:
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
                hint="what was written before stays readable",
            ) from error


def nanoseconds(time_s: float) -> int:
    """Simulation time as MCAP log time."""
    return round(time_s * 1e9)
