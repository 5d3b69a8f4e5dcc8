"""The pictures of first boundaries, kept by a camera process for episodes that begin alike.

A picture depends on the instance, the city, the states of all bodies and what is asked for, and on nothing before it.
So an episode of an instance that was seen before gets the pictures that were drawn then, bit by bit, without another
drawing. Only boundary 0 comes again for sure: what follows depends on what is decided.
"""

from __future__ import annotations

import hashlib
from collections import OrderedDict
from collections.abc import Sequence

import msgspec
import numpy as np

from lingjing.kernel.world.contract import StoredFrame
from lingjing.kernel.world.messages import Capture

ROOM_BYTES = 128 << 20
"""About twelve pictures of 1920 by 1080 with depth and classes."""

Drawn = Sequence[StoredFrame | None]
"""One answer for each request of a capture; None where the engine drew nothing."""


class FirstPictures:
    """Holds `room` bytes of pictures at most; the capture that was not asked for the longest time goes first."""

    def __init__(self, room: int = ROOM_BYTES) -> None:
        self._room = room
        self._held = 0
        self._captures: OrderedDict[bytes, tuple[Drawn, int]] = OrderedDict()

    def find(self, key: bytes) -> Drawn | None:
        """The pictures of that capture, if they are held."""
        found = self._captures.get(key)
        if found is None:
            return None
        self._captures.move_to_end(key)
        return found[0]

    def keep(self, key: bytes, drawn: Drawn) -> None:
        """Hold the pictures of a capture that is not held."""
        copies = [None if frame is None else _copied(frame) for frame in drawn]
        size = sum(_size(frame) for frame in copies if frame is not None)
        self._captures[key] = copies, size
        self._held += size
        while self._held > self._room:
            _, (_, gone) = self._captures.popitem(last=False)
            self._held -= gone


def capture_key(start: bytes, capture: Capture) -> bytes:
    """The hash of all that the pictures of a capture depend on; `start` is that of the instance and the city."""
    asked = msgspec.msgpack.encode((capture.time_s, capture.requests, capture.states))
    return hashlib.sha256(start + asked).digest()


def _copied(frame: StoredFrame) -> StoredFrame:
    """The frame in arrays that the engine does not draw into."""
    depth = None if frame.depth is None else np.array(frame.depth)
    semantic = None if frame.semantic is None else np.array(frame.semantic)
    return StoredFrame(frame.info, frame.jpeg, depth, semantic)


def _size(frame: StoredFrame) -> int:
    return len(frame.jpeg) + sum(layer.nbytes for layer in (frame.depth, frame.semantic) if layer is not None)


__all__ = ["ROOM_BYTES", "FirstPictures", "capture_key"]
