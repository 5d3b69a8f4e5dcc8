"""The repeated target rate (Rep) and the excess target rate: shares of the target events of an episode.

The paper defines it in its table of communication metrics: "Number of repeated target events divided by all valid
target events in the matched episodes. A valid event is an assignment request or target-region entry for a target in
the scenario. It is repeated when the target was already assigned or completed. Continuous presence in one target
region counts as one entry. If no valid target event occurs, Rep is reported as N/A."

The terms of that definition are read from a trace as follows.

- An *executor* is an asset that can serve targets of a group, and a *target region* is the disc around a target in
  which it does. Both follow from the mission: `distance_xy(boat, v) <= 50 m` in a rule makes `boat` an executor of
  every `v`, with a radius of 50 m. An interaction of a target's type (`extinguish { by = road, within = 30 m }`) makes
  every asset of that engine an executor. A place that only hands out goods, such as a depot, is no target.
- An *assignment request* is an assignment message, or a command to an executor from an agent that does not control it.
  Its targets are those that its fields name. If it names none, its target is the nearest one with its position inside
  the target region. A message with a `step` and no name only guides its recipient and requests nothing. The requests of
  one sender for one target at one tick are one event. An executor's consent is a request too.
- A *target-region entry* happens when an executor comes within the radius, as seen at each macro-step, whether it stops
  or drives past. Acting on a target from farther away is an entry too.
- Any event is *repeated* if its target was assigned before by any request, or is completed.
- A target is *completed* by an interaction that leaves no demand, or by the event that the mission's success requires.

By these words the arrival of an assignee is a repetition, so a team without any double work has a Rep of one half. The
*excess target rate* is a second figure, of this project (ADR 0053), that such a team has at zero:

- A *request is in excess* if the target is completed, or is assigned to as many executors as it needs, or is assigned
  to the same one already. A target needs one executor, or as many as its demand has loads. If the sender controls the
  assignee, and another agent assigned it before, the request is the executor's consent and is no event.
- An *entry is in excess* if the target is completed, or is assigned to other executors only.
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
from lingjing.analysis.memo import cache_by_trace
from lingjing.mission.conditions.condition_needs import mentions
from lingjing.mission.conditions.needs import VisitNeed
from lingjing.mission.conditions.outline import Body, of_instance
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
    """An assignment request of `sender` to `assignees` to serve `target`."""

    sender: str
    target: str
    assignees: tuple[str, ...]
    """Entities, or agents that control no entity."""


_Presence = tuple[str, str]
"""A target and an executor that is in its region."""

_EMPTY = frozenset[_Presence]()
"""The presences when no executor is in any region."""


class _Track:
    """The positions of one body at the macro-steps of a boundary."""

    def __init__(self, places: Sequence[Vector]) -> None:
        eastings = [place[0] for place in places]
        self._places, self._west, self._east = places, min(eastings), max(eastings)

    def steps_near(self, other: _Track, radius_m: float) -> Sequence[int]:
        """Return the numbers of the macro-steps at which another body was within the radius."""
        if self._west - other._east > radius_m or other._west - self._east > radius_m:
            return ()  # a cheap exit for most pairs, which are too far apart at all macro-steps
        return [
            step
            for step, (here, there) in enumerate(zip(self._places, other._places, strict=True))
            if abs(here[0] - there[0]) <= radius_m and math.hypot(here[0] - there[0], here[1] - there[1]) <= radius_m
        ]


@dataclass
class _TargetEvents:
    """The target events counted so far."""

    executors_needed: dict[str, int]
    """Number of executors by target. A target that is not listed needs one."""
    assigned: dict[str, dict[str, str]] = field(default_factory=dict)
    """Target → assignee → sender of the assignment."""
    completed: set[str] = field(default_factory=set)
    """Completed targets."""
    inside: AbstractSet[_Presence] = _EMPTY
    """The presences at the last macro-step."""
    stays: set[_Presence] = field(default_factory=set)
    """Presences of executors that acted on a target of a group that they do not serve. They never end, because there is
    no radius that such an executor could leave."""
    requested: set[str] = field(default_factory=set)
    """Targets that any request has assigned."""
    events: int = 0
    repeated: int = 0
    """Number of repeated events, by the definition in the paper."""
    counted: int = 0
    """Events that the excess rate counts."""
    excess: int = 0

    def request(self, request: _Request, controlled: tuple[str, ...]) -> None:
        """Count an assignment request. `controlled` are the entities that its sender controls."""
        self.events += 1
        self.repeated += request.target in self.requested or request.target in self.completed
        self.requested.add(request.target)
        assignees = self.assigned.setdefault(request.target, {})
        own = next((body for body in request.assignees if body in controlled), None)
        if own is not None and assignees.get(own, request.sender) != request.sender:
            assignees[own] = request.sender  # consent: the executor accepts the assignment of another agent
            return
        enough = len(assignees) >= self.executors_needed.get(request.target, 1)
        again = enough or any(body in assignees for body in request.assignees)
        self.counted += 1
        self.excess += again or request.target in self.completed
        if not again:
            assignees.update(dict.fromkeys(request.assignees, request.sender))

    def enter(self, entries: AbstractSet[_Presence]) -> None:
        """Count target-region entries."""
        for target, executor in entries:
            assignees, done = self.assigned.get(target), target in self.completed
            self.events += 1
            self.repeated += done or target in self.requested
            self.counted += 1
            self.excess += done or (bool(assignees) and executor not in (assignees or {}))


def repeated_target_rate(trace: Trace) -> float | None:
    """Return the share of repeated target events, or None if there was none."""
    return ratio(*target_events(trace))


def target_events(trace: Trace) -> tuple[int, int]:
    """Return the number of repeated target events, and of all target events."""
    counted = _target_events(trace)
    return counted.repeated, counted.events


def excess_target_rate(trace: Trace) -> float | None:
    """Return the share of target events in excess, or None if there was none."""
    return ratio(*excess_target_events(trace))


def excess_target_events(trace: Trace) -> tuple[int, int]:
    """Return the number of target events in excess, and of those that this rate counts."""
    counted = _target_events(trace)
    return counted.excess, counted.counted


@cache_by_trace
def _target_events(trace: Trace) -> _TargetEvents:
    instance = trace.header.instance
    assignments = assignments_of(trace)
    controlled = {agent.id: agent.controls for agent in instance.agents}
    kinds = {unlock.interaction for unlock in instance.unlocks}
    counted = _TargetEvents(_executors_needed(instance))
    for record in trace.boundaries:
        for request in _requests(instance, record, assignments):
            counted.request(request, controlled.get(request.sender, ()))
        _count_entries(counted, kinds, record, assignments)
        counted.completed |= completed_at(instance, record)
    return counted


def service_radii(instance: Instance) -> tuple[ServiceRadius, ...]:
    """Return every executor with every group that it serves.

    The radius follows from the distances in rules, or else from the interactions of the targets.
    """
    outline = of_instance(instance)
    radii: dict[tuple[str, str], ServiceRadius] = {}
    for rule in instance.rules:
        domains = {parameter.name: parameter.domain for parameter in rule.parameters}
        for leaf in mentions(rule.condition, outline, domains):
            if isinstance(leaf, VisitNeed) and isinstance(leaf.goal, Body) and leaf.goal.id in domains.values():
                for name in _assets(leaf.movers, instance):
                    served = ServiceRadius(name, leaf.goal.entity.group, leaf.radius_m)
                    radii.setdefault((served.executor, served.group), served)
    for target, task, executor in _possible_services(instance):
        served = ServiceRadius(executor.id, target.group, task.within_m)
        radii.setdefault((served.executor, served.group), served)
    return tuple(radii.values())


def _assets(movers: tuple[Body, ...], instance: Instance) -> Iterator[str]:
    """Yield the assets that bodies denote: an asset itself, or each member of a group."""
    names = {body.id for body in movers}
    for entity in instance.entities:
        if entity.role == "asset" and (entity.id in names or entity.group in names):
            yield entity.id


def _possible_services(instance: Instance) -> Iterator[tuple[Entity, Task, Entity]]:
    """Yield every target with each of its interactions that receives goods or service, and each possible executor."""
    assets = [entity for entity in instance.entities if entity.role == "asset"]
    for target in instance.entities:
        for task in possible(target, instance) if target.role == "target" else ():
            if not task.gives:
                yield from ((target, task, asset) for asset in assets if asset.id in task.actors)


def _group_of_target(instance: Instance) -> dict[str, str]:
    """Return the group of every target. Places that only hand out goods are left out."""
    return {
        entity.id: entity.group
        for entity in instance.entities
        if entity.role == "target" and not ((tasks := possible(entity, instance)) and all(task.gives for task in tasks))
    }


def _executors_needed(instance: Instance) -> dict[str, int]:
    """Return the number of executors of each target with a demand: the demand over the largest load of an executor."""
    counts: dict[str, int] = {}
    for target, task, asset in _possible_services(instance):
        demand = target.properties.get(f"{task.takes}_kg") if task.moves_goods else None
        load = asset.properties.get("payload_kg", asset.properties.get(f"{task.source}_kg"))
        if isinstance(demand, int | float) and isinstance(load, int | float) and load > 0:
            needed = max(1, math.ceil(demand / load))
            counts[target.id] = min(counts.get(target.id, needed), needed)
    return counts


def _requests(instance: Instance, record: BoundaryRecord, assignments: Assignments) -> Iterator[_Request]:
    """Yield the requests of one boundary, one per sender and target."""
    owner = {resource: agent.id for agent in instance.agents for resource in agent.controls}
    controls = {agent.id: agent.controls[0] for agent in instance.agents if agent.controls}
    executors = {served.executor for served in assignments.radii}
    agents = {agent.id for agent in instance.agents}
    orders = [
        (message.sender, str(message.body.get("assignee") or ""), message.body)
        for message in record.messages
        if message.category == "assignment"
    ] + [
        (command.sender, command.resource, command.arguments)
        for command in record.commands
        if command.resource in executors and command.sender in agents and owner.get(command.resource) != command.sender
    ]
    requests: dict[tuple[str, str], dict[str, None]] = {}
    for sender, recipient, body in orders:
        assignee = controls.get(recipient, recipient)
        for target in assignments.targets_of(record, body, assignee):
            requests.setdefault((sender, target), {})[assignee] = None
    for (sender, target), assignees in requests.items():
        yield _Request(sender, target, tuple(assignees))


class Assignments:
    """The interpretation of assignment messages in one instance: their assignees and targets."""

    def __init__(self, instance: Instance) -> None:
        self._controls = {agent.id: agent.controls for agent in instance.agents}
        self.radii = service_radii(instance)
        self.groups = _group_of_target(instance)
        """The group of each target."""
        self.served = tuple(
            (
                tuple(target for target, of in self.groups.items() if of == group),
                tuple(served for served in self.radii if served.group == group),
            )
            for group in dict.fromkeys(served.group for served in self.radii)
        )
        """The targets of each group, and the radii of its executors."""
        self.serving = frozenset((served.executor, served.group) for served in self.radii)
        """Pairs of an executor and a group that it serves."""
        self.bodies = frozenset(self.groups) | {served.executor for served in self.radii}
        """All targets and executors."""
        self._entities = frozenset(entity.id for entity in instance.entities)

    def at(self, record: BoundaryRecord) -> Iterator[tuple[str, tuple[str, ...], str]]:
        """Yield body, targets and message id of each assignment message of one boundary.

        A message without an assignee is for its recipient.
        """
        seen: set[tuple[str, str]] = set()
        for message in record.messages:
            assignee = str(message.body.get("assignee") or message.recipient)
            if message.category == "assignment" and (message.id, assignee) not in seen:
                seen.add((message.id, assignee))
                for body in self._controls.get(assignee, (assignee,)):
                    yield body, self.targets_of(record, message.body, body), message.id

    def targets_of(self, record: BoundaryRecord, fields: Mapping[str, Datum], body: str) -> tuple[str, ...]:
        """Return the targets that the fields of a message or a command denote for a body.

        These are the targets that the fields name. If they name none, it is the nearest target that `body` serves and
        that has the position in its region. If `body` is no entity, the regions of all executors count.
        """
        words = [word for value in fields.values() for word in (value if isinstance(value, tuple) else (value,))]
        targets = tuple(dict.fromkeys(word for word in words if isinstance(word, str) and word in self.groups))
        place = numbers(fields.get("position"), 2) or numbers((fields.get("x"), fields.get("y")), 2)
        if targets or place is None or _STEP in fields:
            return targets
        any_executor = body not in self._entities
        near = [
            (math.dist(place, state.position[:2]), state.id)
            for state in (record.snapshots[-1].states if record.snapshots else ())
            if state.id in self.groups
            for served in self.radii
            if (any_executor or served.executor == body) and self.groups[state.id] == served.group
            if math.dist(place, state.position[:2]) <= served.radius_m
        ]
        return (min(near)[1],) if near else ()


@cache_by_trace
def assignments_of(trace: Trace) -> Assignments:
    """Return the interpretation of assignments for a trace's instance."""
    return Assignments(trace.header.instance)


