"""`Instance`: a mission with seed, mode and settings applied; the reset specification S of the paper.

Everything is a plain value in SI units and degrees except the rules, which stay expressions over run-time state.
Two instances of one (mission, seed, mode, settings) are equal; the trace records it whole, so a replay needs no
mission file. World frame: east, north, elevation over the scene's datum, metres.
"""

from __future__ import annotations

from typing import Any, Literal

from lingjing.mission.expression import Expr
from lingjing.mission.model import (
    BodyPart,
    CameraMount,
    Constraint,
    Exchange,
    Field,
    Record,
    Relation,
    Rule,
    Stage,
    Unlock,
)
from lingjing.mission.vocabulary import EVERYONE, VerbMotion

Vector = tuple[float, float, float]
Scalar = bool | int | float | str
Datum = bool | int | float | str | tuple[bool | int | float | str, ...] | None
"""A value that may stand in an action's arguments, a message body or an entity's property."""
Option = bool | int | float | str | tuple[bool | int | float | str | tuple[float, float], ...] | None
"""A value of a scene's option; a line or an outline is its points, (east, north) in metres."""
GivenOption = bool | int | float | str | list[Any] | dict[str, Any] | None
"""What an option of a plug-in is given: any JSON."""


class Clock(Record, frozen=True, kw_only=True):
    """Decision tick and macro-step in seconds; `tick` is a whole multiple of `sync`."""

    tick_s: float
    sync_s: float


class Budget(Record, frozen=True, kw_only=True):
    """Ticks, wall-clock seconds for the policy, engine and capture barriers, and what all policies may spend (None: no
    limit)."""

    ticks: int
    policy_s: float
    engine_s: float
    capture_s: float
    tokens: int | None = None
    money_usd: float | None = None
    messages: int | None = None


class Allowance(Record, frozen=True, kw_only=True):
    """What one agent may spend in an episode; None: no limit of its own."""

    tokens: int | None = None
    money_usd: float | None = None
    messages: int | None = None


class Weather(Record, frozen=True, kw_only=True):
    """Boundary conditions of the air and the sea. Directions are compass degrees, wind *from*, current *towards*.
    `cloud` and `rain` run from 0 to 1: the covered share of the sky, and dry to a downpour."""

    wind_mps: float = 0.0
    wind_from_deg: float = 0.0
    turbulence: float = 0.0
    visibility_m: float = 10_000.0
    wave_height_m: float = 0.0
    wave_period_s: float = 5.0
    current_mps: float = 0.0
    current_to_deg: float = 0.0
    cloud: float = 0.2
    rain: float = 0.0
    sun_azimuth_deg: float = 150.0
    sun_elevation_deg: float = 45.0


class Region(Record, frozen=True, kw_only=True):
    """A polygon in metres, anticlockwise, without the closing repeat.

    Only the city knows where a road lies: a region made of roads has `on_map`, its shape, and no polygon until the
    scene is built. A `hidden` one lies around something hidden and must never reach a policy.
    """

    name: str
    polygon: tuple[tuple[float, float], ...]
    on_map: Expr | None = None
    hidden: bool = False


class Cell(Record, frozen=True, kw_only=True):
    """One search cell, named `<grid>-<row>-<column>` from 1 at the south-west; the polygon includes the overlap.
    Those of a `hidden` region must never reach a policy."""

    name: str
    grid: str
    row: int
    column: int
    polygon: tuple[tuple[float, float], ...]
    centre: tuple[float, float]
    hidden: bool = False


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
    """One admissible command of a resource; `motion` and, where its type says nothing, `doc` are its engine's words."""

    name: str
    arguments: tuple[ArgumentSpec, ...] = ()
    doc: str = ""
    motion: VerbMotion = ""


class StateSpec(Record, frozen=True, kw_only=True):
    """A number of an entity that changes while the mission runs: `state demand = 100 kg`.

    `name` is the author's, by which engines report it and interactions move it; `unit` is its SI unit ("" for a bare
    number). The property `field` holds what it starts with.
    """

    name: str
    unit: str = ""

    @property
    def field(self) -> str:
        """What rules and properties call it: `demand_kg`."""
        return f"{self.name}_{self.unit}" if self.unit else self.name


