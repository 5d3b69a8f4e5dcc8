"""`Instance`: a mission with seed, mode and settings applied; the reset specification S of the paper.

Everything is a plain value in SI units and degrees except the rules, which stay expressions over run-time state.
Two instances of one (mission, seed, mode, settings) are equal; the trace records it whole, so a replay needs no
mission file. World frame: east, north, elevation over the scene's datum, metres (DESIGN section 4).
"""

from __future__ import annotations

from typing import Literal

from lingjing.mission.expression import Expr
from lingjing.mission.model import Field, Record, Relation, Rule, Stage, Unlock

Vector = tuple[float, float, float]
Scalar = bool | int | float | str
Datum = bool | int | float | str | tuple[bool | int | float | str, ...] | None
"""A value that may stand in an action's arguments, a message body or an entity's property."""


class Clock(Record, frozen=True, kw_only=True):
    """Decision tick and macro-step in seconds; `tick` is a whole multiple of `sync`."""

    tick_s: float
    sync_s: float


class Budget(Record, frozen=True, kw_only=True):
    """Ticks, and wall-clock seconds for the policy, engine and capture barriers."""

    ticks: int
    policy_s: float
    engine_s: float
    capture_s: float


class Weather(Record, frozen=True, kw_only=True):
    """Boundary conditions of the air and the sea. Directions are compass degrees, wind *from*, current *towards*."""

    wind_mps: float = 0.0
    wind_from_deg: float = 0.0
    turbulence: float = 0.0
    visibility_m: float = 10_000.0
    wave_height_m: float = 0.0
    wave_period_s: float = 5.0
    current_mps: float = 0.0
    current_to_deg: float = 0.0
    cloud: float = 0.2
    sun_azimuth_deg: float = 150.0
    sun_elevation_deg: float = 45.0


class Region(Record, frozen=True, kw_only=True):
    """A polygon in metres, anticlockwise, without the closing repeat."""

    name: str
    polygon: tuple[tuple[float, float], ...]


class Cell(Record, frozen=True, kw_only=True):
    """One search cell, named `<grid>-<row>-<column>` from 1 at the south-west; the polygon includes the overlap."""

    name: str
    grid: str
    row: int
    column: int
    polygon: tuple[tuple[float, float], ...]
    centre: tuple[float, float]


class CameraSpec(Record, frozen=True, kw_only=True):
    """A camera mount: pixels, horizontal field of view in degrees, channels among rgb, depth, semantic."""

    name: str
    view: Literal["nadir", "front", "oblique"]
    width: int
    height: int
    hfov_deg: float
    channels: tuple[str, ...]
    capture: Literal["on_request", "each_tick"]


class ArgumentSpec(Record, frozen=True, kw_only=True):
    """One argument of a verb. Values outside [minimum, maximum] are clipped by the kernel, which says so."""

    name: str
    unit: str = ""
    minimum: float | None = None
    maximum: float | None = None
    default: float | None = None
    optional: bool = False


class VerbSpec(Record, frozen=True, kw_only=True):
    """One admissible command of a resource."""

    name: str
    arguments: tuple[ArgumentSpec, ...] = ()
    doc: str = ""


class Entity(Record, frozen=True, kw_only=True):
    """An asset or a target with one owning engine.

    `id` is `uav[1]` for the member of a group, else the bare name. `properties` holds what the declaration and its
    type say beyond the named fields, in SI units (`drift_mps`, `speed_mps`, …: see `lingjing.mission.instantiate`).
    `hidden` names the properties (and `position`) that must never reach a policy.
    """

    id: str
    group: str
    index: int
    role: Literal["asset", "target"]
    type: str
    engine: str
    position: Vector
    heading_deg: float = 0.0
    label: str = ""
    properties: dict[str, Datum] = {}
    hidden: tuple[str, ...] = ()
    cameras: tuple[CameraSpec, ...] = ()
    verbs: tuple[VerbSpec, ...] = ()


class ChannelSpec(Record, frozen=True, kw_only=True):
    """An observation channel with everything resolved.

    `source` is one of `entity`, `peers`, `grid`, `events`; `name` the entity id or the grid's name, else "".
    """

    source: Literal["entity", "peers", "grid", "events"]
    name: str = ""
    fields: tuple[str, ...] = ("*",)


class AgentSpec(Record, frozen=True, kw_only=True):
    """An active agent. `commands` lists every resource it may command in declaration order, embodied ones first."""

    id: str
    name: str
    index: int
    role: str
    controls: tuple[str, ...]
    commands: tuple[str, ...]
    observes: tuple[ChannelSpec, ...]
    prompt: str = ""


class MessageSpec(Record, frozen=True, kw_only=True):
    """A message kind open in this mode: who may send it, which roles may receive it (("all",) for everyone)."""

    kind: str
    type: str
    category: Literal["report", "assignment", "target_status", "other"]
    fields: tuple[Field, ...]
    senders: tuple[str, ...]
    recipients: tuple[str, ...]


class CommsSpec(Record, frozen=True, kw_only=True):
    """Bus settings of this instance: `hub` is an agent id in star mode, None in broadcast."""

    mode: Literal["star", "broadcast"]
    hub: str | None
    delay_ticks: int = 1
    payload_bytes: int = 4000


class SceneSpec(Record, frozen=True, kw_only=True):
    """Which provider builds the city and with what: `origin` is (latitude, longitude) in degrees, `datum_m` the
    elevation of the water surface, `options` the provider's own, `seed` the scene's stream."""

    kind: str
    datum_m: float = 0.0
    origin: tuple[float, float] = (31.0, 121.5)
    options: dict[str, Datum] = {}
    seed: int = 0


class Instance(Record, frozen=True, kw_only=True):
    """The whole reset specification."""

    format: Literal["lingjing-instance/1"] = "lingjing-instance/1"
    mission: str
    title: str
    goal: str
    seed: int
    settings: dict[str, float]
    scene: SceneSpec
    clock: Clock
    budget: Budget
    weather: Weather
    regions: tuple[Region, ...]
    cells: tuple[Cell, ...]
    entities: tuple[Entity, ...]
    agents: tuple[AgentSpec, ...]
    messages: tuple[MessageSpec, ...]
    comms: CommsSpec
    rules: tuple[Rule, ...]
    unlocks: tuple[Unlock, ...]
    stages: tuple[Stage, ...]
    relations: tuple[Relation, ...]
    success: Expr
    failure: Expr | None = None

    @property
    def mode(self) -> str:
        """`star` or `broadcast`."""
        return self.comms.mode


