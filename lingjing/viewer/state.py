"""The state of an episode as a viewer may show it, updated boundary by boundary from the kernel's records."""

from __future__ import annotations

import math
from collections import Counter, deque
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Literal

import msgspec

from lingjing.analysis.completion import completed_at
from lingjing.mission.geometry2d import Vector2
from lingjing.mission.instance import Datum, Entity, Instance
from lingjing.trace.admitted_messages import AdmittedMessage, admitted_at, categories_of
from lingjing.trace.records import REFUSED, Action, BodyState, BoundaryRecord, Receipt, TaskEvent
from lingjing.trace.request_ids import is_request_of

KEPT_LINES = 64
"""Number of the latest messages and events that are kept. Chosen: more than a screen shows."""
STEP_M = 1.0
"""Smallest distance between two points of a trail. Chosen."""

TargetStatus = Literal["known", "found", "completed", "truth"]
"""The status of a visible target: not hidden; hidden but found; completed; hidden, but the truth is shown."""


@dataclass(slots=True)
class AgentStatus:
    """An agent's latest command and its status, in words."""

    agent: str
    command: str = "–"
    status: str = ""
    refused: bool = False
    """True if the command was not carried out."""


@dataclass(frozen=True, slots=True)
class TickerLine:
    """A line of text with its tick."""

    tick: int
    text: str
    good: bool = False
    """True for adjudicated events and completed stages."""


@dataclass(slots=True)
class EpisodeState:
    """The visible state of an episode after the last boundary."""

    instance: Instance
    truth: bool = False
    """True if hidden targets are shown from the start."""
    tick: int = 0
    ticks: int = 0
    """The budget of the mission."""
    time_s: float = 0.0
    wall_s: float = 0.0
    """Wall-clock time since the beginning of the episode."""
    score: float = 0.0
    done: bool = False
    states: dict[str, BodyState] = field(default_factory=dict)
    """The last state of each entity, hidden ones included."""
    trails: dict[str, list[tuple[int, Vector2]]] = field(default_factory=dict)
    """Tick and (east, north) of the points of each entity's trail."""
    routes: dict[str, tuple[Vector2, ...]] = field(default_factory=dict)
    """The last planned route of each entity."""
    agents: dict[str, AgentStatus] = field(default_factory=dict)
    stages: dict[str, set[str]] = field(default_factory=dict)
    """The subjects that completed each stage."""
    found: set[str] = field(default_factory=set)
    """Targets that occur in an adjudicated event or a completed stage."""
    completed: set[str] = field(default_factory=set)
    """Completed targets."""
    messages: deque[TickerLine] = field(default_factory=lambda: deque(maxlen=KEPT_LINES))
    events: deque[TickerLine] = field(default_factory=lambda: deque(maxlen=KEPT_LINES))

    def __post_init__(self) -> None:
        self.agents = {agent.id: AgentStatus(agent.id) for agent in self.instance.agents}
        self.ticks = self.instance.budget.ticks

    @property
    def assets(self) -> tuple[Entity, ...]:
        """The commanded entities in declaration order."""
        return tuple(entity for entity in self.instance.entities if entity.role == "asset")

    def take(self, record: BoundaryRecord, wall_s: float = 0.0) -> None:
        """Update the state with the next boundary, `wall_s` seconds after the beginning of the episode."""
        self.tick, self.time_s, self.wall_s = record.tick, record.time_s, wall_s
        self.score, self.done = record.reward, record.done
        self._move(record)
        self._judge(record)
        self._act(record)
        self.messages.extend(map(_message_line, admitted_at(record, categories_of(self.instance))))
        self.events.extend(self.event_lines(record))

    def visible_targets(self) -> Iterable[tuple[Entity, Vector2, TargetStatus]]:
        """Yield the visible targets with their positions and statuses."""
        for entity in self.instance.entities:
            sight = self.sight(entity)
            if entity.role == "target" and sight is not None:
                state = self.states.get(entity.id)
                place = state.position if state else entity.position
                yield entity, (place[0], place[1]), sight

    def stage_counts(self) -> list[tuple[str, int, int]]:
        """Return for each stage its name, the number of subjects that completed it, and the number of all subjects."""
        members = Counter(entity.group for entity in self.instance.entities)
        return [
            (stage.name, len(self.stages.get(stage.name, ())), members[stage.domain] if stage.domain else 1)
            for stage in self.instance.stages
        ]

    def event_lines(self, record: BoundaryRecord) -> Iterable[TickerLine]:
        """Yield the events of the boundary, which must be the last one passed to `take`."""
        for task in record.task_events:
            yield TickerLine(record.tick, self.visible_event(task).line)
        for event in record.events:
            names = [name for name in event.bindings if name in self.states or name in self.agents]
            yield TickerLine(record.tick, f"{event.kind} {' '.join(names)}".rstrip(), good=True)
        for change in record.stages:
            yield TickerLine(record.tick, f"stage {change.stage} {change.subject}".rstrip() + " done", good=True)

    def sight(self, entity: Entity) -> TargetStatus | None:
        """Return the status of a target, or None if it is hidden and not found."""
        if entity.id in self.completed:
            return "completed"
        if entity.id in self.found:
            return "found"
        if "position" not in entity.hidden:
            return "known"
        return "truth" if self.truth else None

    def visible_event(self, task: TaskEvent) -> TaskEvent:
        """Return the event with `?` for hidden entities that a scheduled event lets appear or vanish."""
        if not task.name or not task.entities:
            return task
        unseen = {entity.id for entity in self.instance.entities if self.sight(entity) is None}
        entities = tuple("?" if name in unseen else name for name in task.entities)
        return msgspec.structs.replace(task, entities=entities)

    # -- parts

    def _move(self, record: BoundaryRecord) -> None:
        for snapshot in record.snapshots:
            for state in snapshot.states:
                self.states[state.id] = state
                trail = self.trails.setdefault(state.id, [])
                here = (state.position[0], state.position[1])
                if not trail or math.dist(trail[-1][1], here) >= STEP_M:
                    trail.append((record.tick, here))
        for route in record.routes:
            self.routes[route.entity] = tuple((point[0], point[1]) for point in route.waypoints)

    def _judge(self, record: BoundaryRecord) -> None:
        targets = {entity.id for entity in self.instance.entities if entity.role == "target"}
        for change in record.stages:
            self.stages.setdefault(change.stage, set()).add(change.subject)
        bindings = {name for event in record.events for name in event.bindings}
        self.found |= targets & (bindings | {change.subject for change in record.stages})
        self.completed |= completed_at(self.instance, record)

    def _act(self, record: BoundaryRecord) -> None:
        for entry in record.decisions:
            agent = self.agents.get(entry.agent)
            if agent is not None and entry.decision.command is not None:
                agent.command, agent.status, agent.refused = command_words(entry.decision.command), "sent", False
        for receipt in record.receipts:
            agent = self.agents.get(receipt.sender)
            if agent is not None and (is_request_of("command", receipt.request) or receipt.status == "substituted"):
                agent.status, agent.refused = status_words(receipt), receipt.status in REFUSED


