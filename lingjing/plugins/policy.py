"""The policy contract: two methods, and the values that they receive and return.

`Brief` and `Observation` never hold a value that the mission marks hidden (the kernel's projection guarantees it),
except in `privileged`, which only a policy declared so receives and which the trace records.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

import msgspec
import numpy as np
import numpy.typing as npt

from lingjing.errors import InfrastructureError, UsageError
from lingjing.mission.instance import (
    ArgumentSpec,
    CameraSpec,
    Cell,
    Datum,
    Entity,
    InspectionSpec,
    Instance,
    LimitSpec,
    MessageSpec,
    Region,
    Vector,
    VerbSpec,
    Weather,
)
from lingjing.mission.model import Field
from lingjing.mission.vocabulary import CLEARED, DORMANT, PHOTO, STOP, VerbMotion
from lingjing.plugins.calls import CallEstimator
from lingjing.scene.city import City
from lingjing.trace.records import (
    DEAD,
    NOTE,
    Absent,
    Action,
    BodyState,
    CameraPose,
    CellView,
    Decision,
    EntityView,
    Envelope,
    EventView,
    FrameInfo,
    Outgoing,
    Receipt,
    Route,
    TaskEvent,
    UnreadBox,
    Usage,
)
from lingjing.trace.request_ids import is_request_of

if TYPE_CHECKING:
    from lingjing.plugins.options import PluginOptions


REFERENCE = "reference"
"""The camera's name in reference pictures (`reveal image(target) to role`), which are shown once, at boundary 0."""


class Resource(msgspec.Struct, frozen=True, kw_only=True):
    """An entity that the agent may command."""

    id: str
    type: str
    embodied: bool
    """True if the agent controls it; False if it has authority over it only."""
    verbs: tuple[VerbSpec, ...]
    """The action schema."""
    cameras: tuple[CameraSpec, ...] = ()
    """The camera mounts."""
    properties: dict[str, Datum] = {}
    """Public properties in SI units, such as `speed_mps`, `band_low_m` and `band_high_m`."""


class Peer(msgspec.Struct, frozen=True, kw_only=True):
    """Another active agent, its role and the ids of the entities that it controls."""

    id: str
    role: str
    resources: tuple[str, ...]


class CameraView(msgspec.Struct, frozen=True, kw_only=True):
    """A camera with pictures that an agent receives. A reference picture counts as one of the camera `REFERENCE`."""

    entity: str
    """The id of the entity that carries the camera; of the target for a reference picture."""
    camera: CameraSpec


class RouteEnds(msgspec.Struct, frozen=True, kw_only=True):
    """The public ends of the route of an inspected vehicle: its place at reset, and its destination."""

    vehicle: str
    start: Vector
    end: Vector


class Brief(msgspec.Struct, frozen=True, kw_only=True):
    """The information that an agent receives at reset. It holds no hidden value."""

    agent: str
    """The agent's id."""
    role: str
    index: int
    """The number of the agent in its group, from 1; 0 for a single one."""
    goal: str
    """The goal of the mission, a sentence."""
    prompt: str
    """The task text of the agent in the mission; "" without one."""
    mode: str
    """The communication mode: `star`, `broadcast` or `single`."""
    hub: str | None
    """The id of the hub's agent; None without a hub."""
    tick_s: float
    """The decision tick, seconds."""
    ticks: int
    """The longest duration of the episode, ticks."""
    seed: int
    """The seed of the policy's own random stream. The instance has another one."""
    resources: tuple[Resource, ...]
    """The entities that the agent may command."""
    peers: tuple[Peer, ...]
    """The other active agents."""
    messages: tuple[MessageSpec, ...]
    """The kinds of messages of the mission."""
    regions: tuple[Region, ...]
    cells: tuple[Cell, ...]
    """The cells of the search grids."""
    classes: tuple[str, ...]
    """The names that the field `class` of a report may have."""
    weather: Weather
    """The weather at boundary 0."""
    water_level_m: float
    """The elevation of the scene's water surface, metres."""
    settings: dict[str, float] = {}
    """The public parameters of the mission."""
    rules: tuple[str, ...] = ()
    """Sentences that state how the mission is won and how it is scored."""
    failures: tuple[str, ...] = ()
    """The part of `rules` that states what ends the mission as a failure."""
    limits: tuple[LimitSpec, ...] = ()
    """The counted budgets of the mission. All agents share each of them."""
    language: str = "en"
    """The code of the language of `goal` and `prompt`."""
    local_rules: tuple[str, ...] = ()
    """`rules` in that language; () where it is English. `rules` stay English, because programs read them."""
    local_failures: tuple[str, ...] = ()
    """`failures` in that language; () where it is English."""
    bounds: tuple[float, float, float, float] | None = None
    """West, south, east and north of the places that a command may name, metres; None for anywhere."""
    payload_bytes: int = 4000
    """The largest message, bytes."""
    delay_ticks: int = 1
    """The ticks from the sending of a message to its delivery."""
    range_m: float | None = None
    """The largest distance between the bodies of sender and recipient, metres; None for any."""
    loss: float = 0.0
    """The probability that a message is lost."""
    road_network: str = ""
    """The file of the roads, for `lingjing.plugins.roads`; "" without roads."""
    route_ends: tuple[RouteEnds, ...] = ()
    """The ends of the routes to inspect."""
    views: tuple[CameraView, ...] = ()
    """The cameras with pictures that the agent receives, then the reference pictures of its role."""
    decision_s: float | None = None
    """The wall clock of one decision, seconds; None if it is not known. A later decision is replaced by a no-op, so a
    policy should give up before and state why."""


