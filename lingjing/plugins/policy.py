"""The policy contract: two methods, what an agent may know, what it sees, and what it answers.

`Brief` and `Observation` never hold a value that the mission marks hidden (the kernel's projection guarantees it),
except in `privileged`, which only a policy declared so receives and which the trace records.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from dataclasses import dataclass
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
    MessageSpec,
    Region,
    Vector,
    VerbSpec,
    Weather,
)
from lingjing.mission.model import Field
from lingjing.mission.vocabulary import PHOTO, STOP, VerbMotion
from lingjing.scene.city import City
from lingjing.trace.records import (
    CLEARED,
    DEAD,
    DORMANT,
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
    Usage,
)
from lingjing.trace.request_ids import is_request_of

if TYPE_CHECKING:
    from lingjing.plugins.options import PluginOptions


REFERENCE = "reference"
"""The camera's name in reference pictures (`reveal image(target) to role`), which are shown once, at boundary 0."""


class Resource(msgspec.Struct, frozen=True, kw_only=True):
    """Something the agent may command: its type, action schema and camera mounts. `embodied` if it controls it;
    `properties` are the public ones (SI units), such as `speed_mps` and `band_low_m`, `band_high_m`."""

    id: str
    type: str
    embodied: bool
    verbs: tuple[VerbSpec, ...]
    cameras: tuple[CameraSpec, ...] = ()
    properties: dict[str, Datum] = {}


class Peer(msgspec.Struct, frozen=True, kw_only=True):
    """Another active agent, its role and what it embodies."""

    id: str
    role: str
    resources: tuple[str, ...]


class RouteEnds(msgspec.Struct, frozen=True, kw_only=True):
    """Where the route of an inspected vehicle begins (its place at reset) and ends, both public."""

    vehicle: str
    start: Vector
    end: Vector


class Brief(msgspec.Struct, frozen=True, kw_only=True):
    """All an agent is told at reset. `seed` starts the policy's own random stream and
    says nothing about the instance's; `classes` are the names a
    report's `class` may have; `water_level_m` is the elevation of the scene's water surface; `weather` is that of
    boundary 0.

    `rules` says in sentences how the mission is won and what counts, without a hidden value. A command may send a body
    to places within `bounds` (west, south, east, north in metres; None: anywhere). A message of at most `payload_bytes`
    arrives `delay_ticks` after it was sent, at agents whose bodies are within `range_m` (None: at any distance), and is
    lost with probability `loss`. `road_network` is the file of the roads (`lingjing.plugins.roads` reads it) or "".
    `route_ends` are those of the routes that are to be inspected. A decision that takes longer than `decision_s`
    seconds (None: not known) is replaced by one to do nothing; a policy that stops waiting before that can say why.
    """

    agent: str
    role: str
    index: int
    goal: str
    prompt: str
    mode: str
    hub: str | None
    tick_s: float
    ticks: int
    seed: int
    resources: tuple[Resource, ...]
    peers: tuple[Peer, ...]
    messages: tuple[MessageSpec, ...]
    regions: tuple[Region, ...]
    cells: tuple[Cell, ...]
    classes: tuple[str, ...]
    weather: Weather
    water_level_m: float
    settings: dict[str, float] = {}
    rules: tuple[str, ...] = ()
    bounds: tuple[float, float, float, float] | None = None
    payload_bytes: int = 4000
    delay_ticks: int = 1
    range_m: float | None = None
    loss: float = 0.0
    road_network: str = ""
    route_ends: tuple[RouteEnds, ...] = ()
    decision_s: float | None = None


@dataclass(frozen=True, slots=True)
class Picture:
    """A stored picture as the policy receives it: `rgb` is the decoded `jpeg`, (height, width, 3) uint8; `depth`
    (height, width) float32 metres along the optical axis in whole centimetres, inf where nothing is hit; `semantic`
    (height, width) uint8 class ids, without what is hidden. No ground truth."""

    frame: str
    entity: str
    camera: str
    tick: int
    time_s: float
    pose: CameraPose
    rgb: npt.NDArray[np.uint8]
    depth: npt.NDArray[np.float32] | None = None
    semantic: npt.NDArray[np.uint8] | None = None
    jpeg: bytes = b""


