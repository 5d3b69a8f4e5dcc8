"""The repeated target rate (Rep): of all target events of an episode, the share that were repeated.

The paper defines it in its table of communication metrics: "Number of repeated target events divided by all valid
target events in the matched episodes. A valid event is an assignment request or target-region entry for a target in
the scenario. It is repeated when the target was already assigned or completed. Continuous presence in one target
region counts as one entry. If no valid target event occurs, Rep is reported as N/A."

The terms of that definition are read from a trace as follows.

- An *executor* is an asset that can serve targets of a group, and a *target region* is the disc around a target in
  which it does. Both are read from the mission: `distance_xy(boat, v) <= 50 m` in a rule makes `boat` an executor of
  every `v`, with a radius of 50 m; an interaction of its type (`extinguish { by = road, within = 30 m }`) makes every
  asset of that engine one. A place that only hands goods out, as a depot, is no target.
- An *assignment request* is an assignment message, or a command to an executor from an agent that does not control it.
  Which targets are meant: those that its fields name; if none, the nearest one in whose region its position lies. A
  message with a `step` and no name guides somebody on its way and requests nothing. The requests of one sender for one
  target at one tick are one event.
- A *target-region entry* happens when an executor comes within the radius, as seen at each macro-step, whether it stops
  or drives past. Acting on a target from farther away is an entry too.
- A *request is repeated* if the target is completed, or is assigned to as many executors as it needs, or is assigned to
  the same one already. A target needs one executor, or as many as its demand has loads. If the sender controls the
  assignee, and somebody else assigned it before, the request is that executor's consent and is no event.
- An *entry is repeated* if the target is completed, or is assigned and not to the executor that enters: the arrival of
  the assignee is what was asked for.
- A target is *completed* by an interaction that leaves nothing to be done, or by what the mission's success asks of it.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from collections import defaultdict
from collections.abc import Container, Iterator, Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass, field

from lingjing.analysis.completion import completed_at
from lingjing.analysis.detection import numbers, ratio
from lingjing.analysis.memo import once_per_trace
from lingjing.mission.feasibility.condition_needs import mentions
from lingjing.mission.feasibility.needs import VisitNeed
from lingjing.mission.feasibility.outline import Body, of_instance
from lingjing.mission.instance import Datum, Entity, Instance, Vector
from lingjing.mission.tasks import Task, possible
from lingjing.mission.vocabulary import LEFT
from lingjing.trace.reader import Trace
from lingjing.trace.records import BoundaryRecord, TaskEvent

_STEP = "step"
"""The field of a message that guides its recipient by one step."""


@dataclass(frozen=True, slots=True)
class ServiceRadius:
    """An executor, a group of targets that it serves, and the radius of their regions in metres."""

    executor: str
    group: str
    radius_m: float


@dataclass(frozen=True, slots=True)
class _Request:
    """An assignment request: `sender` asked `assignees` to serve `target`. An assignee is an entity where the named
    agent controls one."""

    sender: str
    target: str
    assignees: tuple[str, ...]


_Presence = tuple[str, str]
"""A target and an executor that is in its region."""

_NOBODY = frozenset[_Presence]()
"""Who is in which region where nobody is in any."""


class _Track:
    """Where one body was at each macro-step of a boundary."""

    def __init__(self, places: Sequence[Vector]) -> None:
        eastings = [place[0] for place in places]
        self._places, self._west, self._east = places, min(eastings), max(eastings)

    def steps_near(self, other: _Track, radius_m: float) -> Sequence[int]:
        """The numbers of the macro-steps at which another body was within the radius."""
        if self._west - other._east > radius_m or other._west - self._east > radius_m:
            return ()  # so it is with most: too far apart all the time
        return [
            step
            for step, (here, there) in enumerate(zip(self._places, other._places, strict=True))
            if abs(here[0] - there[0]) <= radius_m and math.hypot(here[0] - there[0], here[1] - there[1]) <= radius_m
        ]


@dataclass
class _TargetEvents:
    """The target events counted so far: `events` of which `repeated`.

    `executors_needed` is by target (1 where it is not named); `assigned` maps a target to its assignees, each with the
    sender that assigned it; `completed` are targets; `inside` says who is in which region; `stays` are those of who
    acted on a target of a group that it does not serve: there is no radius that it could leave.
    """

    executors_needed: dict[str, int]
    assigned: dict[str, dict[str, str]] = field(default_factory=dict)
    completed: set[str] = field(default_factory=set)
    inside: AbstractSet[_Presence] = _NOBODY
    stays: set[_Presence] = field(default_factory=set)
    events: int = 0
    repeated: int = 0

    def request(self, asked: _Request, controlled: tuple[str, ...]) -> None:
        """Count an assignment request; `controlled` are the entities that its sender controls."""
        assignees = self.assigned.setdefault(asked.target, {})
        own = next((body for body in asked.assignees if body in controlled), None)
        if own is not None and assignees.get(own, asked.sender) != asked.sender:
            assignees[own] = asked.sender  # consent: the executor takes what another assigned to it
            return
        enough = len(assignees) >= self.executors_needed.get(asked.target, 1)
        again = enough or any(body in assignees for body in asked.assignees)
        self.events += 1
        self.repeated += again or asked.target in self.completed
        if not again:
            assignees.update(dict.fromkeys(asked.assignees, asked.sender))

    def enter(self, entries: AbstractSet[_Presence]) -> None:
        """Count target-region entries."""
        for target, executor in entries:
            self.events += 1
            assignees = self.assigned.get(target)
            self.repeated += target in self.completed or (bool(assignees) and executor not in (assignees or {}))


def repeated_target_rate(trace: Trace) -> float | None:
    """Repeated target events over all target events, None if there was none."""
    return ratio(*target_events(trace))


@once_per_trace
def target_events(trace: Trace) -> tuple[int, int]:
    """Repeated target events, and all target events."""
    instance = trace.header.instance
    assignments = assignments_of(trace)
    controlled = {agent.id: agent.controls for agent in instance.agents}
    kinds = {unlock.interaction for unlock in instance.unlocks}
    counted = _TargetEvents(_executors_needed(instance))
    for record in trace.boundaries:
        for asked in _requests(instance, record, assignments):
            counted.request(asked, controlled.get(asked.sender, ()))
        _count_entries(counted, kinds, record, assignments)
        counted.completed |= completed_at(instance, record)
    return counted.repeated, counted.events


def service_radii(instance: Instance) -> tuple[ServiceRadius, ...]:
    """Every executor with every group that it serves: by the distances that rules ask for, else by the interactions of
    the targets."""
    outline = of_instance(instance)
    found: dict[tuple[str, str], ServiceRadius] = {}
    for rule in instance.rules:
        domains = {parameter.name: parameter.domain for parameter in rule.parameters}
        for leaf in mentions(rule.condition, outline, domains):
            if isinstance(leaf, VisitNeed) and isinstance(leaf.goal, Body) and leaf.goal.id in domains.values():
                for name in _assets(leaf.movers, instance):
                    served = ServiceRadius(name, leaf.goal.entity.group, leaf.radius_m)
                    found.setdefault((served.executor, served.group), served)
    for target, task, executor in _possible_services(instance):
        served = ServiceRadius(executor.id, target.group, task.within_m)
        found.setdefault((served.executor, served.group), served)
    return tuple(found.values())


def _assets(movers: tuple[Body, ...], instance: Instance) -> Iterator[str]:
    """The assets that bodies stand for: themselves, or each member of the group of that name."""
    named = {body.id for body in movers}
    for entity in instance.entities:
        if entity.role == "asset" and (entity.id in named or entity.group in named):
            yield entity.id


def _possible_services(instance: Instance) -> Iterator[tuple[Entity, Task, Entity]]:
    """Every target with every interaction of it that takes something, and every asset that can perform it."""
    assets = [entity for entity in instance.entities if entity.role == "asset"]
    for target in instance.entities:
        for task in possible(target, instance) if target.role == "target" else ():
            if not task.gives:
                yield from ((target, task, asset) for asset in assets if asset.id in task.actors)


def _group_of_target(instance: Instance) -> dict[str, str]:
    """The group of every target; places that only hand something out are left out."""
    return {
        entity.id: entity.group
        for entity in instance.entities
        if entity.role == "target" and not ((tasks := possible(entity, instance)) and all(task.gives for task in tasks))
    }


def _executors_needed(instance: Instance) -> dict[str, int]:
    """The executors that a target needs whose demand is larger than what one of them can bring."""
    found: dict[str, int] = {}
    for target, task, asset in _possible_services(instance):
        demand = target.properties.get(f"{task.takes}_kg") if task.moves_goods else None
        brought = asset.properties.get("payload_kg", asset.properties.get(f"{task.source}_kg"))
        if isinstance(demand, int | float) and isinstance(brought, int | float) and brought > 0:
            needed = max(1, math.ceil(demand / brought))
            found[target.id] = min(found.get(target.id, needed), needed)
    return found


def _requests(instance: Instance, record: BoundaryRecord, assignments: Assignments) -> Iterator[_Request]:
    """The requests of one boundary, one per sender and target."""
    owner = {resource: agent.id for agent in instance.agents for resource in agent.controls}
    controls = {agent.id: agent.controls[0] for agent in instance.agents if agent.controls}
    executors = {served.executor for served in assignments.radii}
    agents = {agent.id for agent in instance.agents}
    said = [
        (message.sender, str(message.body.get("assignee") or ""), message.body)
        for message in record.messages
        if message.category == "assignment"
    ] + [
        (command.sender, command.resource, command.arguments)
        for command in record.commands
        if command.resource in executors and command.sender in agents and owner.get(command.resource) != command.sender
    ]
    found: dict[tuple[str, str], dict[str, None]] = {}
    for sender, named, body in said:
        assignee = controls.get(named, named)
        for target in assignments.meant(record, body, assignee):
            found.setdefault((sender, target), {})[assignee] = None
    for (sender, target), assignees in found.items():
        yield _Request(sender, target, tuple(assignees))


class Assignments:
    """Whom assignment messages are for, and which targets are meant, in one instance.

    `groups` are those of the targets by target; `served` the targets of a group with their executors; `serving` each
    executor with each group that it serves, `bodies` all of whom it matters where they are.
    """

    def __init__(self, instance: Instance) -> None:
        self._controls = {agent.id: agent.controls for agent in instance.agents}
        self.radii = service_radii(instance)
        self.groups = _group_of_target(instance)
        self.served = tuple(
            (
                tuple(target for target, of in self.groups.items() if of == group),
                tuple(served for served in self.radii if served.group == group),
            )
            for group in dict.fromkeys(served.group for served in self.radii)
        )
        self.serving = frozenset((served.executor, served.group) for served in self.radii)
        self.bodies = frozenset(self.groups) | {served.executor for served in self.radii}
        self._entities = frozenset(entity.id for entity in instance.entities)

    def at(self, record: BoundaryRecord) -> Iterator[tuple[str, tuple[str, ...], str]]:
        """The bodies that assignment messages of one boundary are for, each with the targets that are meant and the
        message's id. A message that names no assignee is for its recipient."""
        seen: set[tuple[str, str]] = set()
        for message in record.messages:
            named = str(message.body.get("assignee") or message.recipient)
            if message.category == "assignment" and (message.id, named) not in seen:
                seen.add((message.id, named))
                for body in self._controls.get(named, (named,)):
                    yield body, self.meant(record, message.body, body), message.id

    def meant(self, record: BoundaryRecord, fields: Mapping[str, Datum], body: str) -> tuple[str, ...]:
        """The targets that the fields of a message or a command mean for a body: those that they name, else the nearest
        one in whose region their position lies, in one of the body's regions or, where it is no entity, in anybody's.
        """
        words = [word for value in fields.values() for word in (value if isinstance(value, tuple) else (value,))]
        named = tuple(dict.fromkeys(word for word in words if isinstance(word, str) and word in self.groups))
        place = numbers(fields.get("position"), 2) or numbers((fields.get("x"), fields.get("y")), 2)
        if named or place is None or _STEP in fields:
            return named
        anybody = body not in self._entities
        near = [
            (math.dist(place, state.position[:2]), state.id)
            for state in (record.snapshots[-1].states if record.snapshots else ())
            if state.id in self.groups
            for served in self.radii
            if (anybody or served.executor == body) and self.groups[state.id] == served.group
            if math.dist(place, state.position[:2]) <= served.radius_m
        ]
        return (min(near)[1],) if near else ()