@dataclass(frozen=True, slots=True)
class Picture:
    """A stored picture as the policy receives it, without ground truth."""

    frame: str
    """The picture's id."""
    entity: str
    camera: str
    """The name of the camera mount, or `REFERENCE`."""
    tick: int
    """The boundary at which it was taken."""
    time_s: float
    pose: CameraPose
    rgb: npt.NDArray[np.uint8]
    """The decoded `jpeg`, (height, width, 3)."""
    depth: npt.NDArray[np.float32] | None = None
    """(height, width), metres along the optical axis in whole centimetres, inf where a ray hits nothing."""
    semantic: npt.NDArray[np.uint8] | None = None
    """(height, width), class ids, without hidden entities."""
    instance: npt.NDArray[np.uint16] | None = None
    """(height, width), numbers of entities without hidden ones, 0 where there is none."""
    instance_ids: Mapping[str, int] = field(default_factory=dict)
    """The numbers of the entities in `instance`, by entity."""
    jpeg: bytes = b""
    """The stored file."""


class Privileged(msgspec.Struct, frozen=True, kw_only=True):
    """The truth, for policies that are declared `privileged` only. The digest of a trace does not cover it."""

    instance: Instance
    """The instance with its hidden values."""
    states: tuple[BodyState, ...]
    """The states of all entities."""
    frames: tuple[FrameInfo, ...]
    """The agent's pictures with the boxes of their targets."""
    achieved: tuple[tuple[str, tuple[str, ...]], ...]
    """The (rule, entities) that have become true."""
    emitted: tuple[tuple[str, tuple[str, ...]], ...] = ()
    """The (kind, entities) of the task events of engines so far."""
    routes: tuple[Route, ...] = ()
    """The latest route of each vehicle."""
    inspected: dict[str, tuple[int, ...]] = {}
    """The places of the waypoints that were seen on the latest route, by inspection."""
    used: dict[str, int] = {}
    """The counts of counted budgets."""
    forbidden: tuple[tuple[str, str], ...] = ()
    """The (resource, verb) pairs of permits that do not hold now."""
    city: City | None = None
    """The static world."""


@dataclass(frozen=True, slots=True)
class Observation:
    """The observation of an agent at a boundary. Immutable; the trace records the same object."""

    agent: str
    tick: int
    """The number of the boundary."""
    time_s: float
    """Simulation time, seconds."""
    entities: tuple[EntityView, ...] = ()
    """The entities that the agent observes, with the fields that it observes."""
    cells: tuple[CellView, ...] = ()
    events: tuple[EventView, ...] = ()
    """The events since the last boundary."""
    pictures: tuple[Picture, ...] = ()
    """The pictures since the last boundary."""
    absent: tuple[Absent, ...] = ()
    """The pictures that were requested and not delivered, with the reason."""
    privileged: Privileged | None = None
    """The truth; None unless the policy is declared `privileged`."""
    weather: Weather = Weather()  # noqa: RUF009 - a frozen value
    """The weather at this boundary."""


