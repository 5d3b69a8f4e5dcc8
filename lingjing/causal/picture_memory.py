"""A cache of compressed pictures by their keys, limited in size; the least recently used picture is dropped first."""

from __future__ import annotations

from collections import OrderedDict
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
import zstandard

from lingjing.kernel.world.contract import StoredFrame
from lingjing.trace.records import FrameInfo

ROOM_BYTES = 256 << 20
"""The default size of the cache: about five hundred pictures of 1920 by 1080 pixels."""


@dataclass(frozen=True, slots=True)
class _PackedArray:
    """A compressed array."""

    shape: tuple[int, ...]
    dtype: np.dtype[np.generic]
    data: bytes

    @staticmethod
    def of(array: npt.NDArray[np.generic] | None) -> _PackedArray | None:
        if array is None:
            return None
        data = zstandard.ZstdCompressor(level=1).compress(np.ascontiguousarray(array).data)
        # zstandard returns the start of a block as large as the array. A copy frees the rest of the block, which would
        # otherwise stay allocated.
        return _PackedArray(array.shape, array.dtype, bytes(memoryview(data)))

    def unpacked(self) -> npt.NDArray[Any]:
        data = zstandard.ZstdDecompressor().decompress(self.data)
        return np.frombuffer(data, self.dtype).reshape(self.shape)


@dataclass(frozen=True, slots=True)
class _PackedFrame:
    """A picture with its compressed layers."""

    info: FrameInfo
    jpeg: bytes
    depth: _PackedArray | None
    semantic: _PackedArray | None
    instance: _PackedArray | None

    @property
    def size(self) -> int:
        return len(self.jpeg) + sum(len(layer.data) for layer in (self.depth, self.semantic, self.instance) if layer)


class PictureMemory:
    """A cache of at most `room` bytes of pictures."""

    def __init__(self, room: int = ROOM_BYTES) -> None:
        self._room = room
        self._held = 0
        self._frames: OrderedDict[bytes, _PackedFrame] = OrderedDict()

    def keep(self, key: bytes, frame: StoredFrame) -> None:
        """Store a picture that is not stored yet."""
        layers = (_PackedArray.of(layer) for layer in (frame.depth, frame.semantic, frame.instance))
        packed = _PackedFrame(frame.info, frame.jpeg, *layers)
        self._frames[key] = packed
        self._held += packed.size
        while self._held > self._room:
            _, dropped = self._frames.popitem(last=False)
            self._held -= dropped.size

    def find(self, key: bytes) -> StoredFrame | None:
        """Return the picture with this key, or None."""
        packed = self._frames.get(key)
        if packed is None:
            return None
        self._frames.move_to_end(key)
        layers = (_unpacked(layer) for layer in (packed.depth, packed.semantic, packed.instance))
        return StoredFrame(packed.info, packed.jpeg, *layers)


def _unpacked(layer: _PackedArray | None) -> npt.NDArray[Any] | None:
    return None if layer is None else layer.unpacked()
