"""The vocabulary of an episode: what engines, agents and the kernel say to each other and what the trace keeps.

Plain frozen values that travel over process borders (msgpack) and into the trace (JSON) as they are. Units: metres,
seconds, degrees (headings clockwise from north), watt-hours. Simulation time is `time_s`, never a wall clock; the
few wall-clock fields end in `_wall_s` and are left out of the digest.

Symbols in brackets are those of the paper's table of run-time symbols.
"""

from __future__ import annotations

from typing import Final, Literal

import msgspec

from lingjing.mission.instance import Datum, GivenOption, Instance, Vector, Weather


class TraceRecord(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Base of every record: frozen, keyword-only."""


Reason = Literal["success", "failure", "constraint", "late", "budget", "infrastructure-abort", "interrupted", "error"]
"""Why an episode ended: the mission's success or failure condition holds; a hard constraint was broken; a stage used up
its own ticks; the mission's ticks ran out; the world or what a policy stands on failed; somebody stopped it; a program
has a fault."""

CUT_SHORT: tuple[Reason, ...] = ("infrastructure-abort", "interrupted", "error")
"""Reasons of episodes that did not end by themselves: they count neither for nor against a policy."""

DORMANT = "dormant"
"""The status of an entity that has not appeared yet or is gone: not drawn, not hit, seen by nobody."""

CLEARED = "cleared"
"""The status of what blocked a road and is gone."""

DEAD = "dead"
"""The status of a body that does nothing any more: neither obeys, is seen to act or is acted on."""

GROUNDED = "grounded"
"""The status of an aircraft that stands where it has not taken off yet, or has landed."""

FALLEN, AGROUND = "fallen", "aground"
"""The status of a body that cannot act until it has got up, and of a hull that is stuck."""

UnitBox = tuple[float, float, float, float]
"""Left, top, right, bottom as shares of a picture's width and height; origin top left."""


class BodyState(TraceRecord, frozen=True, kw_only=True):
    """One entity at one instant, as its owner reports it; also the mirror that other engines receive.

    Velocity is in the world frame (m/s). `resources` holds stocks such as `battery_wh` or `battery` (0..1);
    `status` is a short state word (`grounded`, `hovering`, `moving`, `idle`, `adrift`, `rescued`, `dead`, …).
    `kind` says what a body is that is nobody's entity (`car`, `bus`, `truck`, `person`); `joints` are the angles of a
    legged body's joints (radians, order of its model), for drawing.
    """

    id: str
    position: Vector
    velocity: Vector = (0.0, 0.0, 0.0)
    heading_deg: float = 0.0
    pitch_deg: float = 0.0
    roll_deg: float = 0.0
    status: str = ""
    resources: dict[str, float] = {}
    kind: str = ""
    joints: tuple[float, ...] = ()


class Action(TraceRecord, frozen=True, kw_only=True):
    """A candidate physical command [u]: `resource` is None for the agent's first controlled resource.

    `tick` may name the boundary the command was decided on; a command for another one is refused as stale.
    """

    verb: str
    arguments: dict[str, Datum] = {}
    resource: str | None = None
    tick: int | None = None


class Outgoing(TraceRecord, frozen=True, kw_only=True):
    """A candidate message [m]. `to` names agents and counts only where the topology leaves a choice (the hub)."""

    kind: str
    body: dict[str, Datum] = {}
    to: tuple[str, ...] = ()


class Usage(TraceRecord, frozen=True, kw_only=True):
    """What one policy call spent on model inference; money in US dollars. Of the `answers` that a model gave, repeated
    ones included, `valid_answers` kept to the schema that was asked for."""

    calls: int = 0
    prompt_tokens: int = 0
    completion_tokens: int = 0
    cost_usd: float = 0.0
    answers: int = 0
    valid_answers: int = 0


class Decision(TraceRecord, frozen=True, kw_only=True):
    """What a policy returns: at most one physical command and a finite list of messages."""

    command: Action | None = None
    messages: tuple[Outgoing, ...] = ()
    thought: str = ""
    usage: Usage | None = None


class Command(TraceRecord, frozen=True, kw_only=True):
    """An admitted command [û] on its way to an engine. `id` is `c<tick>-<n>`; `origin` kernel means an unlock."""

    id: str
    tick: int
    sender: str
    resource: str
    verb: str
    arguments: dict[str, Datum] = {}
    origin: Literal["agent", "kernel"] = "agent"

    def receipt(
        self,
        by: str,
        status: Status,
        time_s: float,
        reason: str = "",
        detail: str = "",
        progress: float | None = None,
    ) -> Receipt:
        """A receipt for it."""
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
"""What receipts say of what was asked for and not done."""


class Receipt(TraceRecord, frozen=True, kw_only=True):
    """A typed receipt [C]: `request` is a command or message id; `by` is `bus`, `kernel`, `policy` or an engine's
    name; `reason` a stable code (`busy`, `conflict`, `no_authority`, `unknown_verb`, `bad_argument`, `clipped`,
    `preempted`, `unreachable`, `battery`, `policy_timeout`, `policy_error`, `malformed`, …); `progress` is 0..1."""

    request: str
    tick: int
    sender: str
    resource: str
    status: Status
    reason: str = ""
    detail: str = ""
    by: str = "kernel"
    time_s: float = 0.0
    progress: float | None = None


class TaskEvent(TraceRecord, frozen=True, kw_only=True):
    """Something an engine did or saw: `arrived`, `rescue`, `collided`, `battery_empty`, … at an instant.

    One with a `name` is an event of the mission that happens by itself: `weather`, whose values are the fields that
    change, `appeared` or `vanished` (`lingjing.kernel.scheduled`).
    """

    kind: str
    entities: tuple[str, ...]
    time_s: float
    values: dict[str, float] = {}
    name: str = ""

    @property
    def line(self) -> str:
        """In words: `collided uav[1] uav[2]`, `weather front: visibility_m 800, wind_mps 12`."""
        who = " ".join(self.entities)
        if not self.name:
            return f"{self.kind} {who}".rstrip()
        what = who or ", ".join(f"{key} {value:g}" for key, value in sorted(self.values.items())) or "nothing changes"
        return f"{self.kind} {self.name}: {what}"


class Route(TraceRecord, frozen=True, kw_only=True):
    """The way that a road engine planned for an entity: what an inspection inspects.

    `waypoints` are points on its lanes from where it stands to its destination, some 200 m apart and at turns, the
    last one the destination; `number` counts the entity's routes from 1, so a replan has a new one. `request` is the
    command that asked for it, or "".
    """

    entity: str
    number: int
    waypoints: tuple[Vector, ...]
    length_m: float
    duration_s: float
    time_s: float
    request: str = ""


class Snapshot(TraceRecord, frozen=True, kw_only=True):
    """All entities of all engines at one macro-step; `ambient` (background traffic) at decision boundaries only."""

    time_s: float
    states: tuple[BodyState, ...]
    ambient: tuple[BodyState, ...] = ()


class Box(TraceRecord, frozen=True, kw_only=True):
    """Ground truth of one entity in one frame: a normalised image box, origin top left, and its pixels.

    `contrast` is how much a target changes of these pixels (0..255, root mean square; ADR 0012), None where that was
    not measured.
    """

    entity: str
    cls: str
    box: UnitBox
    pixels: int
    contrast: float | None = None


class CameraPose(TraceRecord, frozen=True, kw_only=True):
    """Where a camera was: optical centre in metres; heading of its image-up (nadir) or optical axis (front) in
    degrees; `tilt_deg` is the axis' angle below the horizon (90 nadir, 0 front)."""

    position: Vector
    heading_deg: float
    tilt_deg: float
    roll_deg: float = 0.0
    hfov_deg: float = 84.0
    width: int = 1920
    height: int = 1080


class FrameInfo(TraceRecord, frozen=True, kw_only=True):
    """All that is known of a captured frame but its pixels. `id` is `f<tick>-<entity>-<camera>`.

    `sha256` is that of the stored JPEG, `channels_sha256` that of the raw depth and class ids (empty if there are
    none); `renderer` is what drew it, part of the fingerprint that pixels are promised equal for. `boxes` is what can
    be seen; `faint` are the targets that were drawn with too little contrast for anybody to see: they have no visible
    pixels, and no report can match them.
    """

    id: str
    entity: str
    camera: str
    tick: int
    time_s: float
    pose: CameraPose
    channels: tuple[str, ...]
    boxes: tuple[Box, ...] = ()
    faint: tuple[Box, ...] = ()
    sha256: str = ""
    channels_sha256: str = ""
    renderer: str = ""


class Absent(TraceRecord, frozen=True, kw_only=True):
    """A picture that was asked for and did not come: no observation, no detection."""

    entity: str
    camera: str
    tick: int
    reason: str


class Envelope(TraceRecord, frozen=True, kw_only=True):
    """One admitted sender-to-recipient edge [M̂]. `id` is `m<tick>-<n>`, shared by all edges of one message."""

    id: str
    tick: int
    sender: str
    recipient: str
    kind: str
    category: str
    body: dict[str, Datum]
    bytes: int
    deliver_at: int


class AdjudicatedEvent(TraceRecord, frozen=True, kw_only=True):
    """An adjudicated event [V]: the rule's name and its binding; `evidence` are the numbers that made it true.

    Policies see only the public projection (`lingjing.kernel.visibility`), one boundary later.
    """

    id: str
    kind: str
    tick: int
    time_s: float
    bindings: tuple[str, ...]
    evidence: dict[str, Datum] = {}


class StageChange(TraceRecord, frozen=True, kw_only=True):
    """A stage of a mission became done for one subject (or for all, with subject "")."""

    stage: str
    subject: str
    tick: int
    time_s: float


class EntityView(TraceRecord, frozen=True, kw_only=True):
    """What an observation channel shows of one entity; a field that is not observed is None.

    `route` are the waypoints of the latest route planned for it.
    """

    id: str
    type: str
    position: Vector | None = None
    velocity: Vector | None = None
    heading_deg: float | None = None
    status: str | None = None
    resources: dict[str, float] | None = None
    busy: bool | None = None
    route: tuple[Vector, ...] | None = None


class CellView(TraceRecord, frozen=True, kw_only=True):
    """The shared search state of one cell: the tick and the entity of the first photograph taken over it."""

    name: str
    visited_tick: int | None = None
    visited_by: str | None = None


class EventView(TraceRecord, frozen=True, kw_only=True):
    """The public projection of a task event or an adjudicated event: no numbers, no hidden entity."""

    id: str
    kind: str
    tick: int
    entities: tuple[str, ...]


class ObservationRecord(TraceRecord, frozen=True, kw_only=True):
    """What one agent saw at a boundary [o]; pictures by frame id (`frames`), the pixels are stored once.

    `sha256` covers the complete policy input (observation, inbox and decoded pixels): two episodes whose agents
    saw the same have the same value. `privileged` says that the truth was handed over too, `weather` is that of the
    boundary (None in older traces).
    """

    agent: str
    entities: tuple[EntityView, ...] = ()
    cells: tuple[CellView, ...] = ()
    events: tuple[EventView, ...] = ()
    frames: tuple[str, ...] = ()
    absent: tuple[Absent, ...] = ()
    privileged: bool = False
    sha256: str = ""
    weather: Weather | None = None


class InboxRecord(TraceRecord, frozen=True, kw_only=True):
    """What one agent's inbox held at a boundary [I]: ids of the envelopes and the receipts shown to it."""

    agent: str
    messages: tuple[str, ...] = ()
    receipts: tuple[Receipt, ...] = ()


class DecisionRecord(TraceRecord, frozen=True, kw_only=True):
    """What one policy returned [u, m], after substitution if it failed; `substituted` is the reason code or "", and
    `detail` says what went wrong."""

    agent: str
    decision: Decision
    substituted: str = ""
    detail: str = ""
    policy_wall_s: float = 0.0


class RelationRecord(TraceRecord, frozen=True, kw_only=True):
    """One occurrence of a declared coordination relation: who did it to whom, carried by what, when."""

    kind: str
    source: str
    target: str
    by: str
    tick: int


class EngineStatus(TraceRecord, frozen=True, kw_only=True):
    """One engine at a boundary: its own clock, its frame counter and what the barrier waited for it."""

    engine: str
    time_s: float
    frame: int
    wait_wall_s: float = 0.0


class BoundaryRecord(TraceRecord, frozen=True, kw_only=True):
    """One committed boundary, everything Algorithm 1's `Log` receives, in the paper's order. `reward` is the score so
    far, `scr` the subtask completion rate.

    `snapshots` are the macro-steps since the boundary before, the last one is this boundary's state [T];
    `frames` are the pictures captured at this boundary (pixels in their own topics); `relations` are found by whoever
    writes the trace (`lingjing.analysis.relations`), the kernel leaves them empty; `digest` chains: SHA-256 over the
    digest before and this record in the form of `lingjing.trace.digest_form`.
    """

    tick: int
    time_s: float
    snapshots: tuple[Snapshot, ...]
    engines: tuple[EngineStatus, ...]
    task_events: tuple[TaskEvent, ...]
    frames: tuple[FrameInfo, ...]
    observations: tuple[ObservationRecord, ...]
    inboxes: tuple[InboxRecord, ...]
    decisions: tuple[DecisionRecord, ...]
    commands: tuple[Command, ...]
    messages: tuple[Envelope, ...]
    receipts: tuple[Receipt, ...]
    events: tuple[AdjudicatedEvent, ...]
    stages: tuple[StageChange, ...]
    relations: tuple[RelationRecord, ...] = ()
    reward: float
    done: bool
    scr: float = 0.0
    digest: str = ""
    wall_s: float = 0.0
    routes: tuple[Route, ...] = ()
    unheard: tuple[tuple[str, str], ...] = ()


class Thought(TraceRecord, frozen=True, kw_only=True):
    """What an agent thought at a boundary, for viewers: the boundary's record holds it too. `tokens` is what it took of
    a model; `replaced` says why nothing was done instead."""

    agent: str
    tick: int
    time_s: float
    text: str
    tokens: int = 0
    replaced: str = ""


class Score(TraceRecord, frozen=True, kw_only=True):
    """How far the episode is at a boundary, for viewers: the boundary's record holds it too. `subtasks` counts the
    stages of all subjects that are done."""

    tick: int
    time_s: float
    score: float
    scr: float
    subtasks: int
    done: bool


class AgentBinding(TraceRecord, frozen=True, kw_only=True):
    """Which policy played which agent; `privileged` marks an oracle."""

    agent: str
    policy: str
    privileged: bool = False
    arguments: dict[str, GivenOption] = {}


Faculty = Literal["perception", "localisation", "waypoint", "routing", "handoff", "execution"]
"""What an agent does well or badly by itself: `lingjing.causal.faculties` says which record each one makes."""


class Substitution(TraceRecord, frozen=True, kw_only=True):
    """One faculty of one agent replaced by the truth at the boundaries from `first` to `last`, or to the end."""

    faculty: Faculty
    agent: str
    first: int
    last: int | None = None

    def covers(self, tick: int) -> bool:
        """Whether it is replaced at this boundary."""
        return self.first <= tick and (self.last is None or tick <= self.last)


class MessageChange(TraceRecord, frozen=True, kw_only=True):
    """What became of a message on its way: it arrived nowhere (`drop`), `ticks` later (`delay`), once more `ticks`
    later (`repeat`), or with the fields of `body` in place of its own (`forge`); with `withhold` it was never sent, so
    that no adjudicator hears it either."""

    message: str
    act: Literal["drop", "delay", "repeat", "forge", "withhold"]
    ticks: int = 0
    body: dict[str, Datum] = {}


class BranchOrigin(TraceRecord, frozen=True, kw_only=True):
    """What a trace is a branch of: another trace's file name and its digest at boundary `at`, up to which both are
    equal; what was changed from there on; and the privileged policy that knew what would have been right."""

    trace: str
    at: int
    digest: str
    substitutions: tuple[Substitution, ...] = ()
    messages: tuple[MessageChange, ...] = ()
    reference: str = ""


FORMAT = "lingjing-trace/2"
"""What `Header.format` is; the first had no seals (ADR 0017)."""

DigestVersion = Literal[1, 2]
"""The versions of the form in which boundaries are hashed (`lingjing.trace.digest_form`)."""

DIGEST_VERSION: Final[DigestVersion] = 2
"""The version of every digest that is computed now, unless a stored one is verified."""


class MovedBody(TraceRecord, frozen=True, kw_only=True):
    """An entity that begins farther from its declared place than it is long.

    `declared` and `placed` are the two places, metres; `moved_m` is their distance: in space if the mission gives an
    elevation, else in plan. `on` is the surface that the scene looked for, "" where the place had to be clear.
    """

    entity: str
    declared: Vector
    placed: Vector
    moved_m: float
    on: str = ""


class Header(TraceRecord, frozen=True, kw_only=True):
    """The first record of a trace: what was played, by whom, on what; `policy_seed` started the policies' streams,
    `evaluators` scored it, told `evaluator_options`; `branch` says what it is a branch of, if it is one.
    `digest_version` is that of the boundaries' digests; a header in a file without it is of version 1. `moved` are the
    entities that the scene put elsewhere than the mission declares (`instance` holds the places played)."""

    format: str = FORMAT
    digest_version: DigestVersion = DIGEST_VERSION
    instance: Instance
    bindings: tuple[AgentBinding, ...]
    fingerprint: dict[str, str]
    city_sha256: str = ""
    attribution: str = ""
    started_wall: str = ""
    policy_seed: int = 0
    evaluators: tuple[str, ...] = ("mission",)
    evaluator_options: dict[str, dict[str, GivenOption]] = {}
    branch: BranchOrigin | None = None
    moved: tuple[MovedBody, ...] = ()


class Outcome(TraceRecord, frozen=True, kw_only=True):
    """The last record: `scr` is the subtask completion rate, `score` the mission's own with weights and penalties;
    `detail` the cause of the ending where the reason leaves one open (which stage, which constraint, which engine),
    `hint` what to do about an abort; `processes` what each process that decided this ran
    (`lingjing.numerics.taken`); `ambient_random` names agents in whose calls a global random generator was used that
    nothing had seeded, so that the digest is another one in each run."""

    success: bool
    reason: Reason
    scr: float
    ticks: int
    digest: str
    frames_digest: str
    detail: str = ""
    hint: str = ""
    wall_s: float = 0.0
    score: float = 0.0
    processes: dict[str, dict[str, str]] = {}
    ambient_random: tuple[str, ...] = ()
