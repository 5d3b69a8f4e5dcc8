"""Memory that crosses the process border by descriptor: pictures, and the monitor of a worker's current engine call.

`memfd_create` needs no name, no tracker and no space in `/dev/shm`; the memory is freed with its last descriptor. The
sender writes a picture into its memory and passes the descriptor. The receiver copies it into arrays of its own and
closes the descriptor at once.
"""

from __future__ import annotations

import mmap
import os
from collections.abc import Sequence

import msgspec
import numpy as np
import numpy.typing as npt

from lingjing.decoding import from_json
from lingjing.errors import InfrastructureError
from lingjing.kernel.world.contract import StoredFrame
from lingjing.kernel.world.times import EngineTimes
from lingjing.trace.records import FrameInfo

_PROGRESS_BYTES = 1024
"""Size of a call monitor. Chosen: above the largest `CurrentCall` as JSON."""
_NAME = 48
"""Characters of an engine's name that are stored, so that a `CurrentCall` fits. Chosen."""


class Layout(msgspec.Struct, frozen=True):
    """The parts of a picture's memory in order: JPEG bytes, depth, semantic, instance."""

    jpeg: int
    """Length of the JPEG in bytes."""
    depth: tuple[int, int] | None
    """(height, width) of the float32 depth; None without it."""
    semantic: tuple[int, int] | None
    """(height, width) of the uint8 class ids; None without them."""
    instance: tuple[int, int] | None
    """(height, width) of the uint16 numbers of entities; None without them."""


def store_frame(frame: StoredFrame) -> tuple[Layout, int]:
    """Return the layout and descriptor of a new memory with the frame's bytes; the caller closes the descriptor.

    Raises `InfrastructureError` if the operating system grants no memory or descriptor.
    """
    arrays = [np.ascontiguousarray(array) for array in frame.layers]
    try:
        descriptor = _filled([memoryview(frame.jpeg), *(array.data.cast("B") for array in arrays)])
    except OSError as error:
        raise InfrastructureError(
            f"the picture `{frame.info.id}` cannot be passed to the receiving process: {error.strerror}",
            hint="memory or file descriptors of this machine or container have run out",
        ) from error
    shapes = _shape(frame.depth), _shape(frame.semantic), _shape(frame.instance)
    return Layout(len(frame.jpeg), *shapes), descriptor


def load_frame(info: FrameInfo, layout: Layout, descriptor: int) -> StoredFrame:
    """Return the frame in that memory, in arrays of its own. The caller closes the descriptor."""
    jpeg = bytearray(layout.jpeg)
    depth = None if layout.depth is None else np.empty(layout.depth, np.float32)
    semantic = None if layout.semantic is None else np.empty(layout.semantic, np.uint8)
    instance = None if layout.instance is None else np.empty(layout.instance, np.uint16)
    arrays = [array for array in (depth, semantic, instance) if array is not None]
    _read(descriptor, [memoryview(jpeg), *(array.data.cast("B") for array in arrays)])
    for array in arrays:
        array.flags.writeable = False
    return StoredFrame(info, bytes(jpeg), depth, semantic, instance)


class CurrentCall(msgspec.Struct, frozen=True):
    """The current engine call of a worker."""

    engine: str = ""
    """The engine; "" between calls."""
    call: str = ""
    """The method."""
    since_s: float = 0.0
    """The start of the call on the worker's clock (`own_clock_of_s`), less the engine's earlier time in the same
    barrier.
    """
    slowest: str = ""
    """The engine that has taken most time in this barrier; "" before the first."""
    slowest_s: float = 0.0
    """The time of the engine, seconds."""


class CallMonitor:
    """A `CurrentCall` in shared memory, readable after the worker hangs or dies."""

    def __init__(self, descriptor: int) -> None:
        self._memory = mmap.mmap(descriptor, _PROGRESS_BYTES)
        self._times = EngineTimes()

    def enter(self, engine: str, call: str) -> None:
        """Store a call."""
        self._times.enter(engine, call)
        self._write(CurrentCall(engine[:_NAME], call, self._times.since_s, *_short(self._times.slowest())))

    def rest(self) -> None:
        """Store that no engine is being called: a barrier has ended."""
        self._times.clear()
        self._write(CurrentCall())

    def read(self) -> CurrentCall:
        """Return the last stored call."""
        word = self._memory[:].rstrip(b"\0")
        try:
            return from_json(word, CurrentCall)
        except msgspec.DecodeError:  # nothing is stored yet, or the worker is writing at this moment
            return CurrentCall()

    def _write(self, call: CurrentCall) -> None:
        # One slice assignment: a reader never sees an older word's tail.
        self._memory[:] = msgspec.json.encode(call).ljust(_PROGRESS_BYTES, b"\0")

    def rebind(self, descriptor: int) -> None:
        """Use another memory from now on. A forked worker must not write into its parent's."""
        self._memory.close()
        self._memory = mmap.mmap(descriptor, _PROGRESS_BYTES)

    def close(self) -> None:
        """Release the memory."""
        self._memory.close()


def progress_memory() -> int:
    """Return the descriptor of a new memory for a `CallMonitor`; the caller closes it."""
    descriptor = os.memfd_create("lingjing-progress", os.MFD_CLOEXEC)
    os.ftruncate(descriptor, _PROGRESS_BYTES)
    return descriptor


def _short(named: tuple[str, float]) -> tuple[str, float]:
    return named[0][:_NAME], named[1]


def _shape(array: npt.NDArray[np.generic] | None) -> tuple[int, int] | None:
    return None if array is None else (array.shape[0], array.shape[1])


def _filled(parts: Sequence[memoryview]) -> int:
    """Return the descriptor of a new memory with these bytes."""
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
