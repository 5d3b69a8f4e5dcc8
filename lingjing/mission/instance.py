"""`Instance`: a mission with seed, mode and settings applied; the reset specification S of the paper.

Everything is a plain value in SI units and degrees except the rules, which stay expressions over run-time state. Two
instances of one (mission, seed, mode, settings) are equal. The trace records the whole instance, so that a replay needs
no mission file. World frame: east, north, elevation over the scene's datum, metres.
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
"""A value of an action's argument, a message's field or an entity's property."""
Option = bool | int | float | str | tuple[bool | int | float | str | tuple[float, float], ...] | None
"""A value of a scene's option; a line or an outline is its points, (east, north) in metres."""
GivenOption = bool | int | float | str | list[Any] | dict[str, Any] | None
"""The value of a plug-in's option: any JSON."""


class Clock(Record, frozen=True, kw_only=True):
    """Decision tick and macro-step."""

    tick_s: float
    """Seconds; a whole multiple of `sync_s`."""
    sync_s: float
    """Seconds."""


class Budget(Record, frozen=True, kw_only=True):
    """The limits of an episode."""

    ticks: int
    policy_s: float
    """Wall-clock limit of the barrier of the policies, seconds."""
    engine_s: float
    """Wall-clock limit of the barrier of the engines, seconds."""
    capture_s: float
    """Wall-clock limit of the barrier of the pictures, seconds."""
    tokens: int | None = None
    """Model tokens of all policies together; None for no limit."""
    money_usd: float | None = None
    """US dollars of all policies together; None for no limit."""
    messages: int | None = None
    """Messages of all policies together; None for no limit."""


class Allowance(Record, frozen=True, kw_only=True):
    """The limits of one agent in an episode; None for no limit."""

    tokens: int | None = None
    money_usd: float | None = None
    messages: int | None = None


class Weather(Record, frozen=True, kw_only=True):
    """Boundary conditions of the air and the sea. Directions are compass degrees."""

    wind_mps: float = 0.0
    wind_from_deg: float = 0.0
    """The direction that the wind comes *from*."""
    turbulence: float = 0.0
    visibility_m: float = 10_000.0
    wave_height_m: float = 0.0
    wave_period_s: float = 5.0
    current_mps: float = 0.0
    current_to_deg: float = 0.0
    """The direction that the current flows *towards*."""
    cloud: float = 0.2
    """Covered share of the sky, 0..1."""
    rain: float = 0.0
    """Intensity of rain, 0 (dry) to 1 (downpour)."""
    sun_azimuth_deg: float = 150.0
    sun_elevation_deg: float = 45.0
    ice: float = 0.0
    """Share of the roads under ice or packed snow, 0..1. It has no effect without `effects`."""
    effects: bool = False
    """True if the weather acts on drivers, dogs, boats and pictures as well (docs/weather.md)."""


class Region(Record, frozen=True, kw_only=True):
    """A polygon of the mission."""

    name: str
    polygon: tuple[tuple[float, float], ...]
    """Metres, anticlockwise, without the closing repeat; empty for a region made of roads until the scene is built."""
    on_map: Expr | None = None
    """The shape of a region made of roads, which only the built city can evaluate; else None."""
    hidden: bool = False
    """True for a region around a hidden place, which must never reach a policy."""


class Cell(Record, frozen=True, kw_only=True):
    """One search cell."""

    name: str
    """`<grid>-<row>-<column>`, counted from 1 at the south-west."""
    grid: str
    row: int
    column: int
    polygon: tuple[tuple[float, float], ...]
    """Metres, with the overlap."""
    centre: tuple[float, float]
    hidden: bool = False
    """True for a cell of a hidden region, which must never reach a policy."""
    seen: bool = False
    """True if agents receive the share of its ground that pictures have shown (ADR 0054)."""


class CameraSpec(Record, frozen=True, kw_only=True):
    """A camera of an asset."""

    name: str
    view: Literal["nadir", "front", "oblique"]
    width: int
    """Pixels."""
    height: int
    """Pixels."""
    hfov_deg: float
    """Horizontal field of view, degrees."""
    channels: tuple[str, ...]
    """Some of `rgb`, `depth`, `semantic`, `instance`."""
    capture: Literal["on_request", "each_tick"]


class ArgumentSpec(Record, frozen=True, kw_only=True):
    """One argument of a verb. The kernel clips values to [minimum, maximum] and reports that in the receipt."""

    name: str
    unit: str = ""
    """SI unit; "" for a bare number."""
    minimum: float | None = None
    maximum: float | None = None
    default: float | None = None
    optional: bool = False


