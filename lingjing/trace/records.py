"""The record types of an episode: the data that engines, agents and the kernel exchange, and that the trace stores.

Records are frozen structures. They cross process borders as msgpack and are stored in the trace as JSON (ADR 0001).

Units, unless a field says otherwise: metres, seconds, degrees (headings clockwise from north), watt-hours. Positions
and velocities are in the world frame (east, north, up). `time_s` is simulation time. The few wall-clock fields have
`wall` in their names and are left out of the digest.

A letter in brackets is the symbol of the same quantity in the paper's table of run-time symbols.
"""

from __future__ import annotations

import warnings
from typing import Final, Literal

import msgspec

from lingjing.errors import AbortCause
from lingjing.mission.instance import Datum, GivenOption, Instance, Vector, Weather


class TraceRecord(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Base of every record: frozen, keyword-only, strict about unknown fields."""


Reason = Literal["success", "failure", "constraint", "late", "budget", "infrastructure-abort", "interrupted", "error"]
"""The reason for the end of an episode.

- `success`, `failure`: the mission's success or failure condition holds.
- `constraint`: a hard constraint was broken.
- `late`: a stage has used up its own ticks.
- `budget`: the mission's ticks have run out.
- `infrastructure-abort`: an engine, or a service that a policy needs, failed.
- `interrupted`: the program received a signal.
- `error`: a program has a defect.
"""

CUT_SHORT: tuple[Reason, ...] = ("infrastructure-abort", "interrupted", "error")
"""Reasons of episodes that did not end by themselves. Such an episode counts neither for nor against a policy."""

DEAD: Final = "dead"
"""The status of a body that is out of action: it obeys no command and takes part in no interaction."""

GROUNDED: Final = "grounded"
"""The status of an aircraft on the ground, before take-off or after landing."""

FALLEN: Final = "fallen"
"""The status of a body that must get up before it can act."""

AGROUND: Final = "aground"
"""The status of a hull that is stuck."""

UnitBox = tuple[float, float, float, float]
"""A box in a picture: left, top, right, bottom as shares of its width and height, origin top left."""


class BodyState(TraceRecord, frozen=True, kw_only=True):
    """The state of one entity at one instant, as reported by the engine that owns it.

    Other engines receive the same record as the mirror of the entity.
    """

    id: str
    position: Vector
    velocity: Vector = (0.0, 0.0, 0.0)
    """m/s."""
    heading_deg: float = 0.0
    pitch_deg: float = 0.0
    """Positive with the nose up."""
    roll_deg: float = 0.0
    status: str = ""
    """A short state word: `grounded`, `hovering`, `moving`, `idle`, `adrift`, `rescued`, `dead`, …"""
    resources: dict[str, float] = {}
    """Stocks by name, such as `battery_wh`, or `battery` as a share from 0 to 1."""
    kind: str = ""
    """The kind of a background body that is no entity of the mission: `car`, `bus`, `truck`, `person`; else ""."""
    joints: tuple[float, ...] = ()
    """Joint angles of a legged body in radians, in the order of its model. For drawing."""


class Action(TraceRecord, frozen=True, kw_only=True):
    """A candidate physical command [u], as a policy returns it."""

    verb: str
    arguments: dict[str, Datum] = {}
    resource: str | None = None
    """The entity that is to act. None: the first resource that the agent controls."""
    tick: int | None = None
    """The boundary that the command was decided for. The kernel rejects one for another boundary as stale. None: no
    such check."""


class Outgoing(TraceRecord, frozen=True, kw_only=True):
    """A candidate message [m], as a policy returns it."""

    kind: str
    body: dict[str, Datum] = {}
    to: tuple[str, ...] = ()
    """Ids of the receiving agents. It counts only where the topology leaves a choice, which is at the hub."""


class UnreadBox(TraceRecord, frozen=True, kw_only=True):
    """A box in a model's answer that could not be used, as the model wrote it."""

    frame: str
    """The id of the frame that the report names."""
    numbers: tuple[float, float, float, float]
    """The four numbers, in whatever unit and order the model means."""


class Usage(TraceRecord, frozen=True, kw_only=True):
    """The consumption of model inference by one policy call."""

    calls: int = 0
    prompt_tokens: int = 0
    completion_tokens: int = 0
    cost_usd: float = 0.0
    answers: int = 0
    """Answers of the model, those to repeated requests included."""
    valid_answers: int = 0
    """The part of `answers` that matches the requested schema."""
    unread_boxes: tuple[UnreadBox, ...] = ()
    """The boxes of reports in the other answers."""


NOTE = "[note] "
"""Beginning of a line of a thought that `lingjing run` prints after a lost episode."""


class Decision(TraceRecord, frozen=True, kw_only=True):
    """The output of a policy for one tick: at most one physical command and a finite list of messages."""

    command: Action | None = None
    messages: tuple[Outgoing, ...] = ()
    thought: str = ""
    """Free text for readers of the trace. It decides nothing. After a lost episode `lingjing run` prints the lines that
    begin with `NOTE`."""
    usage: Usage | None = None
    """The cost of the model calls; None if the policy calls no model."""


class Command(TraceRecord, frozen=True, kw_only=True):
    """An admitted command [û] on its way to an engine."""

    id: str
    """`c<tick>-<n>`, or `k<tick>-<n>` for a command of the kernel (see `lingjing.trace.request_ids`)."""
    tick: int
    sender: str
    resource: str
    verb: str
    arguments: dict[str, Datum] = {}
    origin: Literal["agent", "kernel"] = "agent"
    """`kernel` for a command that the kernel issues itself, such as an unlock."""

    def receipt(
        self,
        by: str,
        status: Status,
        time_s: float,
        reason: str = "",
        detail: str = "",
        progress: float | None = None,
    ) -> Receipt:
        """Return a receipt for this command."""
        return Receipt(
            request=self.id,
            tick=self.tick,
            sender=self.sender,
            resource=self.resource,
            status=status,
            reason=reason,
            detail=detail,
            by=by,
            time_s=time_s,
            progress=progress,
        )


Status = Literal["accepted", "running", "completed", "rejected", "timed_out", "substituted"]

REFUSED: tuple[Status, ...] = ("rejected", "timed_out", "substituted")
"""The statuses of receipts for requests that were not carried out."""


class Receipt(TraceRecord, frozen=True, kw_only=True):
    """A typed receipt [C] for one command or message."""

    request: str
    """The id of the command or message."""
    tick: int
    """The decision tick of the request."""
    sender: str
    resource: str
    status: Status
    reason: str = ""
    """A stable code: `busy`, `conflict`, `no_authority`, `unknown_verb`, `bad_argument`, `clipped`, `preempted`,
    `unreachable`, `battery`, `policy_timeout`, `policy_error`, `malformed`, …; "" if there is nothing to say."""
    detail: str = ""
    """One sentence for readers."""
    by: str = "kernel"
    """The issuer: `bus`, `kernel`, `policy` or the name of an engine."""
    time_s: float = 0.0
    progress: float | None = None
    """Completed share of a long request, 0 to 1. None if the issuer reports none."""


class TaskEvent(TraceRecord, frozen=True, kw_only=True):
    """An event that an engine reports at an instant.

    Examples are `arrived`, `rescue`, `collided` and `battery_empty`. An event with a `name` is one that the mission
    declares (`lingjing.kernel.mission_events`).
    """

    kind: str
    """For an event of the mission: `occurred`, `undone`, or a change (`weather`, `appeared`, `vanished`, `changed`)."""
    entities: tuple[str, ...]
    time_s: float
    values: dict[str, float] = {}
    """Measured quantities. For `weather`: the fields that change, with their new values. For `changed`: the new value
    of a state."""
    name: str = ""
    """The name that the mission gives to an event; "" for an event of an engine."""
    word: str = ""
    """For `changed`: the new status word."""

    @property
    def line(self) -> str:
        """The event in words: `collided uav[1] uav[2]`, `weather front: visibility_m 800, wind_mps 12`."""
        entities = " ".join(self.entities)
        if not self.name:
            return f"{self.kind} {entities}".rstrip()
        changes = ", ".join(f"{key} {value:g}" for key, value in sorted(self.values.items())) or self.word
        if self.kind in ("occurred", "undone"):
            return f"{self.kind} {self.name}: {entities}" if entities else f"{self.kind} {self.name}"
        return f"{self.kind} {self.name}: {' '.join(part for part in (entities, changes) if part) or 'nothing changes'}"


class Route(TraceRecord, frozen=True, kw_only=True):
    """A route that a road engine planned for an entity. An inspection of a route reads this record."""

    entity: str
    number: int
    """Counts the routes of the entity from 1. A new plan has a new number."""
    waypoints: tuple[Vector, ...]
    """Points on the lanes from the entity to its destination, at turns and about every 200 m. The last one is the
    destination."""
    length_m: float
    duration_s: float
    time_s: float
    request: str = ""
    """The id of the command that requested the route, or ""."""


class Snapshot(TraceRecord, frozen=True, kw_only=True):
    """The states of all entities of all engines at one macro-step."""

    time_s: float
    states: tuple[BodyState, ...]
    ambient: tuple[BodyState, ...] = ()
    """Background traffic, which travels with the boundary (ADR 0008). It is recorded at decision boundaries only."""


class Box(TraceRecord, frozen=True, kw_only=True):
    """The ground truth of one entity in one picture."""

    entity: str
    cls: str
    box: UnitBox
    pixels: int
    contrast: float | None = None
    """Root mean square of the change that the target makes to these pixels, 0 to 255 (ADR 0012). None if it was not
    measured."""


class CameraPose(TraceRecord, frozen=True, kw_only=True):
    """The pose and the projection of a camera."""

    position: Vector
    """The optical centre."""
    heading_deg: float
    """Direction of the optical axis in plan; for a nadir camera, the direction of the top edge of the picture."""
    tilt_deg: float
    """Angle of the optical axis below the horizon: 90 for nadir, 0 for a front camera."""
    roll_deg: float = 0.0
    hfov_deg: float = 84.0
    """Horizontal field of view."""
    width: int = 1920
    height: int = 1080


class FrameInfo(TraceRecord, frozen=True, kw_only=True):
    """A captured picture without its pixels."""

    id: str
    """`f<tick>-<entity>-<camera>`."""
    entity: str
    camera: str
    tick: int
    time_s: float
    pose: CameraPose
    channels: tuple[str, ...]
    """Names of the recorded channels: `rgb`, `depth`, `semantic`, `instance`."""
    boxes: tuple[Box, ...] = ()
    """The entities that are visible in the picture."""
    faint: tuple[Box, ...] = ()
    """Targets that were drawn with too little contrast to be seen. They have no visible pixels, and no report can match
    them."""
    others: tuple[Box, ...] = ()
    """Things without an entity that can be taken for a target: vehicles of the traffic, passers-by, buoys, flotsam,
    parked cars, lamps and other furniture. `entity` is empty. Touching things of one class share a box."""
    sha256: str = ""
    """SHA-256 (hex) of the stored JPEG; "" if no picture was stored."""
    channels_sha256: str = ""
    """SHA-256 (hex) of the raw depth, class ids and instance numbers; "" if there are none."""
    instance_ids: dict[str, int] = {}
    """The numbers in the channel `instance` of the entities that it shows, by entity. An entity has the same number in
    all pictures of an episode."""
    renderer: str = ""
    """The program and device that drew the picture. Equal pixels are promised for equal renderers only."""


class Absent(TraceRecord, frozen=True, kw_only=True):
    """A requested picture that was not delivered. The agent has no observation of it and can detect nothing in it."""

    entity: str
    camera: str
    tick: int
    reason: str


class Envelope(TraceRecord, frozen=True, kw_only=True):
    """One edge, from sender to recipient, of an admitted message [M̂]."""

    id: str
    """`m<tick>-<n>`. All edges of one message have the same id."""
    tick: int
    sender: str
    recipient: str
    kind: str
    category: str
    """The category that the mission declares for the kind."""
    body: dict[str, Datum]
    bytes: int
    """Size of the encoded body."""
    deliver_at: int
    """The tick of the boundary at which the recipient receives it."""


class AdjudicatedEvent(TraceRecord, frozen=True, kw_only=True):
    """An adjudicated event [V].

    Policies receive only its public projection (`lingjing.kernel.visibility`), one boundary later.
    """

    id: str
    kind: str
    """The name of the rule."""
    tick: int
    time_s: float
    bindings: tuple[str, ...]
    """Entity ids that the variables of the rule are bound to."""
    evidence: dict[str, Datum] = {}
    """The quantities that made the rule true."""


class StageChange(TraceRecord, frozen=True, kw_only=True):
    """The completion of a mission stage."""

    stage: str
    subject: str
    """The subject that completed the stage; "" if the stage is complete for all."""
    tick: int
    time_s: float


class EntityView(TraceRecord, frozen=True, kw_only=True):
    """The part of an entity that an observation channel shows. A field that is not observed is None."""

    id: str
    type: str
    position: Vector | None = None
    velocity: Vector | None = None
    """m/s."""
    heading_deg: float | None = None
    status: str | None = None
    resources: dict[str, float] | None = None
    busy: bool | None = None
    """True while the entity carries out a long request."""
    route: tuple[Vector, ...] | None = None
    """Waypoints of the latest route that was planned for the entity."""
    assignment: tuple[float, float] | None = None
    """Destination (east, north) in metres of the latest accepted command that names one. `*` shows it for vessels."""
    specific_force: Vector | None = None
    """Acceleration less gravity, as an inertial unit measures it, in the body's frame (ahead, left, up), m/s²."""
    angular_rate: Vector | None = None
    """Angular rates, as an inertial unit measures them, about the body's axes (ahead, left, up), rad/s."""


class CellView(TraceRecord, frozen=True, kw_only=True):
    """The shared search state of one cell: its first photograph."""

    name: str
    visited_tick: int | None = None
    """Tick of the first photograph over the cell. None if there is none."""
    visited_by: str | None = None
    """The entity that took the photograph. None if there is none."""
    seen: float | None = None
    """Share of the cell's ground that pictures of all agents have shown, 0 to 1. None if it is hidden."""


class EventView(TraceRecord, frozen=True, kw_only=True):
    """The public projection of a task event or an adjudicated event, without numbers and hidden entities."""

    id: str
    kind: str
    tick: int
    entities: tuple[str, ...]


class ObservationRecord(TraceRecord, frozen=True, kw_only=True):
    """The observation of one agent at a boundary [o]."""

    agent: str
    entities: tuple[EntityView, ...] = ()
    cells: tuple[CellView, ...] = ()
    events: tuple[EventView, ...] = ()
    frames: tuple[str, ...] = ()
    """Ids of the pictures. The pixels are stored once, in topics of their own."""
    absent: tuple[Absent, ...] = ()
    privileged: bool = False
    """True if the policy received the ground truth as well."""
    sha256: str = ""
    """SHA-256 (hex) of the complete policy input: observation, inbox and decoded pixels."""
    weather: Weather | None = None
    """The weather at the boundary. None in older traces."""


class InboxRecord(TraceRecord, frozen=True, kw_only=True):
    """The inbox of one agent at a boundary [I]."""

    agent: str
    messages: tuple[str, ...] = ()
    """Ids of the envelopes."""
    receipts: tuple[Receipt, ...] = ()


class DecisionRecord(TraceRecord, frozen=True, kw_only=True):
    """The decision of one policy [u, m], or its substitute if the policy failed."""

    agent: str
    decision: Decision
    substituted: str = ""
    """The reason code of a substitution; "" if the decision is the policy's own."""
    detail: str = ""
    """The error in words; "" if there is none."""
    policy_wall_s: float = 0.0
    """Wall-clock duration of the policy call."""


class RelationRecord(TraceRecord, frozen=True, kw_only=True):
    """One occurrence of a declared coordination relation."""

    kind: str
    source: str
    target: str
    by: str
    """The id of the message, event or command that carries the relation."""
    tick: int


class EngineStatus(TraceRecord, frozen=True, kw_only=True):
    """The status of one engine at a boundary."""

    engine: str
    time_s: float
    """The engine's own clock."""
    frame: int
    """The engine's frame counter."""
    wait_wall_s: float = 0.0
    """Wall-clock time that the barrier waited for the engine."""


class BoundaryRecord(TraceRecord, frozen=True, kw_only=True):
    """One committed boundary: the data that `Log` receives in the paper's Algorithm 1, in the paper's order."""

    tick: int
    time_s: float
    snapshots: tuple[Snapshot, ...]
    """The macro-steps since the previous boundary. The last one is the state of this boundary [T]."""
    engines: tuple[EngineStatus, ...]
    task_events: tuple[TaskEvent, ...]
    frames: tuple[FrameInfo, ...]
    """Pictures that were captured at this boundary. Their pixels are stored in topics of their own."""
    observations: tuple[ObservationRecord, ...]
    inboxes: tuple[InboxRecord, ...]
    decisions: tuple[DecisionRecord, ...]
    commands: tuple[Command, ...]
    messages: tuple[Envelope, ...]
    receipts: tuple[Receipt, ...]
    events: tuple[AdjudicatedEvent, ...]
    stages: tuple[StageChange, ...]
    relations: tuple[RelationRecord, ...] = ()
    """Occurrences of coordination relations. The kernel leaves this field empty; the caller that writes the trace fills
    it in (`lingjing.analysis.relations`)."""
    reward: float
    """The score so far."""
    done: bool
    scr: float = 0.0
    """Subtask completion rate, 0 to 1."""
    digest: str = ""
    """SHA-256 (hex) over the previous digest and this record in the form of `lingjing.trace.digest_form`."""
    wall_s: float = 0.0
    """Wall-clock duration of the tick."""
    routes: tuple[Route, ...] = ()
    """Routes that were planned since the previous boundary."""
    unreachable_links: tuple[tuple[str, str], ...] = msgspec.field(default=(), name="unheard")
    """Pairs of entities without a radio link between them. The encoded name is `unheard`."""

    @property
    def unheard(self) -> tuple[tuple[str, str], ...]:
        """Deprecated name of `unreachable_links`."""
        warnings.warn("use `unreachable_links` instead of `unheard`", DeprecationWarning, stacklevel=2)
        return self.unreachable_links


class Thought(TraceRecord, frozen=True, kw_only=True):
    """The thought of one agent at a boundary, as a message for viewers. The boundary record holds the same text."""

    agent: str
    tick: int
    time_s: float
    text: str
    tokens: int = 0
    """Prompt and completion tokens of the model calls."""
    replaced: str = ""
    """The reason for a substituted decision; "" if the decision is the policy's own."""


class Score(TraceRecord, frozen=True, kw_only=True):
    """The score at a boundary, as a message for viewers. The boundary record holds the same values."""

    tick: int
    time_s: float
    score: float
    scr: float
    """Subtask completion rate, 0 to 1."""
    subtasks: int
    """Number of completed stages, summed over all subjects."""
    done: bool


class AgentBinding(TraceRecord, frozen=True, kw_only=True):
    """The policy of one agent."""

    agent: str
    policy: str
    privileged: bool = False
    """True for an oracle, which receives the ground truth."""
    arguments: dict[str, GivenOption] = {}
    """The options of the policy."""


Faculty = Literal["perception", "localisation", "waypoint", "routing", "handoff", "execution"]
"""An ability of an agent that can be at fault by itself. `lingjing.causal.faculties` names the record of each."""


class Substitution(TraceRecord, frozen=True, kw_only=True):
    """The replacement of one faculty of one agent by the truth at a range of boundaries."""

    faculty: Faculty
    agent: str
    first: int
    """The first boundary of the range."""
    last: int | None = None
    """The last boundary of the range, included. None: the range has no end."""

    def covers(self, tick: int) -> bool:
        """Return whether the boundary `tick` is in the range."""
        return self.first <= tick and (self.last is None or tick <= self.last)


class MessageChange(TraceRecord, frozen=True, kw_only=True):
    """An intervention on the delivery of one message."""

    message: str
    """The id of the message."""
    act: Literal["drop", "delay", "repeat", "forge", "withhold"]
    """`drop`: it is not delivered. `delay`: it is delivered `ticks` later. `repeat`: it is delivered again `ticks`
    later. `forge`: the fields of `body` replace its own. `withhold`: it is not sent, so no adjudicator receives it."""
    ticks: int = 0
    body: dict[str, Datum] = {}


class BranchOrigin(TraceRecord, frozen=True, kw_only=True):
    """The origin of a branch: the trace that it continues, and the interventions on it."""

    trace: str
    """File name of the original trace."""
    at: int
    """The boundary up to which both traces are equal."""
    digest: str
    """The digest of the boundary `at`."""
    substitutions: tuple[Substitution, ...] = ()
    messages: tuple[MessageChange, ...] = ()
    reference: str = ""
    """The privileged policy that supplied the substituted decisions; "" if there is none."""


FORMAT = "lingjing-trace/2"
"""The value of `Header.format`. Version 1 had no seals (ADR 0017)."""

DigestVersion = Literal[1, 2]
"""The versions of the form in which boundaries are hashed (`lingjing.trace.digest_form`)."""

DIGEST_VERSION: Final[DigestVersion] = 2
"""The version of new digests. A stored digest is verified in the version of its trace."""


class MovedBody(TraceRecord, frozen=True, kw_only=True):
    """An entity that starts farther from its declared place than it is long, or that is put down onto a surface."""

    entity: str
    declared: Vector
    placed: Vector
    moved_m: float
    """Distance between the two places: in space if the mission gives an elevation, else in plan."""
    on: str = ""
    """The surface that the scene searched for, or the one below an aircraft; "" where the place only had to be free."""


class RemoteBinding(TraceRecord, frozen=True, kw_only=True):
    """An engine that a foreign session played over LJ-ENGINE, the wire protocol of the paper's engines."""

    engine: str
    session: str
    """The key of the session: `LJ-ENGINE_airsim`."""
    profile: str
    """The form of the commands, as `lingjing serve --profile` names it; `auto` if the first acknowledgement decides."""
    task_id: str
    """The id of the episode on the wire."""
    observes: Literal["tick", "sync"] = "tick"
    """The times at which states are requested: at decision boundaries, or at every macro-step."""
    asks: bool = True
    """False if a session of the profile `script` is not asked for observations."""


class EngineFrame(TraceRecord, frozen=True, kw_only=True):
    """A frame of a foreign engine's session, sent or received, for a replay without that engine.

    An *exchange* is one call of an engine that sends frames and waits for their replies.
    """

    number: int
    """Counts the frames of an episode from 0."""
    tick: int
    """The boundary that was recorded next; the last one again for frames after it."""
    engine: str
    """The engine that sent or read the frame; "" if none did."""
    session: str
    """The key of the session: `LJ-ENGINE_airsim`."""
    exchange: int = -1
    """The exchange of the engine, counted from 0; -1 outside of one."""
    use: Literal["request", "reply", "event", "late", "unknown", "broken", "notice", "upload"]
    """`request`, `notice`: sent by the backend, the second without a reply. `reply`, `event`: received and read.
    `late`: a reply after its deadline, or telemetry that newer telemetry replaced. `unknown`: a reply to no request.
    `broken`: no frame of the protocol. `upload`: a picture that came over HTTP."""
    slot: int = -1
    """The place of a request or a reply in its exchange; -1 for others."""
    text: str
    """The frame; for an upload its form fields and the SHA-256 of the file. Cut to 1,000 letters if no engine has read
    it."""
    wall_s: float = 0.0
    """Wall-clock seconds since the server began."""


class Header(TraceRecord, frozen=True, kw_only=True):
    """The first record of a trace: the mission instance, the policies and the versions of the software."""

    format: str = FORMAT
    digest_version: DigestVersion = DIGEST_VERSION
    """The version of the digests. A stored header without this field has version 1."""
    instance: Instance
    """The instance with the places that were played (see `moved`)."""
    bindings: tuple[AgentBinding, ...]
    fingerprint: dict[str, str]
    """Versions of the software by name."""
    city_sha256: str = ""
    """SHA-256 (hex) of the city's content."""
    attribution: str = ""
    """Credits that the licences of the map data and of models of others require."""
    started_wall: str = ""
    """Start of the episode, ISO 8601, UTC."""
    policy_seed: int = 0
    """Seed of the random streams of the policies."""
    evaluators: tuple[str, ...] = ("mission",)
    evaluator_options: dict[str, dict[str, GivenOption]] = {}
    branch: BranchOrigin | None = None
    """The origin of a branch; None if the trace is not a branch."""
    moved: tuple[MovedBody, ...] = ()
    """Entities that the scene placed elsewhere than the mission declares."""
    remote_engines: tuple[RemoteBinding, ...] = ()
    """The engines that foreign sessions played."""
    options: dict[str, GivenOption] | None = None
    """The options of the episode that no other field names and that differ from the defaults, without places of files
    (`lingjing.play.options.deciding_options`). None in traces from before the field.
    """


class Outcome(TraceRecord, frozen=True, kw_only=True):
    """The last record of a trace: the result of the episode."""

    success: bool
    reason: Reason
    scr: float
    """Subtask completion rate, 0 to 1."""
    ticks: int
    digest: str
    """The digest of the last boundary."""
    frames_digest: str
    """The last hash of the chain over the pictures."""
    detail: str = ""
    """The cause of the ending where `reason` does not name it: the stage, the constraint or the engine."""
    hint: str = ""
    """A remedy for an infrastructure abort."""
    cause: AbortCause = ""
    """The thing that was lost in an abort that a policy can cause; "" for any other ending."""
    wall_s: float = 0.0
    score: float = 0.0
    """The mission's own score, with weights and penalties."""
    processes: dict[str, dict[str, str]] = {}
    """The numerical runtime of each process that took part (`lingjing.numerics`)."""
    ambient_random: tuple[str, ...] = ()
    """Agents with policy calls that used an unseeded global random generator. The digest then differs between runs."""