class Inbox(msgspec.Struct, frozen=True, kw_only=True):
    """Messages delivered and receipts visible at this boundary, in a fixed order."""

    messages: tuple[Envelope, ...] = ()
    receipts: tuple[Receipt, ...] = ()


class NoDecisionError(Exception):
    """Raised by `act` without a decision at this tick. The text states the reason, `usage` the cost all the same.

    Every other exception of `act` counts the same, without the usage. So does `InfrastructureError`, unless the harness
    finds from outside of the policy that its infrastructure is gone (`PolicyPlugin.probe`): this ends the episode as
    an infrastructure abort.
    """

    def __init__(self, message: str, usage: Usage | None = None) -> None:
        super().__init__(message)
        self.usage = usage


class Policy(Protocol):
    """The policy of one agent: one object for each agent and episode.

    Under `lingjing run` and `bench` each is in a process of its own; in the Python API each call runs in a worker
    thread with its own loop.
    """

    async def reset(self, brief: Brief) -> None:
        """Receive the brief. Called once before boundary 0's first `act`."""
        ...

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        """Return at most one physical command and a finite list of messages for the next boundary."""
        ...


BrokerFactory = Callable[[Mapping[str, Any], Any], Any]
"""Called with the options by name and a `lingjing.plugins.calls.ModelCalls`; returns a `ModelBroker`."""

ServiceProbe = Callable[[Any], Awaitable[str]]
"""Called with an object of the policy's model of options."""


@dataclass(frozen=True, slots=True)
class PolicyPlugin:
    """The declaration of a policy through the hook `lingjing_policies`."""

    name: str
    factory: Callable[..., Policy]
    """Returns the policy object of one agent. It takes an object of the model `options`; without a model its own
    parameters are the options."""
    privileged: bool = False
    """True if the policy receives the truth (`Observation.privileged`)."""
    summary: str = ""
    options: type[PluginOptions] | str | None = None
    """The model of its options, a subclass of `lingjing.plugins.options.PluginOptions`, as a class or as
    `package.module:Class`, which is imported when it is needed."""
    calls: bool = False
    """True if the policy calls chat models: its factory then takes a `lingjing.plugins.calls.ModelCalls` as well. It
    needs a model of its options."""
    probe: ServiceProbe | None = None
    """Takes the options and requests a sign of life from the policy's service. Returns "", or the reason for which
    there is none. The harness calls it after an `InfrastructureError` of the policy. None for a policy without a
    service: its errors are its own failures."""
    broker: BrokerFactory | None = None
    """Takes the options and the record of calls, and returns the broker of the policy behind walls. The harness calls
    it in a process of its own. Policies without one, such as those in files, have that of `react`, which reads the
    options that name a model and its service."""
    imports: tuple[str, ...] = ()
    """Modules that every agent of the policy needs. For trusted plug-ins they are imported once, in the process from
    which agents are forked: they must start no thread and open no graphics."""
    estimate: CallEstimator | None = None
    """Returns the estimated model calls of an episode, for prices before a suite starts. None: unknown."""


__all__ = [
    "CLEARED", "DEAD", "DORMANT", "NOTE", "PHOTO", "REFERENCE", "STOP", "Absent", "Action", "ArgumentSpec", "BodyState",
    "Brief", "BrokerFactory", "CameraPose", "CameraSpec", "CameraView", "Cell", "CellView", "City", "Datum", "Decision",
    "Entity", "EntityView", "Envelope", "EventView", "Field", "FrameInfo", "Inbox", "InfrastructureError",
    "InspectionSpec", "Instance", "LimitSpec", "MessageSpec", "NoDecisionError", "Observation", "Outgoing", "Peer",
    "Picture", "Policy", "PolicyPlugin", "Privileged", "Receipt", "Region", "Resource", "Route", "RouteEnds",
    "ServiceProbe", "TaskEvent", "UnreadBox", "Usage", "UsageError", "Vector", "VerbMotion", "VerbSpec", "Weather",
    "is_request_of",
]  # fmt: skip