@once_per_trace
def assignments_of(trace: Trace) -> Assignments:
    """The assignments of a trace's instance."""
    return Assignments(trace.header.instance)


def _count_entries(
    counted: _TargetEvents, kinds: Container[str], record: BoundaryRecord, assignments: Assignments
) -> None:
    """Count the entries of a boundary, macro-step by macro-step, in time order with the interactions in between, which
    are task events of some `kinds`."""
    groups = assignments.groups
    inside, performed = _inside(record, assignments), _interactions(kinds, record, groups)
    for step in range(len(record.snapshots)):
        now = inside.get(step, _NOBODY)
        if now == counted.inside and step not in performed:
            continue
        events = performed.get(step, ())
        acting = {(event.entities[0], event.entities[1]) for event in events if len(event.entities) > 1}
        counted.enter((now | acting) - counted.inside - counted.stays)
        counted.inside = now
        counted.stays |= {pair for pair in acting if (pair[1], groups[pair[0]]) not in assignments.serving}
        finished = [event for event in events if not _left(event)]
        counted.completed |= {name for event in finished for name in event.entities if name in groups}


def _inside(record: BoundaryRecord, assignments: Assignments) -> Mapping[int, set[_Presence]]:
    """Who is in which region at the macro-steps of a boundary, by their number; steps with nobody are left out."""
    tracks = _tracks(record, assignments.bodies)
    found = defaultdict[int, set[_Presence]](set)
    for targets, executors in assignments.served:
        there = [(target, tracks[target]) for target in targets if target in tracks]
        for served in executors:
            if (own := tracks.get(served.executor)) is None:
                continue
            for target, track in there:
                for step in own.steps_near(track, served.radius_m):
                    found[step].add((target, served.executor))
    return found


def _tracks(record: BoundaryRecord, bodies: Container[str]) -> Mapping[str, _Track]:
    """The tracks of some bodies in a boundary, but for one that has no state at some macro-step: all of the world have
    one."""
    places = defaultdict[str, list[Vector]](list)
    for snapshot in record.snapshots:
        for state in snapshot.states:
            places[state.id].append(state.position)
    whole = len(record.snapshots)
    return {body: _Track(found) for body, found in places.items() if body in bodies and len(found) == whole}


def _interactions(
    kinds: Container[str], record: BoundaryRecord, targets: Container[str]
) -> Mapping[int, Sequence[TaskEvent]]:
    """The task events of some `kinds` on targets, by the number of the macro-step that they end with."""
    times = [snapshot.time_s for snapshot in record.snapshots]
    found = defaultdict[int, list[TaskEvent]](list)
    for event in record.task_events:
        if event.kind in kinds and not event.name and event.entities[:1] and event.entities[0] in targets:
            found[bisect_left(times, event.time_s)].append(event)
    return found


def _left(task: TaskEvent) -> bool:
    """Whether an interaction left something to be done, as a delivery of a part does."""
    return any(key.partition("_")[0] == LEFT and value > 0 for key, value in task.values.items())
