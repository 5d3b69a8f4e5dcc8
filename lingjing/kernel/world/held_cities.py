"""Cities that a process holds for its forks: built before the fork, they are shared and need no decoding.

A city travels to a worker as it is encoded. A worker that was forked from a process which holds the same city, told by
the hash of those bytes, takes that one. What is held changes no episode, only what its start costs.
"""

from __future__ import annotations

import hashlib

import msgspec

from lingjing.scene.city import City
from lingjing.scene.tiles import Tiles

MOST = 8
"""Cities held at a time; the one that was held first goes first."""

_held: dict[bytes, tuple[City, Tiles]] = {}


def hold(city: City) -> None:
    """Hold a city, with its division into tiles, for this process and for those that will be forked from it."""
    key = _key(packed(city))
    if key not in _held:
        _held[key] = city, Tiles(city)
    while len(_held) > MOST:
        del _held[next(iter(_held))]


def packed(city: City) -> msgspec.Raw:
    """A city as it travels."""
    return msgspec.Raw(msgspec.msgpack.encode(city))


def unpacked(given: msgspec.Raw) -> City:
    """The city of `packed`: the held one where it is the same."""
    found = _held.get(_key(given))
    return found[0] if found is not None else msgspec.msgpack.decode(given, type=City)


def _key(given: msgspec.Raw) -> bytes:
    return hashlib.sha256(given).digest()
