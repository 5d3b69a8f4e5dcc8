"""A camera process's cache of the pictures of boundary 0, for episodes with equal beginnings.

A picture depends on the instance, the city, the states of all bodies and the request, and on nothing before. An episode
of a cached instance therefore receives the cached pictures, bit by bit equal to a new drawing. Only boundary 0 is
certain to recur; later boundaries depend on decisions.
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
"""Capacity in bytes: about twelve pictures of 1920 by 1080 with depth and classes. Chosen."""

Drawn = Sequence[StoredFrame | None]
"""One answer for each request of a capture; None if the engine drew nothing."""


class FirstPictures:
    """A cache of at most `room` bytes of pictures. The least recently used capture is evicted first."""

    def __init__(self, room: int = ROOM_BYTES) -> None:
        self._room = room
        self._held = 0
        self._captures: OrderedDict[bytes, tuple[Drawn, int]] = OrderedDict()

    def find(self, key: bytes) -> Drawn | None:
        """Return the pictures of a capture, or None."""
        entry = self._captures.get(key)
        if entry is None:
            return None
        self._captures.move_to_end(key)
        return entry[0]

    def keep(self, key: bytes, drawn: Drawn) -> None:
        """Store the pictures of a capture that is not in the cache."""
        copies = [None if frame is None else _copied(frame) for frame in drawn]
        size = sum(_size(frame) for frame in copies if frame is not None)
        self._captures[key] = copies, size
        self._held += size
        while self._held > self._room:
            _, (_, evicted) = self._captures.popitem(last=False)
            self._held -= evicted


def capture_key(start: bytes, capture: Capture) -> bytes:
    """Return the hash of all that the pictures of a capture depend on; `start` is the hash of instance and city."""
    content = msgspec.msgpack.encode((capture.time_s, capture.requests, capture.states))
    return hashlib.sha256(start + content).digest()


def _copied(frame: StoredFrame) -> StoredFrame:
    """Return the frame with arrays of its own: the engine draws the next picture into its arrays."""
    depth = None if frame.depth is None else np.array(frame.depth)
    semantic = None if frame.semantic is None else np.array(frame.semantic)
    instance = None if frame.instance is None else np.array(frame.instance)
    return StoredFrame(frame.info, frame.jpeg, depth, semantic, instance)


def _size(frame: StoredFrame) -> int:
    return len(frame.jpeg) + sum(layer.nbytes for layer in frame.layers)


__all__ = ["ROOM_BYTES", "FirstPictures", "capture_key"]