class VerbSpec(Record, frozen=True, kw_only=True):
    """One admissible command of a resource."""

    name: str
    arguments: tuple[ArgumentSpec, ...] = ()
    doc: str = ""
    """The type's description, or that of its engine."""
    motion: VerbMotion = ""
    """The engine's declaration of how the verb moves the body."""


class StateSpec(Record, frozen=True, kw_only=True):
    """A number of an entity that changes during the mission: `state demand = 100 kg`."""

    name: str
    """The author's name, which engines report and interactions change."""
    unit: str = ""
    """SI unit; "" for a bare number."""

    @property
    def field(self) -> str:
        """Its name in rules and properties, `demand_kg`. The property of this name holds the start value."""
        return f"{self.name}_{self.unit}" if self.unit else self.name


class InteractionSpec(Exchange, frozen=True, kw_only=True):
    """An interaction with one target (`lingjing.mission.model.Interaction`), evaluated."""

    within_m: float
    """Largest distance between actor and target, metres."""
    lasting_s: float | None = None
    """Seconds that the actor must stay; None for an instantaneous interaction or one that depends on the target's
    nature."""
    aboard: bool = False
    """True if the actor takes the target along."""


class BehaviourSpec(Record, frozen=True, kw_only=True):
    """The motion of a target by itself (`lingjing.mission.model.Behaviour`), evaluated."""

    kind: Literal["flee", "wander", "follow"]
    speed_mps: float
    of: tuple[str, ...] = ()
    """Ids of the bodies that it flees from or follows."""
    distance_m: float = 0.0
    """Distance below which the target flees from a body, and above which it follows one, metres."""
    region: str = ""
    """The region that it wanders in."""


_MIN_BLOCKED_M = 15.0
"""Smallest radius that a target with `blocks` closes around its place, metres (chosen: the length of a short queue)."""


class Entity(Record, frozen=True, kw_only=True):
    """An asset or a target with one owning engine."""

    id: str
    """`uav[1]` for the member of a group, else the bare name."""
    group: str
    index: int
    """Position in its group, counted from 1."""
    role: Literal["asset", "target"]
    type: str
    engine: str
    position: Vector
    """East, north, elevation in metres."""
    heading_deg: float = 0.0
    label: str = ""
    """The source's own name, such as an equipment code; "" if it has none."""
    properties: dict[str, Datum] = {}
    """Declared properties beyond the other fields, in SI units (`drift_mps`, `speed_mps`, …: see
    `lingjing.mission.instantiate`)."""
    hidden: tuple[str, ...] = ()
    """Names of the properties (and `position`) that must never reach a policy."""
    cameras: tuple[CameraSpec, ...] = ()
    verbs: tuple[VerbSpec, ...] = ()
    state: tuple[StateSpec, ...] = ()
    """The properties that change during the mission."""
    dormant: bool = False
    """True if it does not exist until an event makes it appear."""
    bases: tuple[str, ...] = ()
    """The types that its type extends, nearest first."""
    interactions: tuple[InteractionSpec, ...] = ()
    """The interactions with it as target."""
    drawn_in: tuple[tuple[float, float], ...] = ()
    """The outline from which its place was drawn, metres: the scene does not move it out of there. Empty if
    not drawn."""
    mounts: tuple[CameraMount, ...] = ()
    """The camera mounts of its type."""
    parts: tuple[BodyPart, ...] = ()
    """The body parts of its type."""
    behaviour: BehaviourSpec | None = None
    """The motion of a target by itself; None if it has none."""

    def is_aboard(self, status: str) -> bool:
        """True if its status word means that an actor has taken it along."""
        return any(interaction.aboard and interaction.done_word == status for interaction in self.interactions)

    def is_served(self, status: str) -> bool:
        """True if its status word means that an interaction with it is complete. Interactions that only give do not
        count."""
        return any(not interaction.gives and interaction.done_word == status for interaction in self.interactions)

    def state_of(self, field: str) -> StateSpec | None:
        """The state with this name in rules; None if there is none."""
        return next((spec for spec in self.state if spec.field == field), None)

    def number(self, name: str) -> float | None:
        """A declared numeric property, by its name with the unit; None if there is none."""
        value = self.properties.get(name)
        return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else None

    def number_or(self, name: str, default: float) -> float:
        """A declared numeric property, by its name with the unit, else the default."""
        value = self.number(name)
        return default if value is None else value

    @property
    def blocked_m(self) -> float | None:
        """Radius that a target with `blocks` closes around its place, metres: its `radius`, but at least
        `_MIN_BLOCKED_M`. None if it does not block."""
        if self.properties.get("blocks") is not True:
            return None
        return max(self.number_or("radius_m", 0.0), _MIN_BLOCKED_M)


