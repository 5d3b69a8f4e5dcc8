"""Copies of a world process at boundary 0, held by its caller for episodes of an instance that was seen before.

An environment that begins an instance again forks the held copy instead of placing the bodies and starting the engines
anew. Copies are forks of the world process that plays first episodes, and end with it.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import dataclass

from lingjing.errors import InfrastructureError
from lingjing.kernel.world.contract import WorldBoundary
from lingjing.kernel.world.handle import Worker

MOST = 4
"""Copies held at a time, of 30 to 60 MB each; the one that was not used for the longest time ends first."""


@dataclass(frozen=True, slots=True)
class HeldStart:
    """A world process that stands at `boundary` 0 and is never stepped; `taken` is what its processes run."""

    worker: Worker
    boundary: WorldBoundary
    taken: Mapping[str, Mapping[str, str]]


class HeldStarts:
    """The copies by the keys of their starts (`placed_worlds.WorldStart`)."""

    def __init__(self) -> None:
        self._held: OrderedDict[bytes, HeldStart] = OrderedDict()

    def __len__(self) -> int:
        return len(self._held)

    def hold(self, key: bytes, world: Worker, boundary: WorldBoundary, taken: Mapping[str, Mapping[str, str]]) -> None:
        """Hold a copy of a world that has just come to boundary 0; nothing if it cannot be forked."""
        try:
            copy = world.fork(world.deadline(_FORK_S))
        except InfrastructureError:  # it has threads, or the machine has no room for another process
            return
        self._held[key] = HeldStart(copy, boundary, taken)
        while len(self._held) > MOST:
            self._held.popitem(last=False)[1].worker.release()

    def again(self, key: bytes) -> tuple[Worker, HeldStart] | None:
        """A fork of the copy with that key, and what the copy answered; None if there is none."""
        found = self._held.get(key)
        if found is None:
            return None
        try:
            worker = found.worker.fork(found.worker.deadline(_FORK_S))
        except InfrastructureError:  # it was killed
            del self._held[key]
            found.worker.kill()
            return None
        self._held.move_to_end(key)
        return worker, found

    def clear(self) -> None:
        """End all copies."""
        while self._held:
            self._held.popitem()[1].worker.release()


_FORK_S = 60.0
"""Own time of a process to copy itself. Chosen: a fork takes 4 to 22 ms."""

__all__ = ["MOST", "HeldStart", "HeldStarts"]