class InteractionSpec(Exchange, frozen=True, kw_only=True):
    """What an actor may do to one target (`lingjing.mission.model.Interaction`), in metres and seconds.

    `lasting_s` None means at once, or as long as the target's nature takes.
    """

    within_m: float
    lasting_s: float | None = None
    aboard: bool = False


LEAST_BLOCKED_M = 15.0
"""A queue of vehicles is not shorter: so far around its place at least a target that `blocks` blocks the lanes."""


class Entity(Record, frozen=True, kw_only=True):
    """An asset or a target with one owning engine.

    `id` is `uav[1]` for the member of a group, else the bare name. `properties` holds what the declaration and its
    type say beyond the named fields, in SI units (`drift_mps`, `speed_mps`, …: see `lingjing.mission.instantiate`).
    `hidden` names the properties (and `position`) that must never reach a policy, `state` are those that
    change while the mission runs. A `dormant` entity is not there until an event lets it appear. `bases` are the
    types that its type extends, nearest first, `interactions` what may be done to it. `drawn_in` is the outline its
    place is drawn from, metres: the scene does not move it out of there. `mounts` and `parts` are those of its type.
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
    state: tuple[StateSpec, ...] = ()
    dormant: bool = False
    bases: tuple[str, ...] = ()
    interactions: tuple[InteractionSpec, ...] = ()
    drawn_in: tuple[tuple[float, float], ...] = ()
    mounts: tuple[CameraMount, ...] = ()
    parts: tuple[BodyPart, ...] = ()

    def is_aboard(self, status: str) -> bool:
        """Whether somebody has taken it along, by its status word."""
        return any(one.aboard and one.done_word == status for one in self.interactions)

    def is_served(self, status: str) -> bool:
        """Whether what it waited for was done to it, by its status word; what only gives is never served."""
        return any(not one.gives and one.done_word == status for one in self.interactions)

    def state_of(self, field: str) -> StateSpec | None:
        """The state that rules call `field`, if it is one."""
        return next((one for one in self.state if one.field == field), None)

    def number(self, name: str) -> float | None:
        """A declared property that is a number, by its name with the unit; None if there is none."""
        value = self.properties.get(name)
        return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else None

    def number_or(self, name: str, default: float) -> float:
        """A declared property that is a number, by its name with the unit, else the default."""
        value = self.number(name)
        return default if value is None else value

    @property
    def blocked_m(self) -> float | None:
        """How far around its place a target that `blocks` lets nobody pass, in metres: its `radius`, `LEAST_BLOCKED_M`
        at least; None for what does not block."""
        if self.properties.get("blocks") is not True:
            return None
        return max(self.number_or("radius_m", 0.0), LEAST_BLOCKED_M)


class ChannelSpec(Record, frozen=True, kw_only=True):
    """An observation channel with everything resolved.

    `source` is one of `entity`, `peers`, `grid`, `events`; `name` the entity id or the grid's name, else "".
    """

    source: Literal["entity", "peers", "grid", "events"]
    name: str = ""
    fields: tuple[str, ...] = ("*",)

    def shows_camera(self, entity: str, camera: str) -> bool:
        """True if the pictures of that camera are part of the channel: it is named, or the entity is observed whole."""
        return self.source == "entity" and self.name == entity and ("*" in self.fields or camera in self.fields)


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
    budget: Allowance | None = None

    def receives_pictures(self, entity: str, camera: str) -> bool:
        """True if one of the agent's channels shows the pictures of that camera."""
        return any(channel.shows_camera(entity, camera) for channel in self.observes)


class MessageSpec(Record, frozen=True, kw_only=True):
    """A message kind open in this mode: who may send it, which roles may receive it (("all",) for everyone)."""

    kind: str
    type: str
    category: Literal["report", "assignment", "target_status", "other"]
    fields: tuple[Field, ...]
    senders: tuple[str, ...]
    recipients: tuple[str, ...]

    def is_sent_by(self, role: str) -> bool:
        """Whether agents of the role may send it."""
        return EVERYONE in self.senders or role in self.senders

    def is_for(self, role: str) -> bool:
        """Whether agents of the role may receive it."""
        return EVERYONE in self.recipients or role in self.recipients


