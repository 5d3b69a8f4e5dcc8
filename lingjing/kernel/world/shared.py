"""Memory that crosses the process border by descriptor: pictures, and the word that says what a worker is doing.

`memfd_create` needs no name, no tracker and no room in `/dev/shm`; the memory goes with its last descriptor. A
picture is written into its memory, its descriptor is passed on, and the receiver reads it into arrays of its own and
closes it at once: nothing stays open however long the arrays live.
"""

from __future__ import annotations

import mmap
import os
from collections.abc import Sequence

import msgspec
import numpy as np
import numpy.typing as npt

from lingjing.errors import InfrastructureError
from lingjing.kernel.world.contract import StoredFrame
from lingjing.kernel.world.times import EngineTimes
from lingjing.trace.records import FrameInfo

_PROGRESS_BYTES = 1024
_NAME = 48
"""Characters of an engine's name that are noted."""


class Layout(msgspec.Struct, frozen=True):
    """What lies in a picture's memory, one after the other: JPEG bytes, then depth, then semantic (or 0 by 0)."""

    jpeg: int
    depth: tuple[int, int] | None
    semantic: tuple[int, int] | None


def store_frame(frame: StoredFrame) -> tuple[Layout, int]:
    """A memory with the frame's bytes; the caller closes the descriptor. `InfrastructureError` if none is to be had."""
    arrays = [np.ascontiguousarray(array) for array in (frame.depth, frame.semantic) if array is not None]
    try:
        descriptor = _filled([memoryview(frame.jpeg), *(array.data.cast("B") for array in arrays)])
    except OSError as error:
        raise InfrastructureError(
            f"the picture `{frame.info.id}` cannot be handed to the process that wants it: {error.strerror}",
            hint="memory or file descriptors of this machine or container have run out",
        ) from error
    return Layout(len(frame.jpeg), _shape(frame.depth), _shape(frame.semantic)), descriptor


def load_frame(info: FrameInfo, layout: Layout, descriptor: int) -> StoredFrame:
    """The frame in that memory, in arrays that nobody else holds. The descriptor stays the caller's to close."""
    jpeg = bytearray(layout.jpeg)
    depth = None if layout.depth is None else np.empty(layout.depth, np.float32)
    semantic = None if layout.semantic is None else np.empty(layout.semantic, np.uint8)
    arrays = [array for array in (depth, semantic) if array is not None]
    _read(descriptor, [memoryview(jpeg), *(array.data.cast("B") for array in arrays)])
    for array in arrays:
        array.flags.writeable = False
    return StoredFrame(info, bytes(jpeg), depth, semantic)


class CurrentCall(msgspec.Struct, frozen=True):
    """What a worker is doing: the engine and the call it is in (empty: none) and since when on the worker's clock
    (`own_clock_of_s`); the engine that has taken most of the barrier before, and its seconds."""

    engine: str = ""
    call: str = ""
    since_s: float = 0.0
    slowest: str = ""
    slowest_s: float = 0.0


class CallMonitor:
    """One word in shared memory: what a worker is doing. Readable after it hangs or dies."""

    def __init__(self, descriptor: int) -> None:
        self._memory = mmap.mmap(descriptor, _PROGRESS_BYTES)
        self._times = EngineTimes()

    def enter(self, engine: str, call: str) -> None:
        """Note the call."""
        self._times.enter(engine, call)
        self._write(CurrentCall(engine[:_NAME], call, self._times.since_s, *_short(self._times.slowest())))

    def rest(self) -> None:
        """Note that no engine is being called: a barrier has ended."""
        self._times.clear()
        self._write(CurrentCall())

    def read(self) -> CurrentCall:
        """What was noted last."""
        word = self._memory[:].rstrip(b"\0")
        try:
            return msgspec.json.decode(word, type=CurrentCall)
        except msgspec.DecodeError:  # nothing has been noted, or it is being noted just now
            return CurrentCall()

    def _write(self, call: CurrentCall) -> None:
        # One slice assignment: a reader never sees an older word's tail.
        self._memory[:] = msgspec.json.encode(call).ljust(_PROGRESS_BYTES, b"\0")

    def rebind(self, descriptor: int) -> None:
        """Write into another memory from now on: a forked worker must not speak for its parent."""
        self._memory.close()
        self._memory = mmap.mmap(descriptor, _PROGRESS_BYTES)

    def close(self) -> None:
        """Let go of the memory."""
        self._memory.close()


def progress_memory() -> int:
    """A descriptor for a new `CallMonitor`; the caller closes it."""
    descriptor = os.memfd_create("lingjing-progress", os.MFD_CLOEXEC)
    os.ftruncate(descriptor, _PROGRESS_BYTES)
    return descriptor


def _short(named: tuple[str, float]) -> tuple[str, float]:
    return named[0][:_NAME], named[1]


def _shape(array: npt.NDArray[np.generic] | None) -> tuple[int, int] | None:
    return None if array is None else (array.shape[0], array.shape[1])


def _filled(parts: Sequence[memoryview]) -> int:
    """A descriptor of a new memory with these bytes."""
    descriptor = os.memfd_create("lingjing-frame", os.MFD_CLOEXEC)
    try:
        offset = 0
        for part in parts:
            done = 0
            while done < len(part):
                done += os.pwrite(descriptor, part[done:], offset + done)
            offset += len(part)
    except BaseException:
        os.close(descriptor)
        raise
    return descriptor


def _read(descriptor: int, parts: Sequence[memoryview]) -> None:
    offset = 0
    for part in parts:
        done = 0
        while done < len(part):
            got = os.preadv(descriptor, [part[done:]], offset + done)
            if not got:
                raise EOFError("a picture's memory is shorter than its layout says")
            done += got
        offset += len(part)