class ChannelSpec(Record, frozen=True, kw_only=True):
    """A resolved observation channel."""

    source: Literal["entity", "peers", "grid", "events"]
    name: str = ""
    """The entity's id or the grid's name, else ""."""
    fields: tuple[str, ...] = ("*",)
    """The observed fields; ("*",) for all that are not hidden."""

    def shows_camera(self, entity: str, camera: str) -> bool:
        """True if the pictures of that camera are part of the channel: it is named, or the entity is observed whole."""
        return self.source == "entity" and self.name == entity and ("*" in self.fields or camera in self.fields)


class AgentSpec(Record, frozen=True, kw_only=True):
    """An active agent."""

    id: str
    """`scout[1]` for the member of a group, else the bare name."""
    name: str
    index: int
    """Position in its group, counted from 1."""
    role: str
    controls: tuple[str, ...]
    """Ids of the assets that it embodies."""
    commands: tuple[str, ...]
    """Ids of every resource that it may command, in declaration order, embodied ones first."""
    observes: tuple[ChannelSpec, ...]
    prompt: str = ""
    budget: Allowance | None = None
    """Its own limits; None if it has none."""

    def receives_pictures(self, entity: str, camera: str) -> bool:
        """True if one of the agent's channels shows the pictures of that camera."""
        return any(channel.shows_camera(entity, camera) for channel in self.observes)


class MessageSpec(Record, frozen=True, kw_only=True):
    """A message kind that can be sent in this mode."""

    kind: str
    type: str
    """Name of its record type."""
    category: Literal["report", "assignment", "target_status", "other"]
    """The category in which metrics count it."""
    fields: tuple[Field, ...]
    senders: tuple[str, ...]
    """Roles that may send it; ("all",) for every role."""
    recipients: tuple[str, ...]
    """Roles that may receive it; ("all",) for every role."""

    def is_sent_by(self, role: str) -> bool:
        """True if agents of the role may send it."""
        return EVERYONE in self.senders or role in self.senders

    def is_for(self, role: str) -> bool:
        """True if agents of the role may receive it."""
        return EVERYONE in self.recipients or role in self.recipients


class CommsSpec(Record, frozen=True, kw_only=True):
    """Settings of the message bus."""

    mode: Literal["star", "broadcast", "single"]
    hub: str | None
    """An agent's id in star mode, else None."""
    delay_ticks: int = 1
    payload_bytes: int = 4000
    range_m: float | None = None
    """Largest distance between sender and recipient, metres; None for no limit."""
    loss: float = 0.0
    """Share of lost messages, 0..1."""
    receipts: Literal["own", "all", "none"] = "own"
    """The receipts that an agent receives."""


class SceneSpec(Record, frozen=True, kw_only=True):
    """The provider that builds the city, and its options."""

    kind: str
    datum_m: float = 0.0
    """Elevation of the water surface, metres."""
    origin: tuple[float, float] = (31.0, 121.5)
    """(latitude, longitude) in degrees."""
    options: dict[str, Option] = {}
    """The provider's own options."""
    seed: int = 0
    """Seed of everything that may change with the episode's seed."""
    layout: int = 0
    """Seed of everything that stays the same in all episodes (streets, buildings). It depends only on the mission's
    name and its scene option `layout`."""


class CountedSpec(Record, frozen=True, kw_only=True):
    """The commands or messages that a counted budget counts."""

    kind: Literal["command", "message", "claims"]
    """`claims`: the positive claims of all agents (`lingjing.kernel.claims`)."""
    resource: str = ""
    """Id of the commanded entity; "" for messages and claims."""
    name: str = ""
    """The verb ("" for any), or the message kind."""


class LimitSpec(Record, frozen=True, kw_only=True):
    """A counted budget."""

    name: str
    most: int
    counts: tuple[CountedSpec, ...]
    stage: str = ""
    """The stage within which it counts; "" for the whole episode."""


class PermitSpec(Record, frozen=True, kw_only=True):
    """A condition for commands: the kernel rejects them until it holds."""

    resource: str
    condition: Expr
    verb: str = ""
    """The verb; "" for every verb of the resource."""


