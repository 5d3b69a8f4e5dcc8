"""G: the shared state registry, an immutable value that each boundary replaces.

It holds the past that adjudication and visibility need. It grows with reports, pictures and events, never with ticks
alone. The growing parts are `AppendOnlyMap`s, so a boundary costs only its additions and a fork copies nothing.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping, Sequence

import msgspec
from msgspec import field
from msgspec.structs import replace

from lingjing.kernel.append_only import AppendOnlyMap
from lingjing.kernel.memory import ConditionPast
from lingjing.kernel.progress import EpisodeProgress
from lingjing.mission.geometry2d import contains
from lingjing.mission.instance import Cell, Datum, Entity, Instance
from lingjing.mission.schedule import Occurrence
from lingjing.mission.vocabulary import UNLOCK
from lingjing.trace.records import BodyState, Command, FrameInfo, Receipt, Route, TaskEvent

Binding = tuple[str, ...]
"""The ids of a rule's bound values, in the order of its parameters."""


SIGHTINGS = 100
"""Number of different reported positions that are kept for an entity. Chosen: a destination derives from a recent
one.
"""

DOWNWARD_DEG = 45.0
"""Smallest angle of a camera's axis below the horizon at which a picture counts as a visit of a cell. Chosen."""


class Report(msgspec.Struct, frozen=True):
    """A typed message over which rules may range: one per message id, however many recipients it had."""

    id: str
    """The request id of the message."""
    kind: str
    """The message kind."""
    sender: str
    """The id of the sending agent."""
    tick: int
    """The boundary at which it was admitted."""
    body: Mapping[str, Datum]
    """The fields of the message."""


class Assignment(msgspec.Struct, frozen=True):
    """A destination of a resource, from an admitted command or an admitted assignment message."""

    resource: str
    """The id of the resource."""
    east: float
    """Metres east of the city's origin."""
    north: float
    """Metres north of the city's origin."""
    tick: int
    """The boundary at which it was admitted."""


class _CellVisit(msgspec.Struct, frozen=True):
    """The first photograph taken from above a cell."""

    cell: str
    """The name of the cell."""
    entity: str
    """The id of the entity that carried the camera."""
    tick: int
    """The boundary of the picture."""


