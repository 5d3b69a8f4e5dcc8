"""G: the shared state registry, an immutable value that each boundary replaces.

Holds what adjudication and visibility need of the past. It grows with what happened (reports, pictures, events) and
never with ticks alone; what grows is an
`AppendOnlyMap`, so that a boundary costs what it adds and a fork copies nothing.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping, Sequence

import msgspec
from msgspec import field
from msgspec.structs import replace

from lingjing.kernel.append_only import AppendOnlyMap
from lingjing.kernel.progress import EpisodeProgress
from lingjing.mission.geometry2d import contains
from lingjing.mission.instance import Cell, Datum, Entity, Instance
from lingjing.mission.vocabulary import UNLOCK
from lingjing.trace.records import BodyState, Command, FrameInfo, Receipt, Route, TaskEvent

Binding = tuple[str, ...]


SIGHTINGS = 100
"""So many different reported positions of an entity are remembered: a destination is taken from a recent one."""

DOWNWARD_DEG = 45.0
"""A picture visits a cell only if its axis points at least this far below the horizon."""


class Report(msgspec.Struct, frozen=True):
    """A typed message that rules may range over: one per message id, however many recipients it had."""

    id: str
    kind: str
    sender: str
    tick: int
    body: Mapping[str, Datum]


class Assignment(msgspec.Struct, frozen=True):
    """A destination given to a resource, by an admitted command or an admitted assignment message."""

    resource: str
    east: float
    north: float
    tick: int


class CellVisit(msgspec.Struct, frozen=True):
    """The first photograph taken from above a cell."""

    cell: str
    entity: str
    tick: int


class Registry(msgspec.Struct, frozen=True):
    """The state G at a committed boundary.

    `achieved` maps (rule, binding) to the time it became true; `witnesses` maps (rule, place, the binding without that
    place) to a value that made it true there, which is what `exists` asks for; `sightings` are the latest reported
    positions by matched entity; `claimed` holds (frame, entity) pairs that a report has been matched with; `emitted`
    maps (kind, entities) to the first time an engine said so; `assignments` are the destinations given to a resource
    at the latest boundary where it was given any; `unlocked` the (interaction, entity) pairs the kernel has allowed;
    `routes` the latest route of each entity that one was planned for; `progress` what budgets, inspections, stages and
    constraints keep; `unheard` the pairs of entities that radio does not reach between.
    """

    tick: int = 0
    time_s: float = 0.0
    states: Mapping[str, BodyState] = field(default_factory=dict)
    pending: Mapping[str, Command] = field(default_factory=dict)
    reports: AppendOnlyMap[str, Report] = field(default_factory=AppendOnlyMap)
    frames: AppendOnlyMap[str, FrameInfo] = field(default_factory=AppendOnlyMap)
    frame_states: AppendOnlyMap[str, Mapping[str, BodyState]] = field(default_factory=AppendOnlyMap)
    emitted: Mapping[tuple[str, tuple[str, ...]], float] = field(default_factory=dict)
    assignments: Mapping[str, tuple[Assignment, ...]] = field(default_factory=dict)
    visits: Mapping[str, CellVisit] = field(default_factory=dict)
    achieved: AppendOnlyMap[tuple[str, Binding], float] = field(default_factory=AppendOnlyMap)
    witnesses: AppendOnlyMap[tuple[str, int, Binding], str] = field(default_factory=AppendOnlyMap)
    sightings: Mapping[str, tuple[tuple[float, float], ...]] = field(default_factory=dict)
    claimed: AppendOnlyMap[tuple[str, str], str] = field(default_factory=AppendOnlyMap)
    unlocked: Mapping[tuple[str, str], int] = field(default_factory=dict)
    stages: Mapping[tuple[str, str], int] = field(default_factory=dict)
    routes: Mapping[str, Route] = field(default_factory=dict)
    progress: EpisodeProgress = field(default_factory=EpisodeProgress)
    unheard: tuple[tuple[str, str], ...] = ()

    def with_boundary(
        self,
        tick: int,
        time_s: float,
        states: Iterable[BodyState],
        unheard: tuple[tuple[str, str], ...] = (),
        progress: EpisodeProgress | None = None,
    ) -> Registry:
        """The registry at the next boundary's telemetry; its progress that of before where none is given."""
        return replace(
            self,
            tick=tick,
            time_s=time_s,
            states={state.id: state for state in states},
            unheard=unheard,
            progress=self.progress if progress is None else progress,
        )

    def with_lost_unlocks(self, unlocks: Iterable[Command], missing: Container[str]) -> Registry:
        """Unlocks without an admission receipt count as never sent, so that they are sent again."""
        lost = {unlock_of(command) for command in unlocks if command.id in missing}
        kept = {key: tick for key, tick in self.unlocked.items() if key not in lost}
        return replace(self, unlocked=kept) if lost else self

    def with_events(self, events: Iterable[TaskEvent]) -> Registry:
        """Task events of the boundary added; of equal ones the first counts."""
        fresh: dict[tuple[str, tuple[str, ...]], float] = {}
        for event in events:
            key = (event.kind, event.entities)
            if key not in self.emitted:
                fresh[key] = min(event.time_s, fresh.get(key, event.time_s))
        return replace(self, emitted={**self.emitted, **fresh}) if fresh else self

    def with_routes(self, routes: Iterable[Route]) -> Registry:
        """Routes planned since the boundary before; an entity's latest counts."""
        fresh = {route.entity: route for route in routes}
        return replace(self, routes={**self.routes, **fresh}) if fresh else self

    def with_receipts(self, commands: Iterable[Command], receipts: Sequence[Receipt]) -> Registry:
        """Pending requests opened by `accepted`, closed by `completed` and `rejected`.

        A command whose admission receipt is missing (`timed_out`) never opens one; an earlier pending request of the
        resource stays (Algorithm 2, "retain any previously admitted long-running request").
        """
        if not receipts:
            return self
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

    def with_reports(self, reports: Sequence[Report]) -> Registry:
        """Admitted messages, which rules may range over, whoever else receives them."""
        if not reports:
            return self
        return replace(self, reports=self.reports.extended({report.id: report for report in reports}))

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
                visits.setdefault(cell.name, CellVisit(cell.name, frame.entity, frame.tick))
        return replace(
            self,
            frames=self.frames.extended(new),
            frame_states=self.frame_states.extended(dict.fromkeys(new, self.states)),
            visits=visits,
        )

    def with_assignments(self, assignments: Iterable[Assignment]) -> Registry:
        """Destinations given at this boundary; they replace what their resources were given before."""
        given: dict[str, tuple[Assignment, ...]] = {}
        for item in assignments:
            given[item.resource] = (*given.get(item.resource, ()), item)
        return replace(self, assignments={**self.assignments, **given}) if given else self

    def with_achieved(self, rule: str, bindings: Mapping[Binding, float]) -> Registry:
        """Bindings for which a rule has become true, with the times."""
        if not bindings:
            return self
        holes = {
            (rule, place, (*binding[:place], *binding[place + 1 :])): value
            for binding in bindings
            for place, value in enumerate(binding)
        }
        return replace(
            self,
            achieved=self.achieved.extended({(rule, binding): time_s for binding, time_s in bindings.items()}),
            witnesses=self.witnesses.extended(holes),
        )

    def with_sighting(self, entity: str, place: tuple[float, float]) -> Registry:
        """A matched report said that the entity is at this place (east, north)."""
        known = self.sightings.get(entity, ())
        if place in known:
            return self
        return replace(self, sightings={**self.sightings, entity: (*known, place)[-SIGHTINGS:]})


def unlock_of(command: Command) -> tuple[str, str]:
    """The (interaction, entity) pair of a kernel-origin command."""
    return command.verb.removeprefix(UNLOCK), command.resource


def initial(instance: Instance) -> Registry:
    """The registry before boundary 0: every entity where the instance puts it."""
    return Registry(states={entity.id: declared_state(entity) for entity in instance.entities})


def declared_state(entity: Entity) -> BodyState:
    """The state an entity is declared with, before its engine has spoken."""
    return BodyState(id=entity.id, position=entity.position, heading_deg=entity.heading_deg)


def cells_at(cells: Iterable[Cell], east: float, north: float) -> tuple[Cell, ...]:
    """Every cell whose polygon holds the point; cells overlap, so there may be several."""
    return tuple(cell for cell in cells if contains(cell.polygon, east, north))