class InspectionSpec(Record, frozen=True, kw_only=True):
    """An inspection of an asset's route (`lingjing.mission.model.Inspection`)."""

    name: str
    asset: str
    """Id of the asset that drives the route."""
    by: tuple[str, ...]
    """Ids of the inspectors."""
    within_m: float
    order: Literal["strict", "any"] = "strict"
    replan: str = ""
    """Message kind that requests another route; "" for none."""
    pictured: bool = False
    """True if a waypoint counts only with a picture of an inspector that shows it."""
    destination: str = ""
    """Id of the entity at the end of the route; "" if the asset's own command sets it."""


class StateChange(Record, frozen=True, kw_only=True):
    """A state or the status of a target that an event sets."""

    entity: str
    """Id of the target."""
    field: str
    """The state by its name in rules (`demand_kg`), or `status`."""
    value: Expr
    """The new value, evaluated when the event occurs."""


class RadioChange(Record, frozen=True, kw_only=True):
    """Other settings of the radio, everywhere or in a region."""

    region: str = ""
    """The region in which a sender or a recipient has the worse of both settings; "" for everywhere."""
    loss: float | None = None
    """Share of lost messages, 0..1; None if it stays."""
    range_m: float | None = None
    """Largest distance between sender and recipient, metres; None if it stays."""


class EventSpec(Record, frozen=True, kw_only=True):
    """An event of the mission: at boundary `tick`, or at the first boundary at which `condition` holds."""

    name: str
    tick: int | None = None
    """The decision tick at which the event occurs; None for an event that a condition triggers."""
    condition: Expr | None = None
    """The condition that triggers it; None for an event at a time."""
    until: Expr | None = None
    """The condition that undoes it; None for an event that is never undone."""
    pause_s: float | None = None
    """Seconds after its last change (occurrence or undoing) until it may occur again; None if it occurs once."""
    weather: Weather | None = None
    """The weather from then on; None if it does not change."""
    weather_fields: tuple[str, ...] = ()
    """The fields of `weather` that it changes; () for all."""
    appear: tuple[str, ...] = ()
    """Ids of the entities that appear."""
    vanish: tuple[str, ...] = ()
    """Ids of the entities that vanish."""
    changes: tuple[StateChange, ...] = ()
    """States and status words that get another value."""
    closes: tuple[str, ...] = ()
    """Regions with roads that it closes."""
    reopens: tuple[str, ...] = ()
    """Regions with roads that it opens again."""
    radio: tuple[RadioChange, ...] = ()
    """Changes of the radio."""

    @property
    def is_fixed(self) -> bool:
        """True if its time and its changes are known from the start, so that engines need no message about it."""
        return self.tick is not None and self.until is None and self.pause_s is None and not self.changes

    @property
    def entities(self) -> tuple[str, ...]:
        """Ids of the entities that it concerns, each once."""
        return tuple(dict.fromkeys((*self.appear, *self.vanish, *(change.entity for change in self.changes))))


class RevealSpec(Record, frozen=True, kw_only=True):
    """The reference pictures that a role receives."""

    what: Literal["image"]
    entities: tuple[str, ...]
    role: str


class Instance(Record, frozen=True, kw_only=True):
    """The complete reset specification."""

    format: Literal["lingjing-instance/2"] = "lingjing-instance/2"
    mission: str
    title: str
    goal: str
    seed: int
    settings: dict[str, float]
    """Value of each parameter, without switches that are off by default and off here; those in `hidden_settings` reach
    no agent."""
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
    hidden_settings: tuple[str, ...] = ()
    """The parameters that agents must not learn."""
    engine_options: dict[str, dict[str, GivenOption]] = {}
    """Options of the episode for engines, by engine and name."""
    redrawn: tuple[str, ...] = ()
    """`group.property` of each draw with `apart` that left no room for a later member, so that the whole group was
    drawn anew: with this seed a group of another size has other values."""
    tier: int = 0
    """The tier of which `settings` has the values; `lingjing.mission.tiers`."""
    language: str = "en"
    """The code of the language of the goal and the prompts; `lingjing.mission.languages`."""

    @property
    def mode(self) -> str:
        """`star`, `broadcast` or `single`."""
        return self.comms.mode

    def actors(self, interaction: InteractionSpec) -> tuple[Entity, ...]:
        """The assets that may perform an interaction: `by` names their engine, or a role with agents that
        control them."""
        played = {name for agent in self.agents if agent.role == interaction.by for name in agent.controls}
        return tuple(
            entity
            for entity in self.entities
            if entity.role == "asset" and (entity.engine == interaction.by or entity.id in played)
        )

    def __repr__(self) -> str:
        """One line, because the complete value fills pages."""
        held = f"{len(self.entities)} entities, {len(self.agents)} agents"
        return f"<Instance {self.mission} seed {self.seed} {self.mode}: {held}>"
