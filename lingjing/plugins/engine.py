"""The engine contract: five methods, the values they exchange, and the declaration that makes an engine known.

An engine owns entities; each entity has exactly one owner. A tick is split into macro-steps of `clock.sync_s`; at
each, every engine advances by the same interval and then receives the others' states as mirrors (fixed-step Jacobi
co-simulation). The conformance kit (`lingjing.plugins.conformance`) tests every promise made here.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, Protocol, runtime_checkable

import msgspec
import numpy as np
import numpy.typing as npt

from lingjing.mission.instance import Entity, Instance
from lingjing.scene.city import City
from lingjing.trace.images import JPEG_QUALITY
from lingjing.trace.records import BodyState, CameraPose, Command, FrameInfo, Receipt, Route, TaskEvent

if TYPE_CHECKING:
    from lingjing.plugins.options import PluginOptions


class EngineSpec(msgspec.Struct, frozen=True, kw_only=True):
    """The argument of an engine's `reset`."""

    engine: str
    """The engine's name."""
    instance: Instance
    """The whole instance with its hidden values: engines are trusted."""
    owns: tuple[str, ...]
    """The ids of the entities that the engine owns."""

    def owned(self) -> tuple[Entity, ...]:
        """The owned entities in declaration order."""
        mine = set(self.owns)
        return tuple(entity for entity in self.instance.entities if entity.id in mine)


_RENAMED = "use `unreachable_links` instead of `unheard`"


class _BoundaryMeta(msgspec.StructMeta):
    """Accepts the argument `unheard` of version 1.0 of the contract."""

    def __call__(cls, *arguments: Any, **fields: Any) -> Any:  # noqa: N805 - the class is the object here
        if "unheard" in fields:
            warnings.warn(_RENAMED, DeprecationWarning, stacklevel=2)
            fields["unreachable_links"] = fields.pop("unheard")
        return super().__call__(*arguments, **fields)


class Boundary(msgspec.Struct, frozen=True, kw_only=True, metaclass=_BoundaryMeta):
    """The report of an engine that has reached `time_s`."""

    engine: str
    """The engine's name."""
    time_s: float
    """Simulation time, seconds."""
    states: tuple[BodyState, ...] = ()
    """Every owned entity."""
    receipts: tuple[Receipt, ...] = ()
    """Receipts of long requests since the last boundary."""
    events: tuple[TaskEvent, ...] = ()
    """Task events since the last boundary."""
    routes: tuple[Route, ...] = ()
    """Routes that were planned since the last boundary."""
    ambient: tuple[BodyState, ...] = ()
    """Movers that are no entities, such as background traffic. Other engines and cameras receive them as mirrors after
    the entities."""
    unreachable_links: tuple[tuple[str, str], ...] = msgspec.field(default=(), name="unheard")
    """Pairs of entities without a radio link now, each pair in the order of the instance. Reported by the city engine.
    The encoded name is `unheard`."""

    @property
    def unheard(self) -> tuple[tuple[str, str], ...]:
        """Deprecated since version 1.1 of the contract: use `unreachable_links`."""
        warnings.warn(_RENAMED, DeprecationWarning, stacklevel=2)
        return self.unreachable_links


class CaptureRequest(msgspec.Struct, frozen=True, kw_only=True):
    """Take one picture now: `frame` is the id it will have, `entity` and `camera` name the mount.

    With a `pose` the picture is taken from there, of the entity; its channel is rgb alone.
    """

    frame: str
    entity: str
    camera: str
    tick: int
    time_s: float
    pose: CameraPose | None = None


@dataclass(frozen=True, slots=True)
class Frame:
    """A captured picture, to be stored as a JPEG of `quality` (1..100).

    `info.boxes` is the exact ground truth, without `info.faint`: targets that were drawn and that nobody can see.
    `rgb` is (height, width, 3) uint8; `depth` (height, width) float32 metres along the optical axis, inf where
    nothing is hit, or None if not declared; `semantic` (height, width) uint8 class ids, or None: policies get
    it, so it shows what would be drawn without the entities that have a hidden value.
    """

    info: FrameInfo
    rgb: npt.NDArray[np.uint8]
    depth: npt.NDArray[np.float32] | None = None
    semantic: npt.NDArray[np.uint8] | None = None
    quality: int = JPEG_QUALITY


class Engine(Protocol):
    """The whole contract. Every method may raise; the kernel turns that into an infrastructure abort."""

    def reset(self, spec: EngineSpec, city: City, seed: int) -> Boundary:
        """Build the engine's world and return READY(0): a boundary at time 0 with every owned entity."""
        ...

    def submit(self, commands: Sequence[Command]) -> tuple[Receipt, ...]:
        """Admission only: exactly one `accepted` or `rejected` receipt for each command, in order."""
        ...

    def advance(self, until: float, mirrors: Sequence[BodyState]) -> Boundary:
        """Advance to simulation time `until` (s). `mirrors` are all entities of other engines at the interval's
        start; extrapolate them by their velocity where it matters. Returns every owned entity at `until`, and
        `running`/`completed`/`rejected` receipts of long requests. `running` at most once per call and request."""
        ...

    def capture(self, requests: Sequence[CaptureRequest]) -> tuple[Frame, ...]:
        """Pictures of the world as of the last `advance`. Engines without sensors return ()."""
        ...

    def close(self) -> None:
        """Release everything; called once, also after a failure."""
        ...


@runtime_checkable
class KeyedPictures(Protocol):
    """What a sensor engine may have beside `Engine`, so that variants of an episode need not draw a picture twice."""

    def picture_key(self, request: CaptureRequest) -> bytes:
        """What the picture of a request depends on, as of the last `advance`: since a reset, pictures of one mount with
        equal keys are equal, but for their ids and ticks. Much cheaper than the picture."""
        ...


@dataclass(frozen=True, slots=True)
class EnginePlugin:
    """How an engine is declared through the hook `lingjing_engines`.

    `name` is what a type names after `engine =`; `place` says which process hosts it: `world` (local motion, can be
    forked), `camera` (owns a GL context, cannot), `remote` (a bridge to something outside, runs in the caller).
    `sensor` engines answer `capture` and are advanced once a tick, after the motion barrier. `factory` does the
    heavy imports. `native_dt_s` is documentation and a bound on `sync`. A motion engine takes part in an episode if it
    owns an entity or if `wanted` says so of the instance: traffic and radio matter without an entity of their own.
    `options` is the model of what the engine can be told for an episode (`--engine-arg NAME.OPTION=VALUE`), as a class
    or, so that nothing heavy is loaded before it is needed, as `package.module:Class`; the engine reads them with
    `lingjing.plugins.options.engine_options`.
    """

    name: str
    factory: Callable[[], Engine]
    place: Literal["world", "camera", "remote"] = "world"
    sensor: bool = False
    native_dt_s: float = 0.01
    summary: str = ""
    wanted: Callable[[Instance], bool] | None = None
    options: type[PluginOptions] | str | None = None


__all__ = [
    "BodyState", "Boundary", "CameraPose", "CaptureRequest", "City", "Command", "Engine", "EnginePlugin", "EngineSpec",
    "Frame", "FrameInfo", "KeyedPictures", "Receipt", "Route", "TaskEvent",
]  # fmt: skip
