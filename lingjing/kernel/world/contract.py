"""The interface between kernel and world: reset, one round trip per tick, pictures, fork.

A `World` hides the place of the engines (`process`: a world process and a camera process; `inline`: the caller) and
their coupling. It raises `InfrastructureError` with the engine's name for every invalid boundary: an engine that
raises, dies, exceeds its deadline, or reports a wrong time or a missing entity. A missing admission receipt is no
error; it is listed in `WorldBoundary.missing`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import msgspec
import numpy as np
import numpy.typing as npt

from lingjing.mission.instance import Instance
from lingjing.mission.schedule import Occurrence
from lingjing.plugins.engine import CaptureRequest
from lingjing.scene.city import City
from lingjing.trace.records import (
    Absent,
    BodyState,
    Command,
    EngineStatus,
    FrameInfo,
    Receipt,
    Route,
    Snapshot,
    TaskEvent,
)


class WorldBoundary(msgspec.Struct, frozen=True):
    """All engines at one decision boundary."""

    tick: int
    """The boundary's number."""
    time_s: float
    """Simulated time in seconds."""
    snapshots: tuple[Snapshot, ...]
    """The state of all entities at each macro-step of the tick. The last one holds the background movers too."""
    admissions: tuple[Receipt, ...] = ()
    """Admission receipts of the submitted commands, in order."""
    missing: tuple[str, ...] = ()
    """Ids of commands without an admission receipt."""
    receipts: tuple[Receipt, ...] = ()
    """Later receipts of long-running requests."""
    events: tuple[TaskEvent, ...] = ()
    """Task events of the engines."""
    engines: tuple[EngineStatus, ...] = ()
    """Status of each engine."""
    routes: tuple[Route, ...] = ()
    """Routes planned since the boundary before."""
    unreachable_links: tuple[tuple[str, str], ...] = ()
    """Pairs of entities that radio does not connect at this boundary."""


@dataclass(frozen=True, slots=True)
class StoredFrame:
    """A picture in its stored form."""

    info: FrameInfo
    """Pose, boxes and ids. `sha256` is that of the JPEG bytes."""
    jpeg: bytes
    """The JPEG bytes."""
    depth: npt.NDArray[np.float32] | None = field(default=None, repr=False)
    """Depth in metres, (height, width); None if the camera has no such channel."""
    semantic: npt.NDArray[np.uint8] | None = field(default=None, repr=False)
    """Semantic class ids, (height, width); None if the camera has no such channel."""
    instance: npt.NDArray[np.uint16] | None = field(default=None, repr=False)
    """Numbers of entities (`FrameInfo.instance_ids`), (height, width); None if the camera has no such channel."""

    @property
    def layers(self) -> tuple[npt.NDArray[np.generic], ...]:
        """The channels beside the colours, as far as the camera has them."""
        return tuple(layer for layer in (self.depth, self.semantic, self.instance) if layer is not None)


class World(Protocol):
    """The engines of one episode at a time. `reset` starts the next episode on the same workers."""

    @property
    def processes(self) -> Mapping[str, Mapping[str, str]]:
        """The processes of the last episode's engines beside the caller, by name, with the runtime fingerprint of each
        (`lingjing.numerics.runtime_fingerprint`). The camera process is listed from its first picture on.
        """
        ...

    def reset(self, instance: Instance, city: City) -> WorldBoundary:
        """Reset every engine in parallel within `budget.engine_s` and return boundary 0."""
        ...

    def step(self, tick: int, commands: Sequence[Command], occurrences: Sequence[Occurrence] = ()) -> WorldBoundary:
        """Submit `commands`, then advance every motion engine through all macro-steps to boundary `tick`.

        `occurrences` are those of all events before this tick.
        """
        ...

    def capture(
        self,
        tick: int,
        requests: Sequence[CaptureRequest],
        states: Sequence[BodyState],
        occurrences: Sequence[Occurrence] = (),
    ) -> tuple[StoredFrame | Absent, ...]:
        """Draw the pictures of boundary `tick` and return one answer per request, in order.

        `occurrences` are those of all events before this boundary.
        `states` are those of all entities, then of all background movers. A picture later than `budget.capture_s` is
        `Absent`. Raises `InfrastructureError` if the camera has died.
        """
        ...

    def fork(self) -> World:
        """Return a second world that starts as a bit-exact copy of this one at the present boundary."""
        ...

    def close(self) -> None:
        """End all workers. Idempotent."""
        ...
