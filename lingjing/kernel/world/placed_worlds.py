"""Worlds that stand at boundary 0, for episodes of an instance that was played before.

Instances are announced to the process from which episodes are forked (`announce`). The first request for a world of
such an instance forks a holder, which resets the engines as a world process would. Every world of that instance is a
fork of the holder and answers `Prepare`, `Reset` and `Begin` with the replies that the holder kept. A fork of the
engines continues bit by bit as its original would, so an episode does not depend on it.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

import msgspec

from lingjing.kernel.world.messages import Begin, Prepare, Ready, Request, Reset, WorkerMessage
from lingjing.mission.instance import Instance

MOST_STARTS = 16
"""Largest number of announced instances; the oldest is evicted. Chosen."""

_announced: dict[bytes, WorldStart] = {}


@dataclass(frozen=True, slots=True)
class WorldStart:
    """The requests that bring a world process to boundary 0."""

    prepare: Prepare
    """The first request."""
    reset: Reset
    """The second request."""
    key: bytes
    """The hash of both, by which such a world is requested."""


def world_start(engines: tuple[str, ...], instance: Instance, city: msgspec.Raw) -> WorldStart:
    """Return the start of a world with all engines in one process; `city` in its encoding (`held_cities.packed`)."""
    return start_of(engines, Reset(instance=instance, city=city))


def start_of(engines: tuple[str, ...], reset: Reset) -> WorldStart:
    """Return the start of engines with this `Reset`."""
    content = msgspec.msgpack.encode((engines, reset.instance, reset.coupled))
    key = hashlib.sha256(content + hashlib.sha256(reset.city).digest()).digest()
    return WorldStart(Prepare(engines=engines), reset, key)


def announce(start: WorldStart) -> None:
    """Register, in the process from which worlds are forked, that such a world may be requested."""
    _announced[start.key] = start
    while len(_announced) > MOST_STARTS:
        del _announced[next(iter(_announced))]


def announced(key: bytes) -> WorldStart | None:
    """Return the announced start with that hash, or None."""
    return _announced.get(key)


@dataclass(frozen=True, slots=True)
class PlacedReplies:
    """The replies of a world process on its way to boundary 0; a fork of it gives the same."""

    start: WorldStart
    """The start with the answered requests."""
    reset: Ready
    """The reply to `Reset`."""
    begun: WorkerMessage
    """The reply to `Begin`."""

    def to(self, request: Request) -> WorkerMessage | None:
        """Return the kept reply, or None for any other request than those of the start."""
        match request:
            case Prepare() if request == self.start.prepare:
                return Ready()
            case Reset() if request == self.start.reset:
                return self.reset
            case Begin():
                return self.begun
        return None


__all__ = ["MOST_STARTS", "PlacedReplies", "WorldStart", "announce", "announced", "start_of", "world_start"]
