"""Cities that a process keeps for its forks: built before the fork, they are shared and need no decoding.

A city travels to a worker in its encoding. A worker that was forked from a process with the same city, identified by
the hash of those bytes, uses that one. This changes only the cost of an episode's start.
"""

from __future__ import annotations

import hashlib

import msgspec

from lingjing.decoding import from_msgpack
from lingjing.scene.city import City
from lingjing.scene.tiles import Tiles

MOST = 8
"""Largest number of kept cities; the oldest is evicted. Chosen."""

_held: dict[bytes, tuple[City, Tiles]] = {}


def hold(city: City) -> None:
    """Keep a city, with its division into tiles, for this process and its forks."""
    key = _key(packed(city))
    if key not in _held:
        _held[key] = city, Tiles(city)
    while len(_held) > MOST:
        del _held[next(iter(_held))]


def packed(city: City) -> msgspec.Raw:
    """Return the encoding in which a city travels."""
    return msgspec.Raw(msgspec.msgpack.encode(city))


def unpacked(encoded: msgspec.Raw) -> City:
    """Return the city of an encoding: the kept one if it is the same, else a decoded one."""
    entry = _held.get(_key(encoded))
    return entry[0] if entry is not None else from_msgpack(encoded, City)


def _key(encoded: msgspec.Raw) -> bytes:
    return hashlib.sha256(encoded).digest()
