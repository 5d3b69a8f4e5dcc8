"""What a watcher knows of an episode so far, gathered boundary by boundary from the kernel's records."""

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
from lingjing.trace.admitted import AdmittedMessage, admitted_at, categories_of
from lingjing.trace.records import REFUSED, Action, BodyState, BoundaryRecord, Receipt, TaskEvent
from lingjing.trace.request_ids import is_request_of

KEPT_LINES = 64
STEP_M = 1.0
"""A trail is not grown by steps shorter than this."""

TargetStatus = Literal["known", "found", "completed", "truth"]


@dataclass(slots=True)
class AgentStatus:
    """An agent's latest command in words and what has become of it."""

    agent: str
    command: str = "–"
    status: str = ""
    refused: bool = False


@dataclass(frozen=True, slots=True)
class TickerLine:
    """A line of a ticker; `good` events are those that the mission is about."""

    tick: int
    text: str
    good: bool = False


@dataclass(slots=True)
class Watched:
    """The episode as it stands. `truth` shows hidden targets from the start."""

    instance: Instance
    truth: bool = False
    tick: int = 0
    ticks: int = 0
    time_s: float = 0.0
    wall_s: float = 0.0
    score: float = 0.0
    done: bool = False
    states: dict[str, BodyState] = field(default_factory=dict)
    trails: dict[str, list[tuple[int, Vector2]]] = field(default_factory=dict)
    routes: dict[str, tuple[Vector2, ...]] = field(default_factory=dict)
    agents: dict[str, AgentStatus] = field(default_factory=dict)
    stages: dict[str, set[str]] = field(default_factory=dict)
    found: set[str] = field(default_factory=set)
    completed: set[str] = field(default_factory=set)
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
        """One more boundary, `wall_s` after the episode began."""
        self.tick, self.time_s, self.wall_s = record.tick, record.time_s, wall_s
        self.score, self.done = record.reward, record.done
        self._move(record)
        self._judge(record)
        self._act(record)
        self.messages.extend(map(message_line, admitted_at(record, categories_of(self.instance))))
        self.events.extend(self.happened(record))

    def seen_targets(self) -> Iterable[tuple[Entity, Vector2, TargetStatus]]:
        """The targets that a watcher may see, where they are, and as what."""
        for entity in self.instance.entities:
            sight = self.sight(entity)
            if entity.role == "target" and sight is not None:
                state = self.states.get(entity.id)
                place = state.position if state else entity.position
                yield entity, (place[0], place[1]), sight

    def stage_counts(self) -> list[tuple[str, int, int]]:
        """(stage, subjects done, subjects there are)."""
        members = Counter(entity.group for entity in self.instance.entities)
        return [
            (stage.name, len(self.stages.get(stage.name, ())), members[stage.domain] if stage.domain else 1)
            for stage in self.instance.stages
        ]

    def happened(self, record: BoundaryRecord) -> Iterable[TickerLine]:
        """What engines and the kernel say happened at the boundary that was taken last."""
        for task in record.task_events:
            yield TickerLine(record.tick, self.told(task).line)
        for event in record.events:
            shown = [name for name in event.bindings if name in self.states or name in self.agents]
            yield TickerLine(record.tick, f"{event.kind} {' '.join(shown)}".rstrip(), good=True)
        for change in record.stages:
            yield TickerLine(record.tick, f"stage {change.stage} {change.subject}".rstrip() + " done", good=True)

    def sight(self, entity: Entity) -> TargetStatus | None:
        """What a watcher may know a target as; None for one that is hidden and not found."""
        if entity.id in self.completed:
            return "completed"
        if entity.id in self.found:
            return "found"
        if "position" not in entity.hidden:
            return "known"
        return "truth" if self.truth else None

    def told(self, task: TaskEvent) -> TaskEvent:
        """The event, `?` for those who come or go by themselves, hidden and not found."""
        if not task.name or not task.entities:
            return task
        seen = {entity.id for entity in self.instance.entities if self.sight(entity) is not None}
        return msgspec.structs.replace(task, entities=tuple(one if one in seen else "?" for one in task.entities))

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
        told = {name for event in record.events for name in event.bindings}
        self.found |= targets & (told | {change.subject for change in record.stages})
        self.completed |= completed_at(self.instance, record)

    def _act(self, record: BoundaryRecord) -> None:
        for made in record.decisions:
            agent = self.agents.get(made.agent)
            if agent is not None and made.decision.command is not None:
                agent.command, agent.status, agent.refused = command_words(made.decision.command), "asked", False
        for receipt in record.receipts:
            agent = self.agents.get(receipt.sender)
            if agent is not None and (is_request_of("command", receipt.request) or receipt.status == "substituted"):
                agent.status, agent.refused = status_words(receipt), receipt.status in REFUSED


def command_words(action: Action) -> str:
    """A command in words: `uav[2].setDestination 120, -40, 60`."""
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
    """A receipt in words: `running 40%`, `rejected: busy`."""
    progress = f" {receipt.progress:.0%}" if receipt.progress is not None and receipt.status == "running" else ""
    return f"{receipt.status.replace('_', ' ')}{progress}{f': {receipt.reason}' if receipt.reason else ''}"


def message_line(said: AdmittedMessage) -> TickerLine:
    """One line a message, its recipients together; a report for nobody is adjudicated all the same."""
    to = said.recipients[0] if len(said.recipients) == 1 else f"{len(said.recipients)} agents"
    who = f"{said.sender} → {to}" if said.recipients else said.sender
    return TickerLine(said.tick, f"{who}: {said.kind} {spoken(said.body)}".rstrip())


def spoken(body: Mapping[str, Datum]) -> str:
    """What a message says, without the frames and boxes that only machines read."""
    words = (value for name, value in body.items() if name not in ("frame", "box") and value not in (None, "", ()))
    return " ".join(_value(value) for value in words)
