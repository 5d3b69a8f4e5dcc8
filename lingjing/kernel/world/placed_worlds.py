"""Worlds that stand at their first boundary, for episodes of an instance that was seen before.

The process that episodes are forked from is told of an instance before its episodes begin (`announce`). When the first
world of it is asked for, it forks a holder, which resets the engines as a world process would, and every world of that
instance is a fork of the holder: it answers `Prepare`, `Reset` and `Begin` with the replies that the holder kept. A
fork of the engines goes on bit by bit as its original would have, so that nothing of an episode depends on it.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass

import msgspec

from lingjing.kernel.world.messages import Begin, Prepare, Ready, Request, Reset, WorkerMessage
from lingjing.mission.instance import Instance

MOST_STARTS = 16
"""Instances that are remembered; the one that was announced first goes first."""

_announced: dict[bytes, WorldStart] = {}


@dataclass(frozen=True, slots=True)
class WorldStart:
    """The requests that bring a world process to boundary 0. `key` is the hash by which such a world is asked for."""

    prepare: Prepare
    reset: Reset
    key: bytes


def world_start(engines: tuple[str, ...], instance: Instance, city: msgspec.Raw) -> WorldStart:
    """The start of a world whose engines are all in one process; `city` as it travels (`held_cities.packed`)."""
    return start_by(engines, Reset(instance=instance, city=city))


def start_by(engines: tuple[str, ...], reset: Reset) -> WorldStart:
    """The start of engines that are reset so."""
    content = msgspec.msgpack.encode((engines, reset.instance, reset.coupled))
    key = hashlib.sha256(content + hashlib.sha256(reset.city).digest()).digest()
    return WorldStart(Prepare(engines=engines), reset, key)


def announce(start: WorldStart) -> None:
    """Remember, in the process that worlds are forked from, that such a world may be asked for."""
    _announced[start.key] = start
    while len(_announced) > MOST_STARTS:
        del _announced[next(iter(_announced))]


def announced(key: bytes) -> WorldStart | None:
    """The start with that hash, if it was announced."""
    return _announced.get(key)


@dataclass(frozen=True, slots=True)
class PlacedReplies:
    """What a world process that was brought to boundary 0 answered on its way; a fork of it answers the same."""

    start: WorldStart
    reset: Ready
    begun: WorkerMessage

    def to(self, request: Request) -> WorkerMessage | None:
        """The kept reply; None for any other request than those of the start."""
        match request:
            case Prepare() if request == self.start.prepare:
                return Ready()
            case Reset() if request == self.start.reset:
                return self.reset
            case Begin():
                return self.begun
        return None


__all__ = ["MOST_STARTS", "PlacedReplies", "WorldStart", "announce", "announced", "start_by", "world_start"]
