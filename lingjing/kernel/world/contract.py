"""What the kernel asks of the world: reset, one round trip a tick, pictures, a fork.

A `World` hides where the engines run (`process`: one world process and one camera process; `inline`: the caller) and
how they are coupled. It raises `InfrastructureError`, naming the engine, for everything that makes a boundary
incoherent: an engine that raises, dies, hangs past its deadline or reports a wrong time or a missing entity. A
missing admission receipt is not one of these: it is reported in `missing`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

import msgspec
import numpy as np
import numpy.typing as npt

from lingjing.mission.instance import Instance
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
    """All engines at one decision boundary. `admissions` answer the submitted commands in order; `missing` are the
    ids of commands without an admission receipt; `receipts` are the later ones of long requests.
    Background movers are in the last snapshot; `routes` were planned since the boundary before, `unheard` are the pairs
    of entities between which radio does not reach now."""

    tick: int
    time_s: float
    snapshots: tuple[Snapshot, ...]
    admissions: tuple[Receipt, ...] = ()
    missing: tuple[str, ...] = ()
    receipts: tuple[Receipt, ...] = ()
    events: tuple[TaskEvent, ...] = ()
    engines: tuple[EngineStatus, ...] = ()
    routes: tuple[Route, ...] = ()
    unheard: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True, slots=True)
class StoredFrame:
    """A picture as it is stored: the JPEG and, where declared, depth (float32 metres) and semantic class ids.

    `info.sha256` is that of the JPEG bytes.
    """

    info: FrameInfo
    jpeg: bytes
    depth: npt.NDArray[np.float32] | None = field(default=None, repr=False)
    semantic: npt.NDArray[np.uint8] | None = field(default=None, repr=False)


class World(Protocol):
    """Engines as one. A `World` plays one episode at a time; `reset` starts the next on warm workers."""

    @property
    def processes(self) -> Mapping[str, Mapping[str, str]]:
        """The processes that the last episode's engines run in beside the caller, by name, with what each of them runs
        (`lingjing.numerics.runtime_fingerprint`); that of the sensor engine from the first picture on."""
        ...

    def reset(self, instance: Instance, city: City) -> WorldBoundary:
        """Reset every engine in parallel within `budget.engine_s` and return boundary 0."""
        ...

    def step(self, tick: int, commands: Sequence[Command]) -> WorldBoundary:
        """Submit `commands`, then advance every motion engine through all macro-steps to boundary `tick`."""
        ...

    def capture(
        self, tick: int, requests: Sequence[CaptureRequest], states: Sequence[BodyState]
    ) -> tuple[StoredFrame | Absent, ...]:
        """Draw the pictures of boundary `tick` with all entities, then all background movers, at `states`; one answer
        per request, in order.

        A picture later than `budget.capture_s` is `Absent`; a dead camera raises `InfrastructureError`."""
        ...

    def fork(self) -> World:
        """A second world that starts as a bit-exact copy of this one at the current boundary."""
        ...

    def close(self) -> None:
        """End all workers; idempotent."""
        ...
