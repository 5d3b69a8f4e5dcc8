"""G: the shared state registry, an immutable value that each boundary replaces.

Holds what adjudication and visibility need of the past. Growth is linear in what happened (reports, frames, events),
never in ticks. Copying it is free, which is what a fork of the kernel costs.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

from lingjing.mission.geometry2d import contains
from lingjing.mission.instance import Cell, Datum, Entity, Instance
from lingjing.trace.records import BodyState, Command, Envelope, FrameInfo, Receipt, TaskEvent

Binding = tuple[str, ...]

DOWNWARD_DEG = 45.0
"""A picture visits a cell only if its axis points at least this far below the horizon."""


@dataclass(frozen=True, slots=True)
class Report:
    """A typed message that rules may range over: one per message id, however many recipients it had."""

    id: str
    kind: str
    sender: str
    tick: int
    body: Mapping[str, Datum]


@dataclass(frozen=True, slots=True)
class Assignment:
    """A destination given to a resource, by an admitted command or an admitted assignment message."""

    resource: str
    east: float
    north: float
    tick: int


@dataclass(frozen=True, slots=True)
class Visit:
    """The first photograph taken from above a cell."""

    cell: str
    entity: str
    tick: int


@dataclass(frozen=True, slots=True)
class Registry:
    """The state G at a committed boundary.

    `achieved` maps (rule, binding) to the time it became true; `claimed` holds (frame, entity) pairs that a report
    has been matched with; `unlocked` the (interaction, entity) pairs the kernel has allowed.
    """

    tick: int = 0
    time_s: float = 0.0
    states: Mapping[str, BodyState] = field(default_factory=dict)
    pending: Mapping[str, Command] = field(default_factory=dict)
    reports: Mapping[str, Report] = field(default_factory=dict)
    frames: Mapping[str, FrameInfo] = field(default_factory=dict)
    frame_states: Mapping[str, Mapping[str, BodyState]] = field(default_factory=dict)
    emitted: tuple[TaskEvent, ...] = ()
    assignments: tuple[Assignment, ...] = ()
    visits: Mapping[str, Visit] = field(default_factory=dict)
    achieved: Mapping[tuple[str, Binding], float] = field(default_factory=dict)
    claimed: frozenset[tuple[str, str]] = frozenset()
    unlocked: Mapping[tuple[str, str], int] = field(default_factory=dict)
    stages: Mapping[tuple[str, str], int] = field(default_factory=dict)

    def with_boundary(self, tick: int, time_s: float, states: Iterable[BodyState]) -> Registry:
        """The registry at the next boundary's telemetry."""
        return replace(self, tick=tick, time_s=time_s, states={state.id: state for state in states})

    def with_events(self, events: tuple[TaskEvent, ...]) -> Registry:
        """Task events of the boundary appended."""
        return replace(self, emitted=self.emitted + events) if events else self

    def with_receipts(self, commands: Iterable[Command], receipts: Iterable[Receipt]) -> Registry:
        """Pending requests opened by `accepted`, closed by `completed` and `rejected`.

        A command whose admission receipt is missing (`timed_out`) never opens one; an earlier pending request of the
        resource stays (Algorithm 2, "retain any previously admitted long-running request").
        """
        pending = dict(self.pending)
        sent = {command.id: command for command in commands}
        for receipt in receipts:
            command = sent.get(receipt.request)
            if receipt.status == "accepted" and command is not None and command.origin == "agent":
                pending[command.resource] = command
            elif receipt.status in ("completed", "rejected", "timed_out"):
                held = pending.get(receipt.resource)
                if held is not None and held.id == receipt.request:
                    del pending[receipt.resource]
        return replace(self, pending=pending)

    def with_messages(self, envelopes: Iterable[Envelope], kinds: frozenset[str]) -> Registry:
        """Messages of the kinds that rules range over become reports, once per message id."""
        fresh = {
            envelope.id: Report(envelope.id, envelope.kind, envelope.sender, envelope.tick, envelope.body)
            for envelope in envelopes
            if envelope.kind in kinds and envelope.id not in self.reports
        }
        return replace(self, reports={**self.reports, **fresh}) if fresh else self

    def with_frames(self, frames: Iterable[FrameInfo], instance: Instance) -> Registry:
        """Captured frames, the states they were captured at, and the cells they visit."""
        new = {frame.id: frame for frame in frames}
        if not new:
            return self
        visits = dict(self.visits)
        for frame in new.values():
            if frame.pose.tilt_deg < DOWNWARD_DEG:
                continue
            for cell in cells_at(instance.cells, frame.pose.position[0], frame.pose.position[1]):
                visits.setdefault(cell.name, Visit(cell.name, frame.entity, frame.tick))
        return replace(
            self,
            frames={**self.frames, **new},
            frame_states={**self.frame_states, **dict.fromkeys(new, self.states)},
            visits=visits,
        )

    def with_assignments(self, assignments: tuple[Assignment, ...]) -> Registry:
        """Destinations given at this boundary appended."""
        return replace(self, assignments=self.assignments + assignments) if assignments else self


def initial(instance: Instance) -> Registry:
    """The registry before boundary 0: every entity where the instance puts it."""
    return Registry(states={entity.id: declared_state(entity) for entity in instance.entities})


def declared_state(entity: Entity) -> BodyState:
    """The state an entity is declared with, before its engine has spoken."""
    return BodyState(id=entity.id, position=entity.position, heading_deg=entity.heading_deg)


def cells_at(cells: Iterable[Cell], east: float, north: float) -> tuple[Cell, ...]:
    """Every cell whose polygon holds the point; cells overlap, so there may be several."""
    return tuple(cell for cell in cells if contains(cell.polygon, east, north))