class Privileged(msgspec.Struct, frozen=True, kw_only=True):
    """The truth, for policies declared `privileged` only: the instance, all states, and the boxes of the agent's
    frames.

    `emitted` are the (kind, entities) of the engines' task events so far, `routes` each vehicle's latest route,
    `inspected` the places of the waypoints that each inspection has seen on the latest, `used` what counted budgets
    have counted, `forbidden` the (resource, verb) pairs of the permits that do not hold now. `city` is the static
    world; like everything here it is no part of what the digest covers.
    """

    instance: Instance
    states: tuple[BodyState, ...]
    frames: tuple[FrameInfo, ...]
    achieved: tuple[tuple[str, tuple[str, ...]], ...]
    emitted: tuple[tuple[str, tuple[str, ...]], ...] = ()
    routes: tuple[Route, ...] = ()
    inspected: dict[str, tuple[int, ...]] = {}
    used: dict[str, int] = {}
    forbidden: tuple[tuple[str, str], ...] = ()
    city: City | None = None


@dataclass(frozen=True, slots=True)
class Observation:
    """What an agent sees at boundary `tick`. Immutable; the same object is what the trace records.

    `weather` is that of this boundary, whether an event has changed it since the brief's or not.
    """

    agent: str
    tick: int
    time_s: float
    entities: tuple[EntityView, ...] = ()
    cells: tuple[CellView, ...] = ()
    events: tuple[EventView, ...] = ()
    pictures: tuple[Picture, ...] = ()
    absent: tuple[Absent, ...] = ()
    privileged: Privileged | None = None
    weather: Weather = Weather()  # noqa: RUF009 - a frozen value


class Inbox(msgspec.Struct, frozen=True, kw_only=True):
    """Messages delivered and receipts visible at this boundary, in a fixed order."""

    messages: tuple[Envelope, ...] = ()
    receipts: tuple[Receipt, ...] = ()


class NoDecisionError(Exception):
    """Raised by `act` if there is no decision this tick: the text says why, `usage` is what was spent all the same.

    Whatever else `act` raises counts the same but for the usage. So does `InfrastructureError`, unless the harness
    finds from outside of the policy that its infrastructure is gone (`PolicyPlugin.probe`): this ends the episode as
    an infrastructure abort.
    """

    def __init__(self, message: str, usage: Usage | None = None) -> None:
        super().__init__(message)
        self.usage = usage


class Policy(Protocol):
    """An agent's mind. One object per agent and episode.

    Under `lingjing run` and `bench` each is in a process of its own; in the Python API each call runs in a worker
    thread with its own loop.
    """

    async def reset(self, brief: Brief) -> None:
        """Called once before boundary 0's first `act`."""
        ...

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        """At most one physical command and a finite list of messages for the next boundary."""
        ...


ServiceProbe = Callable[[Any], Awaitable[str]]
"""Called with an object of the policy's model of options."""


@dataclass(frozen=True, slots=True)
class PolicyPlugin:
    """How a policy is declared through the hook `lingjing_policies`. `privileged` policies see the truth.

    `options` is the model of its options (`lingjing.plugins.options.PluginOptions`) as a class or, so that nothing
    heavy is loaded before it is needed, as `package.module:Class`. `factory` takes an object of that model and returns
    one policy object per agent; without a model the factory's parameters are the options. A policy with such a model
    that asks chat models says so by `calls`: its factory then takes a `lingjing.plugins.calls.ModelCalls` as well.

    `probe` takes the options and asks the service that the policy depends on for a sign of life; it returns "" or why
    there is none. The harness awaits it when the policy raises `InfrastructureError`. None: the policy depends on
    nothing that can be gone, so that what it raises is its own failure.

    `imports` are modules that every agent of the policy needs. Where the plug-in is trusted they are imported once in
    the process that agents are forked from: they start no thread and open no graphics.
    """

    name: str
    factory: Callable[..., Policy]
    privileged: bool = False
    summary: str = ""
    options: type[PluginOptions] | str | None = None
    calls: bool = False
    probe: ServiceProbe | None = None
    imports: tuple[str, ...] = ()


__all__ = [
    "CLEARED", "DEAD", "DORMANT", "PHOTO", "REFERENCE", "STOP", "Absent", "Action", "ArgumentSpec", "BodyState",
    "Brief", "CameraPose", "CameraSpec", "Cell", "CellView", "City", "Datum", "Decision", "Entity", "EntityView",
    "Envelope", "EventView", "Field", "FrameInfo", "Inbox", "InfrastructureError", "InspectionSpec", "Instance",
    "MessageSpec", "NoDecisionError", "Observation", "Outgoing", "Peer", "Picture", "Policy", "PolicyPlugin",
    "Privileged", "Receipt", "Region", "Resource", "Route", "RouteEnds", "ServiceProbe", "TaskEvent", "Usage",
    "UsageError", "Vector", "VerbMotion", "VerbSpec", "Weather", "is_request_of",
]  # fmt: skip