def command_words(action: Action) -> str:
    """Return a command in words, such as `uav[2].setDestination 120, -40, 60`."""
    verb = f"{action.resource}.{action.verb}" if action.resource else action.verb
    values = ", ".join(_value(value) for value in action.arguments.values() if value is not None)
    return f"{verb} {values}".rstrip()


def _value(value: Datum) -> str:
    if isinstance(value, tuple):
        return f"({', '.join(_value(item) for item in value)})"
    return f"{value:.0f}" if isinstance(value, float) and abs(value) >= 10 else _short(value)


def _short(value: object) -> str:
    return f"{value:.2g}" if isinstance(value, float) else str(value)


def status_words(receipt: Receipt) -> str:
    """Return a receipt in words, such as `running 40%` or `rejected: busy`."""
    progress = f" {receipt.progress:.0%}" if receipt.progress is not None and receipt.status == "running" else ""
    return f"{receipt.status.replace('_', ' ')}{progress}{f': {receipt.reason}' if receipt.reason else ''}"


def _message_line(message: AdmittedMessage) -> TickerLine:
    """Return one line for a message with all its recipients. A message may have none."""
    recipients = message.recipients
    to = recipients[0] if len(recipients) == 1 else f"{len(recipients)} agents"
    edge = f"{message.sender} → {to}" if recipients else message.sender
    return TickerLine(message.tick, f"{edge}: {message.kind} {message_text(message.body)}".rstrip())


def message_text(body: Mapping[str, Datum]) -> str:
    """Return the values of a message as text, without frame ids and boxes."""
    words = (value for name, value in body.items() if name not in ("frame", "box") and value not in (None, "", ()))
    return " ".join(_value(value) for value in words)