class Registry(msgspec.Struct, frozen=True):
    """The state G at a committed boundary."""

    tick: int = 0
    """The boundary's number."""
    time_s: float = 0.0
    """Simulated time in seconds."""
    states: Mapping[str, BodyState] = field(default_factory=dict)
    """The state of every entity."""
    pending: Mapping[str, Command] = field(default_factory=dict)
    """The long-running request of each busy resource."""
    reports: AppendOnlyMap[str, Report] = field(default_factory=AppendOnlyMap)
    """Admitted messages by id."""
    frames: AppendOnlyMap[str, FrameInfo] = field(default_factory=AppendOnlyMap)
    """Pictures by id."""
    frame_states: AppendOnlyMap[str, Mapping[str, BodyState]] = field(default_factory=AppendOnlyMap)
    """The states of all entities at the time of each picture, by picture id."""
    emitted: Mapping[tuple[str, tuple[str, ...]], float] = field(default_factory=dict)
    """(kind, entities) of each task event with its first time in seconds."""
    assignments: Mapping[str, tuple[Assignment, ...]] = field(default_factory=dict)
    """The destinations of a resource at the latest boundary that assigned any."""
    destinations: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    """Destination (east, north) in metres of the latest accepted command of each resource that names one."""
    visits: Mapping[str, _CellVisit] = field(default_factory=dict)
    """The first visit of each cell."""
    ground: Mapping[str, bytes] = field(default_factory=dict)
    """The ground that pictures have shown of the cells with `Cell.seen`, as well-known binary."""
    seen: Mapping[str, float] = field(default_factory=dict)
    """The share of these cells that `ground` covers."""
    achieved: AppendOnlyMap[tuple[str, Binding], float] = field(default_factory=AppendOnlyMap)
    """The time in seconds at which a (rule, binding) became true."""
    witnesses: AppendOnlyMap[tuple[str, int, Binding], str] = field(default_factory=AppendOnlyMap)
    """(rule, index, binding without that index) with a value that made the rule true there; `exists` looks these up."""
    sightings: Mapping[str, tuple[tuple[float, float], ...]] = field(default_factory=dict)
    """The latest reported positions (east, north) of each matched entity."""
    claimed: AppendOnlyMap[tuple[str, str], str] = field(default_factory=AppendOnlyMap)
    """The report that was matched with each (frame, entity) pair."""
    unlocked: Mapping[tuple[str, str], int] = field(default_factory=dict)
    """The (interaction, entity) pairs that the kernel has allowed, with the tick."""
    stages: Mapping[tuple[str, str], int] = field(default_factory=dict)
    """The tick at which a (stage, subject) was completed."""
    routes: Mapping[str, Route] = field(default_factory=dict)
    """The latest route of each entity."""
    progress: EpisodeProgress = field(default_factory=EpisodeProgress)
    """The state of budgets, inspections, stages and constraints."""
    unreachable_links: tuple[tuple[str, str], ...] = ()
    """Pairs of entities that radio does not connect."""
    occurrences: tuple[Occurrence, ...] = ()
    """Every time at which an event of the mission occurred, in order."""
    memory: Mapping[tuple[str, Binding], ConditionPast] = field(default_factory=dict)
    """The past of each function over time, by its text and the ids of its free names (`lingjing.kernel.temporal`)."""
    counts: Mapping[tuple[str, tuple[str, ...]], int] = field(default_factory=dict)
    """The number of task events of each (kind, entities) before this boundary."""
    recent: tuple[tuple[str, tuple[str, ...], float], ...] = ()
    """(kind, entities, time in seconds) of each task event of this boundary."""

    def with_boundary(
        self,
        tick: int,
        time_s: float,
        states: Iterable[BodyState],
        unreachable_links: tuple[tuple[str, str], ...] = (),
        progress: EpisodeProgress | None = None,
    ) -> Registry:
        """Return the registry with the telemetry of the next boundary. Without `progress` the present one is kept."""
        return replace(
            self,
            tick=tick,
            time_s=time_s,
            states={state.id: state for state in states},
            unreachable_links=unreachable_links,
            progress=self.progress if progress is None else progress,
        )

    def with_lost_unlocks(self, unlocks: Iterable[Command], missing: Container[str]) -> Registry:
        """Return the registry without unlocks that lack an admission receipt, so that they are sent again."""
        lost = {_unlock_of(command) for command in unlocks if command.id in missing}
        kept = {key: tick for key, tick in self.unlocked.items() if key not in lost}
        return replace(self, unlocked=kept) if lost else self

    def with_events(self, events: Iterable[TaskEvent]) -> Registry:
        """Return the registry with the boundary's task events. Of equal events the first counts."""
        fresh: dict[tuple[str, tuple[str, ...]], float] = {}
        events = tuple(events)
        for event in events:
            key = (event.kind, event.entities)
            if key not in self.emitted:
                fresh[key] = min(event.time_s, fresh.get(key, event.time_s))
        if not (self.recent or events):
            return self
        counts = dict(self.counts)
        for kind, about, _ in self.recent:
            counts[kind, about] = counts.get((kind, about), 0) + 1
        recent = tuple((event.kind, event.entities, event.time_s) for event in events)
        return replace(self, emitted={**self.emitted, **fresh}, counts=counts, recent=recent)

    def with_routes(self, routes: Iterable[Route]) -> Registry:
        """Return the registry with newly planned routes; the latest of an entity counts."""
        fresh = {route.entity: route for route in routes}
        return replace(self, routes={**self.routes, **fresh}) if fresh else self

    def with_receipts(self, commands: Iterable[Command], receipts: Sequence[Receipt]) -> Registry:
        """Return the registry with pending requests: opened by `accepted`, closed by `completed`, `rejected` or
        `timed_out`.

        A command without an admission receipt (`timed_out`) opens no request; an earlier pending request of the
        resource stays (Algorithm 2: "retain any previously admitted long-running request").
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
        """Return the registry with admitted messages, over which rules may range."""
        if not reports:
            return self
        return replace(self, reports=self.reports.extended({report.id: report for report in reports}))

    def with_frames(self, frames: Iterable[FrameInfo], instance: Instance) -> Registry:
        """Return the registry with captured frames, the states at their capture, and the cells that they visit."""
        new = {frame.id: frame for frame in frames}
        if not new:
            return self
        visits = dict(self.visits)
        for frame in new.values():
            if frame.pose.tilt_deg < DOWNWARD_DEG:
                continue
            for cell in cells_at(instance.cells, frame.pose.position[0], frame.pose.position[1]):
                visits.setdefault(cell.name, _CellVisit(cell.name, frame.entity, frame.tick))
        ground, seen = _with_ground(self, new.values(), instance)
        return replace(
            self,
            frames=self.frames.extended(new),
            frame_states=self.frame_states.extended(dict.fromkeys(new, self.states)),
            visits=visits,
            ground=ground,
            seen=seen,
        )

    def with_assignments(self, assignments: Iterable[Assignment]) -> Registry:
        """Return the registry with the destinations of this boundary; they replace earlier ones of the same
        resources.
        """
        by_resource: dict[str, tuple[Assignment, ...]] = {}
        for item in assignments:
            by_resource[item.resource] = (*by_resource.get(item.resource, ()), item)
        return replace(self, assignments={**self.assignments, **by_resource}) if by_resource else self

    def with_destinations(self, commanded: Iterable[Assignment]) -> Registry:
        """Return the registry with the destinations of the commands that engines accepted at this boundary."""
        latest = {item.resource: (item.east, item.north) for item in commanded}
        return replace(self, destinations={**self.destinations, **latest}) if latest else self

    def with_achieved(self, rule: str, bindings: Mapping[Binding, float]) -> Registry:
        """Return the registry with bindings for which a rule has become true, with their times."""
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
        """Return the registry with a reported position (east, north) of an entity."""
        known = self.sightings.get(entity, ())
        if place in known:
            return self
        return replace(self, sightings={**self.sightings, entity: (*known, place)[-SIGHTINGS:]})


def _unlock_of(command: Command) -> tuple[str, str]:
    """Return the (interaction, entity) pair of an unlock command of the kernel."""
    return command.verb.removeprefix(UNLOCK), command.resource


def initial(instance: Instance) -> Registry:
    """Return the registry before boundary 0, with every entity where the instance places it."""
    return Registry(states={entity.id: _declared_state(entity) for entity in instance.entities})


def _declared_state(entity: Entity) -> BodyState:
    """Return the state with which an entity is declared, before its engine has reported any."""
    return BodyState(id=entity.id, position=entity.position, heading_deg=entity.heading_deg)


def _with_ground(
    registry: Registry, frames: Iterable[FrameInfo], instance: Instance
) -> tuple[Mapping[str, bytes], Mapping[str, float]]:
    """Return the ground that was seen of the cells with `Cell.seen`, and the shares."""
    cells = {cell.name: cell.polygon for cell in instance.cells if cell.seen}
    if not cells:
        return registry.ground, registry.seen
    from lingjing.scene.ground_coverage import add_ground  # loads shapely, which most missions need not wait for

    return add_ground(cells, registry.ground, [frame.pose for frame in frames], instance.scene.datum_m)


def cells_at(cells: Iterable[Cell], east: float, north: float) -> tuple[Cell, ...]:
    """Return every cell with a polygon that contains the point. Cells may overlap."""
    return tuple(cell for cell in cells if contains(cell.polygon, east, north))
