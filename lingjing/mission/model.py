"""`Mission`: the one intermediate representation; everything downstream of the compiler reads only this.

A mission is a *template*: it still holds parameters, modes, index variables and seeded draws as expressions.
`lingjing.mission.instantiate` turns it, with a seed, a mode and settings, into a `lingjing.mission.instance.Instance`,
in which everything but the rules is a plain value.

All structs are frozen; `mission.json` is their direct image (`schemas/mission.schema.json` is generated from here).
Types of the standard library are resolved and merged: an asset carries every property of its type, so a mission
document can be read without the library it was written against.
"""

from __future__ import annotations

from typing import Literal

import msgspec

from lingjing.mission.expression import Expr


class Record(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Base of the mission's parts: frozen, keyword-only, unknown fields are errors."""


class Guard(Record, frozen=True, kw_only=True):
    """`when mode == star`: the declaration exists only if the condition holds for the chosen mode and parameters."""

    condition: Expr


class Property(Record, frozen=True, kw_only=True):
    """One `name = value`, `name ~ draw` or `name <= bound` of a block.

    A quantity's `name` ends with its unit (`demand_kg`), which `unit` tells ("kg"; "" for a bare number or a property
    of several parts). `state` marks a number that changes while the mission runs: the value is what it starts with.
    """

    name: str
    value: Expr
    relation: Literal["=", "~", "<="] = "="
    hidden: bool = False
    inherited: bool = False
    state: bool = False
    unit: str = ""

    @property
    def plain(self) -> str:
        """The author's name, without the unit."""
        return self.name.removesuffix(f"_{self.unit}") if self.unit else self.name


class Scene(Record, frozen=True, kw_only=True):
    """Which scene provider builds the city, with its options (`datum` is the elevation of the water surface)."""

    kind: str
    options: tuple[Property, ...] = ()


class ClockDeclaration(Record, frozen=True, kw_only=True):
    """`tick` is the decision interval, `sync` the macro-step at which engines exchange mirrors; both in seconds."""

    tick: Expr
    sync: Expr


class BudgetDeclaration(Record, frozen=True, kw_only=True):
    """Limits K: committed ticks, and wall-clock deadlines in seconds for the policy, engine and capture barriers.

    `tokens`, `money` (US dollars) and `messages` bound what all policies together may spend in an episode.
    """

    ticks: Expr
    policy: Expr
    engine: Expr
    capture: Expr
    tokens: Expr | None = None
    money: Expr | None = None
    messages: Expr | None = None


class AllowanceDeclaration(Record, frozen=True, kw_only=True):
    """What one agent may spend in an episode: model tokens, US dollars, messages."""

    tokens: Expr | None = None
    money: Expr | None = None
    messages: Expr | None = None


class Parameter(Record, frozen=True, kw_only=True):
    """`param uavs = 3 in 1..10`; `unit` is the author's, values are SI."""

    name: str
    default: Expr
    bounds: Expr | None = None
    doc: str = ""


class Modes(Record, frozen=True, kw_only=True):
    """The communication modes the mission can be played in and the default one: star, broadcast, or single alone."""

    default: str
    allowed: tuple[str, ...]


class RegionDeclaration(Record, frozen=True, kw_only=True):
    """A named area; `shape` is a `polygon(…)`, `circle(…)`, `box(…)`, `buffer(…)`, `union(…)`, `road("…")` or
    `along(…)` call, or the name of another region. One around a hidden place is itself `hidden`."""

    name: str
    shape: Expr
    hidden: bool = False


class Grid(Record, frozen=True, kw_only=True):
    """Cells over a region: `rows` by `columns` counted from south-west, neighbours overlap by `overlap` (0..1)."""

    name: str
    region: str
    rows: Expr
    columns: Expr
    overlap: Expr


class Camera(Record, frozen=True, kw_only=True):
    """A sensor mount. Size in pixels, field of view in degrees, channels among rgb, depth, semantic."""

    name: str
    view: Literal["nadir", "front", "oblique"]
    width: Expr
    height: Expr
    hfov: Expr
    channels: tuple[str, ...]
    capture: Literal["on_request", "each_tick"] = "on_request"


class Argument(Record, frozen=True, kw_only=True):
    """One argument of a verb; `dimension` is the SI unit it is given in ("m", "deg", "" for a bare number)."""

    name: str
    dimension: str = ""
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
    """What an interaction moves and says, the same in a mission and in its instances.

    `by` names the engine of who acts, or the role of the agents that control them. `takes`, `source` (the author's
    `from`), `gives` and `up_to` are names of states and limits without units, "" where there is none: `takes` and
    `source` lower the target's state by what the actor's allows, `takes` alone works it off, `gives` raises the actor's
    state as far as its `up_to` and out of the target's `source`. `status` is the target's word afterwards, "" for the
    name with `d` or `ed`; `told` says which agents learn of it (`lingjing.kernel.event_visibility`), "" for the usual.
    """

    name: str
    by: str
    status: str = ""
    takes: str = ""
    source: str = ""
    gives: str = ""
    up_to: str = ""
    told: Literal["", "all", "actor", "none"] = ""

    @property
    def moves_goods(self) -> bool:
        """Whether something changes hands; then it may happen again and again."""
        return bool(self.gives or (self.takes and self.source))

    @property
    def works_off(self) -> bool:
        """Whether it lowers a state of the target while the actor is there, and nobody gets what is taken."""
        return bool(self.takes) and not self.source

    @property
    def carried(self) -> str:
        """The state of the actor that goods are taken from or put into; "" if nothing changes hands."""
        return self.source if self.takes else self.gives

    @property
    def own(self) -> str:
        """The state of the target that goods come from or go to; "" for a supply that is not counted."""
        return self.takes or self.source

    @property
    def done_word(self) -> str:
        """The target's status afterwards."""
        return self.status or self.name + ("d" if self.name.endswith("e") else "ed")


class Interaction(Exchange, frozen=True, kw_only=True):
    """`interaction rescue { by = vessel, within = 50 m, lasting = 20 s }` of a target's type: what an actor does to it.

    `within` is an inclusive radius in metres, `lasting` how long the actor stays there in seconds. `aboard` says
    whether the actor takes the target along; None: if it drifts.
    """

    within: Expr
    lasting: Expr | None = None
    aboard: Expr | None = None


class CameraMount(Record, frozen=True, kw_only=True):
    """`mount front { ahead = 0.3 m, above = -0.05 m, tilt = 10 deg }` of a type: where its cameras of a view sit.

    Metres ahead of and above the body's position, degrees below the horizon. Without a `gimbal` the camera pitches and
    rolls with the body.
    """

    view: Literal["nadir", "front", "oblique"]
    ahead_m: float
    above_m: float
    tilt_deg: float
    gimbal: bool = True


class BodyPart(Record, frozen=True, kw_only=True):
    """`part basket : box { length = 1 m, width = 1 m, height = 1 m, above = -4 m, colour = brown }` of a type: a solid
    that is drawn as a part of its bodies.

    It fills a box of `length` by `width` by `height` metres along, across and up, turned clockwise by `heading` degrees
    from the body's heading. Its middle lies `ahead`, `right` and `above` metres from the body's position.
    """

    name: str
    shape: Literal["box", "cylinder", "sphere", "cone"]
    length_m: float
    width_m: float
    height_m: float
    ahead_m: float = 0.0
    right_m: float = 0.0
    above_m: float = 0.0
    heading_deg: float = 0.0
    colour: str = "grey"


class Group(Record, frozen=True, kw_only=True):
    """A declared entity or an indexed group of them: `asset uav[1..uavs] : quadrotor` or `target victim[…] : …`.

    `count` is None for a single entity. `index` is the name the index has inside the block (`i`).
    `labels`, if given, are the source's own names (equipment codes of a `resetScenario`). `bases` are the types that
    `type` extends, nearest first: what draws or sizes a type it does not know falls back on them.
    """

    name: str
    role: Literal["asset", "target"]
    type: str
    engine: str
    count: Expr | None = None
    index: str = "i"
    properties: tuple[Property, ...] = ()
    cameras: tuple[Camera, ...] = ()
    verbs: tuple[Verb, ...] = ()
    labels: tuple[str, ...] = ()
    when: Guard | None = None
    bases: tuple[str, ...] = ()
    interactions: tuple[Interaction, ...] = ()
    mounts: tuple[CameraMount, ...] = ()
    parts: tuple[BodyPart, ...] = ()


class Channel(Record, frozen=True, kw_only=True):
    """What an agent observes: `uav[i].*`, `cells`, `peers.position`, `events`.

    `source` is an entity expression, or a Symbol for the built-in sources `events`, `peers` and grid names;
    `fields` is the tuple of observed fields, ("*",) for all that are not hidden.
    """

    source: Expr
    fields: tuple[str, ...] = ("*",)


class Agent(Record, frozen=True, kw_only=True):
    """`agent scout[i in 1..uavs] as searcher controls uav[i] { observes … }`."""

    name: str
    role: str
    count: Expr | None = None
    index: str = "i"
    controls: tuple[Expr, ...] = ()
    observes: tuple[Channel, ...] = ()
    prompt: str = ""
    when: Guard | None = None
    budget: AllowanceDeclaration | None = None


class Authority(Record, frozen=True, kw_only=True):
    """`authority searcher may command boat when …`: a role may command a resource it does not embody."""

    role: str
    resource: Expr
    when: Guard | None = None


class Field(Record, frozen=True, kw_only=True):
    """One field of a message record. `type` is one of name, text, number, flag, position, box, frame, names.

    A number may have a `unit`: the SI unit it is sent in (`kg` for a field of type `mass`).
    """

    name: str
    type: Literal["name", "text", "number", "flag", "position", "box", "frame", "names"]
    optional: bool = False
    minimum: float | None = None
    maximum: float | None = None
    unit: str = ""


class MessageKind(Record, frozen=True, kw_only=True):
    """`message detection : report from searcher to all`. `category` is what the metrics count it as."""

    name: str
    type: str
    category: Literal["report", "assignment", "target_status", "other"]
    fields: tuple[Field, ...]
    senders: tuple[str, ...]
    recipients: tuple[str, ...]
    when: Guard | None = None


class Comms(Record, frozen=True, kw_only=True):
    """Bus settings; `hub` names the agent that star mode routes through. Delay in ticks, payload in bytes, `range` in
    metres between sender and receiver, `loss` the share of messages that never arrive, `receipts` whose receipts an
    agent sees: its `own`, `all` of them or `none`."""

    hub: str | None = None
    delay: Expr | None = None
    payload: Expr | None = None
    range: Expr | None = None
    loss: Expr | None = None
    receipts: Literal["own", "all", "none"] = "own"


class RuleParameter(Record, frozen=True, kw_only=True):
    """A typed parameter of a rule: `domain` names a group (`victim`) or a message kind (`detection`)."""

    name: str
    domain: str


class Rule(Record, frozen=True, kw_only=True):
    """`adjudicate matched(v: victim, r: detection) { when … }`: becomes an event, once per binding, when true.

    `matching` is true if the body compares a report with `truth(…)`: such a rule is solved one to one per frame.
    """

    name: str
    parameters: tuple[RuleParameter, ...]
    condition: Expr
    matching: bool = False


class Unlock(Record, frozen=True, kw_only=True):
    """`unlock rescue(v: victim) when …`: the kernel allows an interaction; the owning engine performs and emits it."""

    interaction: str
    parameters: tuple[RuleParameter, ...]
    condition: Expr


class Counted(Record, frozen=True, kw_only=True):
    """What a counted budget counts: commands to a resource (`verb` empty: all of them), or messages of a kind."""

    kind: Literal["command", "message"]
    resource: Expr | None = None
    name: str = ""


class Limit(Record, frozen=True, kw_only=True):
    """`limit moves <= 50 counts dog.forward, dog.left`: beyond the bound such a command or message is rejected."""

    name: str
    most: Expr
    counts: tuple[Counted, ...]
    when: Guard | None = None


class Stage(Record, frozen=True, kw_only=True):
    """`stage detect per v in victim { done when …, ticks <= 40, weight = 2 }`.

    `ticks` bounds the ticks from the stage's beginning (the end of the stages it depends on, else the start) to its
    end; `weight` is its share in the subtask score (1 if not given); `limits` count within the stage.
    """

    name: str
    condition: Expr
    variable: str | None = None
    domain: str | None = None
    ticks: Expr | None = None
    weight: Expr | None = None
    limits: tuple[Limit, ...] = ()


class Permit(Record, frozen=True, kw_only=True):
    """`permit van.setDestination when …`: until then the kernel rejects the command; no verb means all of them."""

    resource: Expr
    condition: Expr
    verb: str = ""


class Constraint(Record, frozen=True, kw_only=True):
    """`constraint hard fence per u in uav { always u in area }`, checked at every macro-step.

    An episode in which a hard one was broken is no success; a soft one takes `penalty` off the score for each binding
    that broke it.
    """

    name: str
    kind: Literal["hard", "soft"]
    condition: Expr
    variable: str | None = None
    domain: str | None = None
    penalty: Expr | None = None
    when: Guard | None = None


class Inspection(Record, frozen=True, kw_only=True):
    """`inspection checked of van by uav { within = 25 m, replan = trafficJam }`.

    The waypoints of the asset's route must each come within reach of one of the inspectors, in their order if `order`
    is `strict`. A message of the kind `replan` asks the asset's engine for another route; the inspection then starts
    again at its first waypoint. With a `destination` (a target) the engine is asked for the way there at the start;
    without one the route is that of the asset's own command.
    """

    name: str
    asset: Expr
    by: tuple[Expr, ...]
    within: Expr
    order: Literal["strict", "any"] = "strict"
    replan: str = ""
    when: Guard | None = None
    destination: Expr | None = None


class Change(Record, frozen=True, kw_only=True):
    """One effect of an event: a new weather, or an entity that appears or vanishes."""

    kind: Literal["weather", "appear", "vanish"]
    weather: tuple[Property, ...] = ()
    entity: Expr | None = None


class EventDeclaration(Record, frozen=True, kw_only=True):
    """`event squall at 12 tick { weather { … }, appear jam[2] }`: what happens by itself at a time of the mission.

    `at` counts ticks or, with a unit of time, seconds; it may be a draw. What some event lets appear is not there
    before.
    """

    name: str
    at: Expr
    changes: tuple[Change, ...]
    when: Guard | None = None


class Sweep(Record, frozen=True, kw_only=True):
    """`sweep altitude over altitude in [60 m, 100 m, 140 m] when mode == star`: a matched study.

    One run for every combination of the values of `parameters`, each with the same seeds; `when` picks the modes.
    """

    name: str
    parameters: tuple[str, ...]
    values: tuple[tuple[Expr, ...], ...]
    when: Guard | None = None


class Relation(Record, frozen=True, kw_only=True):
    """One of the paper's five coordination relations, as the mission declares it."""

    kind: Literal["information_handoff", "cooperation", "competition", "guidance", "dependency"]
    source: str
    target: str
    mutual: bool = False
    carries: str | None = None
    over: str | None = None
    by: str | None = None
    per: str | None = None
    when: Guard | None = None


class Reveal(Record, frozen=True, kw_only=True):
    """`reveal image(target) to role`: the one audited way out of `hidden`."""

    what: Literal["image"]
    entity: Expr
    role: str


class Origin(Record, frozen=True, kw_only=True):
    """Where the mission came from: the file, its digest, and the untouched document it was read from, if JSON.

    `draws` is how the document's template places each group that it draws; the document may give the places itself.
    `places` are the JSON paths at which the document places entities, by their ids.
    """

    file: str = ""
    sha256: str = ""
    document: str = ""
    draws: dict[str, Expr] = {}
    places: dict[str, str] = {}


class Mission(Record, frozen=True, kw_only=True):
    """The typed mission: what a text says of it, checked; `docs/language.md` says what each part means."""

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

    def __repr__(self) -> str:
        """One line; `lingjing.mission.document.encode` writes the whole."""
        counts = {"parameters": self.parameters, "groups": self.groups, "agents": self.agents, "rules": self.rules}
        held = ", ".join(f"{len(parts)} {name}" for name, parts in counts.items())
        return f"<Mission {self.name} {self.title[:60]!r}: {held}, {'/'.join(self.modes.allowed)}>"