class CommsSpec(Record, frozen=True, kw_only=True):
    """Bus settings of this instance: `hub` is an agent id in star mode, None in broadcast and with a single agent.

    `range_m` None means that everyone hears everyone.
    """

    mode: Literal["star", "broadcast", "single"]
    hub: str | None
    delay_ticks: int = 1
    payload_bytes: int = 4000
    range_m: float | None = None
    loss: float = 0.0
    receipts: Literal["own", "all", "none"] = "own"


class SceneSpec(Record, frozen=True, kw_only=True):
    """Which provider builds the city and with what: `origin` is (latitude, longitude) in degrees, `datum_m` the
    elevation of the water surface, `options` the provider's own.

    `layout` is the stream of what stays from episode to episode (streets, buildings): it depends on the mission's name
    and its scene option `layout` alone. `seed` is the stream of what an episode's seed may change.
    """

    kind: str
    datum_m: float = 0.0
    origin: tuple[float, float] = (31.0, 121.5)
    options: dict[str, Option] = {}
    seed: int = 0
    layout: int = 0


class CountedSpec(Record, frozen=True, kw_only=True):
    """What a counted budget counts: commands to the entity `resource` (`name` the verb, "" any), or messages of the
    kind `name`."""

    kind: Literal["command", "message"]
    resource: str = ""
    name: str = ""


class LimitSpec(Record, frozen=True, kw_only=True):
    """A counted budget; `stage` names the stage within which it counts, "" the whole episode."""

    name: str
    most: int
    counts: tuple[CountedSpec, ...]
    stage: str = ""


class PermitSpec(Record, frozen=True, kw_only=True):
    """Commands that are rejected until the condition holds; `verb` "" means every verb of the resource."""

    resource: str
    condition: Expr
    verb: str = ""


class InspectionSpec(Record, frozen=True, kw_only=True):
    """An inspection of the route of `asset`: see `lingjing.mission.model.Inspection`; `destination` is an entity."""

    name: str
    asset: str
    by: tuple[str, ...]
    within_m: float
    order: Literal["strict", "any"] = "strict"
    replan: str = ""
    destination: str = ""


class EventSpec(Record, frozen=True, kw_only=True):
    """What happens at boundary `tick`: the weather from then on (None: as before), who appears, who vanishes."""

    name: str
    tick: int
    weather: Weather | None = None
    appear: tuple[str, ...] = ()
    vanish: tuple[str, ...] = ()


class RevealSpec(Record, frozen=True, kw_only=True):
    """The reference pictures a role is shown."""

    what: Literal["image"]
    entities: tuple[str, ...]
    role: str


class Instance(Record, frozen=True, kw_only=True):
    """The whole reset specification. `engine_options` are what engines are told for the episode, by engine and name."""

    format: Literal["lingjing-instance/2"] = "lingjing-instance/2"
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
    limits: tuple[LimitSpec, ...] = ()
    permits: tuple[PermitSpec, ...] = ()
    constraints: tuple[Constraint, ...] = ()
    inspections: tuple[InspectionSpec, ...] = ()
    events: tuple[EventSpec, ...] = ()
    reveals: tuple[RevealSpec, ...] = ()
    engine_options: dict[str, dict[str, GivenOption]] = {}

    @property
    def mode(self) -> str:
        """`star`, `broadcast` or `single`."""
        return self.comms.mode

    def actors(self, interaction: InteractionSpec) -> tuple[Entity, ...]:
        """The assets that may perform an interaction: `by` names their engine, or a role whose agents control them."""
        played = {name for agent in self.agents if agent.role == interaction.by for name in agent.controls}
        return tuple(
            entity
            for entity in self.entities
            if entity.role == "asset" and (entity.engine == interaction.by or entity.id in played)
        )

    def __repr__(self) -> str:
        """One line, where the whole would fill pages."""
        held = f"{len(self.entities)} entities, {len(self.agents)} agents"
        return f"<Instance {self.mission} seed {self.seed} {self.mode}: {held}>"
