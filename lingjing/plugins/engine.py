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
from lingjing.mission.schedule import Schedule
from lingjing.scene.camera_geometry import CameraPlacement
from lingjing.scene.city import City
from lingjing.scene.picture_weather import PictureWeather
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
    events: Schedule | None = None
    """The schedule that the world updates before each tick; None for that of the timed events alone."""

    @property
    def schedule(self) -> Schedule:
        """Weather, presence of entities and values that events set, over time. Keep the object: the world updates
        it."""
        return Schedule(self.instance) if self.events is None else self.events

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
    """A request for one picture of the present world."""

    frame: str
    """The id that the picture gets."""
    entity: str
    """The entity with the camera; with a `pose`, the entity in the picture."""
    camera: str
    """The name of the camera mount."""
    tick: int
    """The boundary of the picture."""
    time_s: float
    """Simulation time, seconds."""
    pose: CameraPose | None = None
    """The pose to take the picture from; None for that of the mount. Such a picture has the channel rgb alone."""
    placement: CameraPlacement | None = None
    """A place and a lens of the camera that replace those of its mount: `takePhoto` with the arguments of
    `CameraPlacement`, which the drones of a free flight have."""
    weather: PictureWeather | None = None
    """Values that replace those of the mission's weather in this picture: `takePhoto` with the arguments of
    `PictureWeather`, which the drones of a free flight have."""


@dataclass(frozen=True, slots=True)
class Frame:
    """A captured picture."""

    info: FrameInfo
    """The picture's description. `boxes` is the exact ground truth, `faint` the drawn targets that are too faint to
    see."""
    rgb: npt.NDArray[np.uint8]
    """(height, width, 3)."""
    depth: npt.NDArray[np.float32] | None = None
    """(height, width), metres along the optical axis, inf where a ray hits nothing; None if the camera declares no
    depth."""
    semantic: npt.NDArray[np.uint8] | None = None
    """(height, width), class ids; None if the camera declares none. Policies receive it, so entities with a hidden
    value are not in it."""
    quality: int = JPEG_QUALITY
    """The quality of the stored JPEG, 1 to 100."""
    instance: npt.NDArray[np.uint16] | None = None
    """(height, width), numbers of entities (`FrameInfo.instance_ids`), 0 where there is none; None if the camera
    declares none. Policies receive it, so entities with a hidden value are not in it."""


class Engine(Protocol):
    """The five methods of an engine. An exception in a method ends the episode as an infrastructure abort."""

    def reset(self, spec: EngineSpec, city: City, seed: int) -> Boundary:
        """Build the engine's world and return READY(0): a boundary at time 0 with every owned entity."""
        ...

    def submit(self, commands: Sequence[Command]) -> tuple[Receipt, ...]:
        """Admit or reject commands. Returns exactly one `accepted` or `rejected` receipt for each, in order."""
        ...

    def advance(self, until: float, mirrors: Sequence[BodyState]) -> Boundary:
        """Advance to simulation time `until` (s). `mirrors` are all entities of other engines at the interval's
        start; extrapolate them by their velocity where it matters. Returns every owned entity at `until`, and
        `running`/`completed`/`rejected` receipts of long requests. `running` at most once per call and request."""
        ...

    def capture(self, requests: Sequence[CaptureRequest]) -> tuple[Frame, ...]:
        """Return pictures of the world as of the last `advance`. Engines without sensors return ()."""
        ...

    def close(self) -> None:
        """Release everything; called once, also after a failure."""
        ...


@runtime_checkable
class KeyedPictures(Protocol):
    """An optional method of a sensor engine: variants of an episode then draw equal pictures once."""

    def picture_key(self, request: CaptureRequest) -> bytes:
        """Return a key of the picture of a request, as of the last `advance`.

        Since a reset, pictures of one mount with equal keys are equal, except for their ids and ticks. A key must cost
        much less than the picture.
        """
        ...


@dataclass(frozen=True, slots=True)
class EnginePlugin:
    """The declaration of an engine through the hook `lingjing_engines`."""

    name: str
    """The name that a type gives after `engine =`."""
    factory: Callable[[], Engine]
    """Returns an engine. Heavy imports belong here."""
    place: Literal["world", "camera", "remote"] = "world"
    """The process that hosts the engine: `world` (local motion; can be forked), `camera` (has a GL context; cannot be
    forked), `remote` (a bridge to a simulator outside; runs in the caller)."""
    sensor: bool = False
    """True if the engine answers `capture`. It is then advanced once a tick, after the motion engines."""
    native_dt_s: float = 0.01
    """The engine's own step, seconds. A mission's `sync` must not be shorter."""
    summary: str = ""
    wanted: Callable[[Instance], bool] | None = None
    """Returns True for an instance that needs the engine although the engine owns no entity of it (traffic, radio)."""
    options: type[PluginOptions] | str | None = None
    """The model of its options (`--engine-arg NAME.OPTION=VALUE`), as a class or as `package.module:Class`. The engine
    reads them with `lingjing.plugins.options.engine_options`."""


__all__ = [
    "BodyState", "Boundary", "CameraPose", "CaptureRequest", "City", "Command", "Engine", "EnginePlugin", "EngineSpec",
    "Frame", "FrameInfo", "KeyedPictures", "Receipt", "Route", "TaskEvent",
]  # fmt: skip