def _count_entries(
    counted: _TargetEvents, kinds: Container[str], record: BoundaryRecord, assignments: Assignments
) -> None:
    """Count the entries of a boundary, macro-step by macro-step.

    The interactions between them, task events of `kinds`, are taken into account in time order.
    """
    groups = assignments.groups
    inside, performed = _inside(record, assignments), _interactions(kinds, record, groups)
    for step in range(len(record.snapshots)):
        now = inside.get(step, _EMPTY)
        if now == counted.inside and step not in performed:
            continue
        events = performed.get(step, ())
        acting = {(event.entities[0], event.entities[1]) for event in events if len(event.entities) > 1}
        counted.enter((now | acting) - counted.inside - counted.stays)
        counted.inside = now
        counted.stays |= {pair for pair in acting if (pair[1], groups[pair[0]]) not in assignments.serving}
        finished = [event for event in events if not _leaves_demand(event)]
        counted.completed |= {name for event in finished for name in event.entities if name in groups}


def _inside(record: BoundaryRecord, assignments: Assignments) -> Mapping[int, set[_Presence]]:
    """Return the presences at the macro-steps of a boundary, by number. Steps without a presence are left out."""
    tracks = _tracks(record, assignments.bodies)
    presences = defaultdict[int, set[_Presence]](set)
    for targets, executors in assignments.served:
        there = [(target, tracks[target]) for target in targets if target in tracks]
        for served in executors:
            if (own := tracks.get(served.executor)) is None:
                continue
            for target, track in there:
                for step in own.steps_near(track, served.radius_m):
                    presences[step].add((target, served.executor))
    return presences


def _tracks(record: BoundaryRecord, bodies: Container[str]) -> Mapping[str, _Track]:
    """Return the tracks of `bodies` in a boundary. A body that lacks a state at any macro-step is left out."""
    places = defaultdict[str, list[Vector]](list)
    for snapshot in record.snapshots:
        for state in snapshot.states:
            places[state.id].append(state.position)
    steps = len(record.snapshots)
    return {body: _Track(track) for body, track in places.items() if body in bodies and len(track) == steps}


def _interactions(
    kinds: Container[str], record: BoundaryRecord, targets: Container[str]
) -> Mapping[int, Sequence[TaskEvent]]:
    """Return the task events of `kinds` on targets, by the number of the first macro-step that ends after them."""
    times = [snapshot.time_s for snapshot in record.snapshots]
    events = defaultdict[int, list[TaskEvent]](list)
    for event in record.task_events:
        if event.kind in kinds and not event.name and event.entities[:1] and event.entities[0] in targets:
            events[bisect_left(times, event.time_s)].append(event)
    return events


def _leaves_demand(task: TaskEvent) -> bool:
    """Return whether a demand remains after an interaction, such as after a partial delivery."""
    return any(key.partition("_")[0] == LEFT and value > 0 for key, value in task.values.items())
