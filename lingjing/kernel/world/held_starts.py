"""Copies of a world process at boundary 0, kept by its caller for episodes of an instance that was played before.

An environment that begins an instance again forks the kept copy instead of placing the bodies and starting the engines.
Copies are forks of the world process that plays first episodes, and end with it.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import dataclass

from lingjing.errors import InfrastructureError
from lingjing.kernel.world.contract import WorldBoundary
from lingjing.kernel.world.handle import Worker

MOST = 4
"""Largest number of copies, of 30 to 60 MB each; the least recently used ends first. Chosen."""


Runtimes = Mapping[str, Mapping[str, str]]
"""Runtime fingerprints (`lingjing.numerics.runtime_fingerprint`) by process."""


@dataclass(frozen=True, slots=True)
class _HeldStart:
    """A world process that stands at boundary 0 and is never stepped."""

    worker: Worker
    """The process."""
    boundary: WorldBoundary
    """Its boundary 0."""
    runtimes: Runtimes
    """The runtime fingerprints of its processes by name."""


class HeldStarts:
    """The copies by the keys of their starts (`placed_worlds.WorldStart`)."""

    def __init__(self) -> None:
        self._held: OrderedDict[bytes, _HeldStart] = OrderedDict()

    def __len__(self) -> int:
        return len(self._held)

    def hold(
        self, key: bytes, world: Worker, boundary: WorldBoundary, runtimes: Mapping[str, Mapping[str, str]]
    ) -> None:
        """Keep a copy of a world that has just reached boundary 0. Does nothing if it cannot be forked."""
        try:
            copy = world.fork(world.deadline(_FORK_S))
        except InfrastructureError:  # it has threads, or the machine cannot hold another process
            return
        self._held[key] = _HeldStart(copy, boundary, runtimes)
        while len(self._held) > MOST:
            self._held.popitem(last=False)[1].worker.release()

    def fork_of(self, key: bytes) -> tuple[Worker, _HeldStart] | None:
        """Return a fork of the copy with that key, and the copy itself; None if there is none."""
        start = self._held.get(key)
        if start is None:
            return None
        try:
            worker = start.worker.fork(start.worker.deadline(_FORK_S))
        except InfrastructureError:  # it was killed
            del self._held[key]
            start.worker.kill()
            return None
        self._held.move_to_end(key)
        return worker, start

    def clear(self) -> None:
        """End all copies."""
        while self._held:
            self._held.popitem()[1].worker.release()


_FORK_S = 60.0
"""Seconds of its own time in which a process may copy itself. Chosen: a fork takes 4 to 22 ms."""

__all__ = ["MOST", "HeldStarts"]
