"""`Mission`: the compiled mission, the only input of everything after the compiler.

A mission is a *template*: it still holds parameters, modes, index variables and seeded draws as expressions.
`lingjing.mission.instantiate` turns it, with a seed, a mode and settings, into a `lingjing.mission.instance.Instance`,
in which everything but the rules is a plain value.

All structs are frozen. `mission.json` is their direct encoding (`schemas/mission.schema.json` is generated from here).
Types of the standard library are resolved and merged: an asset has every property of its type, so that a mission
document can be read without the library it was written against.
"""

from __future__ import annotations

from typing import Literal

import msgspec

from lingjing.mission.expression import Draw, Expr, Flag


class Record(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Base of the mission's parts: frozen, keyword-only, unknown fields are errors."""


class Guard(Record, frozen=True, kw_only=True):
    """`when mode == star`: the declaration exists only if the condition holds for the chosen mode and parameters."""

    condition: Expr


class Property(Record, frozen=True, kw_only=True):
    """One `name = value`, `name ~ draw` or `name <= bound` of a block."""

    name: str
    """A quantity's name ends with its unit: `demand_kg`."""
    value: Expr
    relation: Literal["=", "~", "<="] = "="
    """`~` for a draw, `<=` for a bound."""
    hidden: bool = False
    """True if its value must never reach a policy."""
    inherited: bool = False
    """True if it comes from the type."""
    state: bool = False
    """True for a number that changes during the mission; the value is its start value."""
    unit: str = ""
    """The unit in `name` ("kg"); "" for a bare number or a property of several parts."""

    @property
    def plain(self) -> str:
        """The author's name, without the unit."""
        return self.name.removesuffix(f"_{self.unit}") if self.unit else self.name


class Alternative(Record, frozen=True, kw_only=True):
    """`wind ~ uniform(2 m/s, 9 m/s) from 220 deg when light`: a line of a block with a condition.

    It replaces the line without a condition. Of several alternatives, the last one with a true condition counts.
    `lingjing.mission.alternatives` puts them in place.
    """

    properties: tuple[Property, ...]
    """The lowered properties of the line: two for a range, a size or a speed with a direction."""
    when: Guard


class Scene(Record, frozen=True, kw_only=True):
    """The provider that builds the city, with its options (`datum` is the elevation of the water surface)."""

    kind: str
    options: tuple[Property, ...] = ()
    alternatives: tuple[Alternative, ...] = ()


class ClockDeclaration(Record, frozen=True, kw_only=True):
    """The two intervals of a run."""

    tick: Expr
    """Decision interval, seconds."""
    sync: Expr
    """Macro-step at which engines exchange mirrors, seconds."""


class BudgetDeclaration(Record, frozen=True, kw_only=True):
    """The limits K of an episode."""

    ticks: Expr
    """Committed ticks."""
    policy: Expr
    """Wall-clock limit of the barrier of the policies, seconds."""
    engine: Expr
    """Wall-clock limit of the barrier of the engines, seconds."""
    capture: Expr
    """Wall-clock limit of the barrier of the pictures, seconds."""
    tokens: Expr | None = None
    """Model tokens of all policies together; None for no limit."""
    money: Expr | None = None
    """US dollars of all policies together; None for no limit."""
    messages: Expr | None = None
    """Messages of all policies together; None for no limit."""


class AllowanceDeclaration(Record, frozen=True, kw_only=True):
    """Limits of one agent in an episode: model tokens, US dollars, messages. None for no limit."""

    tokens: Expr | None = None
    money: Expr | None = None
    messages: Expr | None = None


class Parameter(Record, frozen=True, kw_only=True):
    """A parameter of the mission: `param uavs = 3 in 1..10`. Values are in SI units, the unit in the text is the
    author's."""

    name: str
    default: Expr
    """Its value; a `Draw` if each seed draws one."""
    bounds: Expr | None = None
    """A range or a list of allowed values; None for no bound."""
    doc: str = ""
    hidden: bool = False
    """True if agents must not learn the drawn value."""

    @property
    def is_drawn(self) -> bool:
        """True if each seed draws its value."""
        return isinstance(self.default, Draw)

    @property
    def is_switch(self) -> bool:
        """True if it is `true` or `false`. Settings hold 1 and 0."""
        return isinstance(self.default, Flag)


class Modes(Record, frozen=True, kw_only=True):
    """The communication modes of the mission, among star, broadcast and single."""

    default: str
    allowed: tuple[str, ...]


class RegionDeclaration(Record, frozen=True, kw_only=True):
    """A named area."""

    name: str
    shape: Expr
    """A `polygon(…)`, `circle(…)`, `box(…)`, `buffer(…)`, `union(…)`, `road("…")` or `along(…)` call, or the name of
    another region."""
    hidden: bool = False
    """True for a region around a hidden place."""


class Grid(Record, frozen=True, kw_only=True):
    """Search cells over a region."""

    name: str
    region: str
    rows: Expr
    """Counted from the south."""
    columns: Expr
    """Counted from the west."""
    overlap: Expr
    """Overlap of neighbours as a share of a cell, 0..1."""
    seen: Expr | None = None
    """True if agents that observe the grid receive the share of each cell's ground that pictures have shown."""


class OtherChannels(Record, frozen=True, kw_only=True):
    """`channels = [rgb] when plain`: the channels of a camera under a condition. The last one that holds counts."""

    channels: tuple[str, ...]
    when: Guard


class Camera(Record, frozen=True, kw_only=True):
    """A camera of an asset."""

    name: str
    view: Literal["nadir", "front", "oblique"]
    width: Expr
    """Pixels."""
    height: Expr
    """Pixels."""
    hfov: Expr
    """Horizontal field of view, degrees."""
    channels: tuple[str, ...]
    """Some of `rgb`, `depth`, `semantic`, `instance`."""
    alternatives: tuple[OtherChannels, ...] = ()
    """`lingjing.mission.alternatives` puts them in place."""
    capture: Literal["on_request", "each_tick"] = "on_request"


class Argument(Record, frozen=True, kw_only=True):
    """One argument of a verb."""

    name: str
    dimension: str = ""
    """Its SI unit ("m", "deg", "" for a bare number)."""
    minimum: Expr | None = None
    maximum: Expr | None = None
    default: Expr | None = None
    optional: bool = False


class Verb(Record, frozen=True, kw_only=True):
    """One command of an asset's action space."""

    name: str
    arguments: tuple[Argument, ...] = ()
    doc: str = ""


class Exchange(Record, frozen=True, kw_only=True):
    """The part of an interaction that is the same in a mission and in its instances.

    `takes` and `source` together move goods from the actor to the target's demand: they lower the target's state by the
    actor's amount. `takes` alone lowers the target's state while the actor works. `gives` raises the actor's state up
    to its `up_to`, out of the target's `source`. All four are names of states and limits without units, "" if absent.
    """

    name: str
    by: str
    """The engine of the actor, or the role of the agents that control it."""
    status: str = ""
    """The target's status word afterwards; "" for the name with `d` or `ed`."""
    takes: str = ""
    source: str = ""
    """The word after `from` in the mission."""
    gives: str = ""
    up_to: str = ""
    told: Literal["", "all", "actor", "none"] = ""
    """The agents that receive the event (`lingjing.kernel.event_visibility`); "" for the default."""

    @property
    def moves_goods(self) -> bool:
        """True if it transfers an amount between actor and target; then it may be repeated."""
        return bool(self.gives or (self.takes and self.source))

    @property
    def works_off(self) -> bool:
        """True if it lowers a state of the target during the actor's stay without a transfer."""
        return bool(self.takes) and not self.source

    @property
    def carried(self) -> str:
        """The state of the actor that goods are taken from or put into; "" if nothing is transferred."""
        return self.source if self.takes else self.gives

    @property
    def own(self) -> str:
        """The state of the target that goods come from or go to; "" for a supply without limit."""
        return self.takes or self.source

    @property
    def done_word(self) -> str:
        """The target's status afterwards."""
        return self.status or self.name + ("d" if self.name.endswith("e") else "ed")


class Interaction(Exchange, frozen=True, kw_only=True):
    """`interaction rescue { by = vessel, within = 50 m, lasting = 20 s }` of a target's type: an action of an actor on
    it."""

    within: Expr
    """Inclusive radius, metres."""
    lasting: Expr | None = None
    """Seconds that the actor must stay; None for an instantaneous interaction."""
    aboard: Expr | None = None
    """True if the actor takes the target along; None: if the target drifts."""


class CameraMount(Record, frozen=True, kw_only=True):
    """`mount front { ahead = 0.3 m, above = -0.05 m, tilt = 10 deg }` of a type: the position of its cameras of one
    view."""

    view: Literal["nadir", "front", "oblique"]
    ahead_m: float
    """Metres ahead of the body's position."""
    above_m: float
    """Metres above the body's position."""
    tilt_deg: float
    """Degrees below the horizon."""
    gimbal: bool = True
    """Without a gimbal the camera pitches and rolls with the body."""


class BodyPart(Record, frozen=True, kw_only=True):
    """`part basket : box { length = 1 m, width = 1 m, height = 1 m, above = -4 m, colour = brown }` of a type: a solid
    that is drawn as a part of its bodies.

    It fills a box of `length_m` by `width_m` by `height_m` along, across and up.
    """

    name: str
    shape: Literal["box", "cylinder", "sphere", "cone"]
    length_m: float
    width_m: float
    height_m: float
    ahead_m: float = 0.0
    """Position of its middle ahead of the body's position, metres; negative behind it."""
    right_m: float = 0.0
    """Position of its middle to the right of the body's position, metres."""
    above_m: float = 0.0
    """Position of its middle above the body's position, metres."""
    heading_deg: float = 0.0
    """Clockwise from the body's heading, degrees."""
    colour: str = "grey"
    glow: float = 0.0
    """Strength of its own light, 0..1: at 1 it is as bright as a white wall in the sun, by day and at night."""


class Behaviour(Record, frozen=True, kw_only=True):
    """`behaviour flee { from = uav, speed = 2 m/s, within = 60 m }` of a target: its motion by itself."""

    kind: Literal["flee", "wander", "follow"]
    speed: Expr
    """Metres per second."""
    of: Expr | None = None
    """The bodies that it flees from or follows."""
    distance: Expr | None = None
    """Metres: it flees from bodies that are nearer, and follows one that is farther away."""
    region: str = ""
    """The region that it wanders in."""


class Group(Record, frozen=True, kw_only=True):
    """A declared entity or an indexed group of them: `asset uav[1..uavs] : quadrotor` or `target victim[…] : …`."""

    name: str
    role: Literal["asset", "target"]
    type: str
    engine: str
    count: Expr | None = None
    """The number of entities; None for a single entity."""
    index: str = "i"
    """Name of the index inside the block."""
    hides_count: bool = False
    """True if agents must not learn the number of entities."""
    properties: tuple[Property, ...] = ()
    cameras: tuple[Camera, ...] = ()
    verbs: tuple[Verb, ...] = ()
    labels: tuple[str, ...] = ()
    """The source's own names of the members (equipment codes of a `resetScenario`); empty if it has none."""
    when: Guard | None = None
    bases: tuple[str, ...] = ()
    """The types that `type` extends, nearest first, for code that does not know `type` itself."""
    interactions: tuple[Interaction, ...] = ()
    mounts: tuple[CameraMount, ...] = ()
    parts: tuple[BodyPart, ...] = ()
    behaviour: Behaviour | None = None
    """The motion of a target by itself; None if it has none."""
    alternatives: tuple[Alternative, ...] = ()


class Channel(Record, frozen=True, kw_only=True):
    """A source of observations of an agent: `uav[i].*`, `cells`, `peers.position`, `events`."""

    source: Expr
    """An entity expression, or a Symbol for the built-in sources `events`, `peers` and for grids."""
    fields: tuple[str, ...] = ("*",)
    """The observed fields; ("*",) for all that are not hidden."""
    when: Guard | None = None


class Agent(Record, frozen=True, kw_only=True):
    """An agent or an indexed group of them: `agent scout[i in 1..uavs] as searcher controls uav[i] { observes … }`."""

    name: str
    role: str
    """The role that it plays."""
    count: Expr | None = None
    """The number of agents; None for a single agent."""
    index: str = "i"
    controls: tuple[Expr, ...] = ()
    """The assets that it embodies."""
    observes: tuple[Channel, ...] = ()
    prompt: str = ""
    """Its prompt, with placeholders."""
    prompts: dict[str, str] = {}
    """The prompt in other languages, by their codes."""
    when: Guard | None = None
    budget: AllowanceDeclaration | None = None
    """Its own limits; None if it has none."""


class Authority(Record, frozen=True, kw_only=True):
    """`authority searcher may command boat when …`: a role may command a resource it does not embody."""

    role: str
    resource: Expr
    when: Guard | None = None


class Field(Record, frozen=True, kw_only=True):
    """One field of a message record."""

    name: str
    type: Literal["name", "text", "number", "flag", "position", "box", "frame", "names"]
    optional: bool = False
    minimum: float | None = None
    maximum: float | None = None
    unit: str = ""
    """The SI unit of a number (`kg` for a field of type `mass`); "" for none."""


class MessageKind(Record, frozen=True, kw_only=True):
    """`message detection : report from searcher to all`."""

    name: str
    type: str
    category: Literal["report", "assignment", "target_status", "other"]
    """The category in which metrics count it."""
    fields: tuple[Field, ...]
    senders: tuple[str, ...]
    recipients: tuple[str, ...]
    when: Guard | None = None


class Comms(Record, frozen=True, kw_only=True):
    """Settings of the message bus."""

    hub: str | None = None
    """The agent through which star mode routes messages."""
    delay: Expr | None = None
    """Ticks."""
    payload: Expr | None = None
    """Largest size of a message, bytes."""
    range: Expr | None = None
    """Largest distance between sender and recipient, metres."""
    loss: Expr | None = None
    """Share of lost messages, 0..1."""
    receipts: Literal["own", "all", "none"] = "own"
    """The receipts that an agent receives: its `own`, `all` of them or `none`."""


class RuleParameter(Record, frozen=True, kw_only=True):
    """A typed parameter of a rule."""

    name: str
    domain: str
    """A group (`victim`) or a message kind (`detection`)."""


class Rule(Record, frozen=True, kw_only=True):
    """`adjudicate matched(v: victim, r: detection) { when … }`: an event for each binding once its condition
    is true."""

    name: str
    parameters: tuple[RuleParameter, ...]
    condition: Expr
    matching: bool = False
    """True if the condition compares a report with `truth(…)`: then reports and entities of a frame are matched one to
    one."""
    when: Guard | None = None


class Unlock(Record, frozen=True, kw_only=True):
    """`unlock rescue(v: victim) when …`: the kernel allows an interaction; the owning engine performs and
    reports it."""

    interaction: str
    parameters: tuple[RuleParameter, ...]
    condition: Expr


class Counted(Record, frozen=True, kw_only=True):
    """The commands or messages that a counted budget counts."""

    kind: Literal["command", "message", "claims"]
    """`claims`: the positive claims of all agents (`lingjing.kernel.claims`)."""
    resource: Expr | None = None
    """The commanded entities; None for messages and claims."""
    name: str = ""
    """The verb ("" for all), or the message kind."""


class Limit(Record, frozen=True, kw_only=True):
    """`limit moves <= 50 counts dog.forward, dog.left`: the kernel rejects further commands or messages of
    these kinds."""

    name: str
    most: Expr
    counts: tuple[Counted, ...]
    when: Guard | None = None


class Stage(Record, frozen=True, kw_only=True):
    """`stage detect per v in victim { done when …, ticks <= 40, weight = 2 }`."""

    name: str
    condition: Expr
    variable: str | None = None
    domain: str | None = None
    ticks: Expr | None = None
    """Bound of the ticks from the stage's beginning to its end. It begins at the end of the stages that it depends on,
    or at the start."""
    weight: Expr | None = None
    """Share in the subtask score; None for 1."""
    deadline: Expr | None = None
    """Mission time in seconds at which it must be done; it may read declared numbers of the member. None for none."""
    limits: tuple[Limit, ...] = ()
    """Budgets that count within the stage."""
    when: Guard | None = None


class Permit(Record, frozen=True, kw_only=True):
    """`permit van.setDestination when …`: the kernel rejects the command unless the condition holds."""

    resource: Expr
    condition: Expr
    verb: str = ""
    """The verb; "" for every verb of the resource."""


class Constraint(Record, frozen=True, kw_only=True):
    """A condition that is checked at every macro-step: `constraint hard fence per u in uav { always u in area }`."""

    name: str
    kind: Literal["hard", "soft"]
    """A violated hard constraint prevents success; a soft one costs `penalty` for each binding that violates it."""
    condition: Expr
    variable: str | None = None
    domain: str | None = None
    penalty: Expr | None = None
    when: Guard | None = None


class Inspection(Record, frozen=True, kw_only=True):
    """`inspection checked of van by uav { within = 25 m, replan = trafficJam }`.

    An inspector must come within reach of each waypoint of the asset's route.
    """

    name: str
    asset: Expr
    by: tuple[Expr, ...]
    within: Expr
    """Reach, metres."""
    order: Literal["strict", "any"] = "strict"
    """`strict` if the waypoints must be inspected in their order."""
    replan: str = ""
    """Message kind that requests another route from the asset's engine. The inspection then starts again at the first
    waypoint. "" for none."""
    when: Guard | None = None
    destination: Expr | None = None
    """A target to which the engine plans the route at the start. None: the route is that of the asset's own command."""
    pictured: Expr | None = None
    """True if a waypoint counts only with a picture of an inspector that shows it; None for false."""


class Change(Record, frozen=True, kw_only=True):
    """One effect of an event."""

    kind: Literal["weather", "appear", "vanish", "change", "close", "reopen", "comms", "jam"]
    """`weather`: other weather. `appear`, `vanish`: a target begins or ceases to exist. `change`: a state or the status
    word of a target gets another value. `close`, `reopen`: the roads in a region. `comms`: other radio. `jam`: worse
    radio for everyone in a region."""
    weather: tuple[Property, ...] = ()
    entity: Expr | None = None
    """The target, or the group of targets, that appears, vanishes or changes."""
    field: str = ""
    """For `change`: the state by its name in the graph (`demand_kg`), or `status`."""
    value: Expr | None = None
    """For `change`: the new value, evaluated when the event occurs."""
    region: str = ""
    """For `close`, `reopen` and `jam`: the region."""
    loss: Expr | None = None
    """For `comms` and `jam`: the share of lost messages, 0..1; None if it stays."""
    range: Expr | None = None
    """For `comms` and `jam`: the largest distance between sender and recipient, metres; None if it stays."""


class EventDeclaration(Record, frozen=True, kw_only=True):
    """`event squall at 12 tick { weather { … }, appear jam[2] }`: an event at a time or when a condition holds.

    An entity that an event makes appear does not exist before.
    """

    name: str
    at: Expr | None = None
    """Ticks or, with a unit of time, seconds; may be a draw. None for an event that a condition triggers."""
    condition: Expr | None = None
    """The condition that triggers it; None for an event at a time."""
    until: Expr | None = None
    """The condition that undoes it; None for an event that is never undone."""
    pause: Expr | None = None
    """Seconds after which it may occur again; None for an event that occurs once."""
    changes: tuple[Change, ...]
    when: Guard | None = None


class Sweep(Record, frozen=True, kw_only=True):
    """`sweep altitude over altitude in [60 m, 100 m, 140 m] when mode == star`: a matched study.

    It has one run for every combination of the parameters' values, each with the same seeds.
    """

    name: str
    parameters: tuple[str, ...]
    values: tuple[tuple[Expr, ...], ...]
    when: Guard | None = None
    """Selects the modes."""


class Relation(Record, frozen=True, kw_only=True):
    """One of the paper's five coordination relations, as declared."""

    kind: Literal["information_handoff", "cooperation", "competition", "guidance", "dependency"]
    source: str
    target: str
    mutual: bool = False
    """True if it holds in both directions."""
    carries: str | None = None
    """The message kind that it transfers."""
    over: str | None = None
    """The element that it is about."""
    by: str | None = None
    """The element by which it is exercised."""
    per: str | None = None
    """A group: the relation holds for each of its members."""
    serial: bool = False
    """True for a dependency of the statement `serial`: the target counts only after the source."""
    when: Guard | None = None


class Reveal(Record, frozen=True, kw_only=True):
    """`reveal image(target) to role`: the one audited exception of `hidden`."""

    what: Literal["image"]
    entity: Expr
    role: str
    when: Guard | None = None


class Requirement(Record, frozen=True, kw_only=True):
    """`require distance_xy(victim[1], victim[2]) >= 100 m else "…"`: a condition that the draws of a seed must meet."""

    condition: Expr
    """A condition over declared places, properties, params and the sizes of groups."""
    reason: str
    """The author's reason, for the error."""


class Declassification(Record, frozen=True, kw_only=True):
    """`declassify dog.forward because "…"`: agents may infer hidden values from what a condition decides."""

    what: str
    """`end`, a command `asset.verb` (`asset.*` for all verbs), or the name of a constraint, a stage or a limit."""
    reason: str
    """The author's reason."""


class Setting(Record, frozen=True, kw_only=True):
    """`victims = 2` of an expectation or a tier: the value of a parameter."""

    name: str
    value: Expr


class Tier(Record, frozen=True, kw_only=True):
    """`tier 1 { claims = true, layout = true }`: values of parameters that belong together.

    Tier 0 is the mission with its defaults and is not declared.
    """

    level: int
    """1 or more; `lingjing.mission.tiers` has the meaning of each level."""
    settings: tuple[Setting, ...]


class ExpectedEpisodes(Record, frozen=True, kw_only=True):
    """The instances that an expectation is about: an inclusive range of seeds, the settings and the mode."""

    first_seed: int = 0
    last_seed: int = 4
    settings: tuple[Setting, ...] = ()
    mode: str = ""
    """"" for the mission's default mode."""
    tier: int = 0

    @property
    def seeds(self) -> range:
        """The seeds in order."""
        return range(self.first_seed, self.last_seed + 1)


class PolicyExpectation(Record, frozen=True, kw_only=True, tag="policy", tag_field="expects"):
    """`oracle wins at least 4 of 5 within 40 ticks for seeds 0..4`."""

    policy: str
    """The name of a policy, or `FILE.py:CLASS`."""
    outcome: Literal["wins", "loses"]
    share: Literal["all", "some", "none", "at_least"] = "all"
    """The share of the episodes that have this outcome."""
    least: int = 0
    """The least number of episodes for `at_least`; 0 for other shares."""
    within: Expr | None = None
    """The episode ends within this many ticks or seconds, inclusive; None for no bound."""
    episodes: ExpectedEpisodes = ExpectedEpisodes()


class InfeasibleExpectation(Record, frozen=True, kw_only=True, tag="infeasible", tag_field="expects"):
    """`infeasible when boats == 0`: with settings for which the condition holds, the mission cannot be won."""

    condition: Expr


class SpreadExpectation(Record, frozen=True, kw_only=True, tag="spread", tag_field="expects"):
    """`draws spread over search for seeds 0..19`: the drawn positions cover the region."""

    region: str
    episodes: ExpectedEpisodes = ExpectedEpisodes(last_seed=19)


Expectation = PolicyExpectation | InfeasibleExpectation | SpreadExpectation
"""A test that the mission states about itself; `lingjing test` runs it."""


class Origin(Record, frozen=True, kw_only=True):
    """The source of the mission."""

    file: str = ""
    """Path of the source; "" if unknown."""
    sha256: str = ""
    """Digest of the source, hexadecimal."""
    document: str = ""
    """The unchanged source document, if it was JSON."""
    draws: dict[str, Expr] = {}
    """Group → the draw by which the document's template places it. The document may give the places itself."""
    places: dict[str, str] = {}
    """Entity id → the JSON path at which the document places it."""


_PLAN = "lingjing.play.placed_plan:plan_png"
"""The function that draws a mission for notebooks."""


class Mission(Record, frozen=True, kw_only=True):
    """The checked content of a mission's text; `docs/language.md` defines each part.

    >>> mission = lingjing.compile("first.ljs")
    >>> mission.name, [group.type for group in mission.groups], mission.modes.allowed
    ('first', ['person_in_water', 'quadrotor', 'lifeboat'], ('star', 'broadcast'))
    """

    format: Literal["lingjing-mission/2"] = "lingjing-mission/2"
    name: str
    title: str
    goal: str
    scene: Scene
    clock: ClockDeclaration
    budget: BudgetDeclaration
    weather: tuple[Property, ...]
    parameters: tuple[Parameter, ...]
    modes: Modes
    regions: tuple[RegionDeclaration, ...]
    grids: tuple[Grid, ...]
    groups: tuple[Group, ...]
    agents: tuple[Agent, ...]
    authorities: tuple[Authority, ...]
    messages: tuple[MessageKind, ...]
    comms: Comms
    rules: tuple[Rule, ...]
    unlocks: tuple[Unlock, ...]
    stages: tuple[Stage, ...]
    relations: tuple[Relation, ...]
    reveals: tuple[Reveal, ...] = ()
    success: Expr
    failure: Expr | None = None
    origin: Origin = Origin()
    base: str = ""
    limits: tuple[Limit, ...] = ()
    permits: tuple[Permit, ...] = ()
    constraints: tuple[Constraint, ...] = ()
    inspections: tuple[Inspection, ...] = ()
    events: tuple[EventDeclaration, ...] = ()
    sweeps: tuple[Sweep, ...] = ()
    declassified: tuple[Declassification, ...] = ()
    requirements: tuple[Requirement, ...] = ()
    expectations: tuple[Expectation, ...] = ()
    weather_alternatives: tuple[Alternative, ...] = ()
    tiers: tuple[Tier, ...] = ()
    capabilities: tuple[str, ...] = ()
    """The abilities that the task requires, the paper's tags L, N, P, V and C."""
    goals: dict[str, str] = {}
    """The goal in other languages, by their codes (`lingjing.mission.languages`)."""

    def __repr__(self) -> str:
        """One line; `lingjing.mission.document.encode` writes the complete mission."""
        counts = {"parameters": self.parameters, "groups": self.groups, "agents": self.agents, "rules": self.rules}
        held = ", ".join(f"{len(parts)} {name}" for name, parts in counts.items())
        return f"<Mission {self.name} {self.title[:60]!r}: {held}, {'/'.join(self.modes.allowed)}>"

    def _repr_html_(self) -> str:
        """Return the goal, the groups and the agents as a table, and the plan of seed 0, for notebooks."""
        from lingjing.notebook_tables import drawn_by, html_table

        plan, problem = drawn_by(_PLAN, self)
        values = {
            "goal": self.goal,
            "modes": ", ".join(self.modes.allowed),
            "parameters": ", ".join(parameter.name for parameter in self.parameters),
            "groups": ", ".join(f"{group.name}: {group.type}" for group in self.groups),
            "agents": ", ".join(f"{agent.name}: {agent.role}" for agent in self.agents),
        }
        return html_table(f"{self.name}: {self.title}", values | ({"plan": problem} if problem else {}), plan)

    def _repr_png_(self) -> bytes | None:
        """Return the plan of the instance of seed 0, for notebooks; None if a body has no place."""
        from lingjing.notebook_tables import drawn_by

        return drawn_by(_PLAN, self)[0]
