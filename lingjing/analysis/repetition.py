"""Rep: the share of target events that were unnecessary (the paper's repeated target rate).

A target event is an assignment request that means a target of the scenario, or an executor's entry into a target's
region. Executors and regions are read from the mission's own rules: `distance_xy(boat, v) <= 50 m` makes `boat` an
executor of `v` within 50 m. A request means a target by its name, or by a position inside its region. Requests are
assignment messages and commands to an executor from agents that do not embody it; one sender's requests for one
target at one tick are one event.

A request is repeated when its target is already assigned or completed; an entry is repeated when the target is
completed or assigned to somebody else, since the assignee's own arrival is what was asked for. Staying inside is one
entry.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field

from lingjing.analysis.completion import completed_at, nodes
from lingjing.analysis.detection import numbers, ratio
from lingjing.mission.expression import Attr, Binary, Call, Expr, Index, Node, Number, Ref
from lingjing.mission.instance import Datum, Instance
from lingjing.trace.reader import Trace
from lingjing.trace.records import BodyState, BoundaryRecord


@dataclass(frozen=True, slots=True)
class Reach:
    """An executor entity, the target group it serves and the radius (m) in which it does."""

    executor: str
    group: str
    radius_m: float


@dataclass
class _Count:
    assigned: dict[str, str] = field(default_factory=dict)
    completed: set[str] = field(default_factory=set)
    inside: set[tuple[str, str]] = field(default_factory=set)
    events: int = 0
    repeated: int = 0

    def request(self, target: str, assignee: str) -> None:
        self.events += 1
        self.repeated += target in self.assigned or target in self.completed
        self.assigned.setdefault(target, assignee)

    def entry(self, target: str, executor: str) -> None:
        self.events += 1
        self.repeated += target in self.completed or self.assigned.get(target, executor) != executor


def repeated_target_rate(trace: Trace) -> float | None:
    """Repeated target events over all target events, None if there was none."""
    instance = trace.header.instance
    reaches = reaches_of(instance)
    count = _Count()
    for record in trace.boundaries:
        for target, assignee in _requests(instance, record, reaches):
            count.request(target, assignee)
        _entries(count, instance, record, reaches)
    return ratio(count.repeated, count.events)


def reaches_of(instance: Instance) -> tuple[Reach, ...]:
    """Who executes what within which radius, from `distance_xy(a, b) <= r` in the instance's rules."""
    found = []
    for rule in instance.rules:
        domains = {parameter.name: parameter.domain for parameter in rule.parameters}
        for node in nodes(rule.condition):
            reach = _reach(node, domains, instance)
            found += [reach] if reach is not None and reach not in found else []
    return tuple(found)


def _reach(node: Node, domains: dict[str, str], instance: Instance) -> Reach | None:
    if not (isinstance(node, Binary) and node.operator == "<=" and isinstance(node.right, Number)):
        return None
    call = node.left
    if not (isinstance(call, Call) and call.function == "distance_xy" and len(call.arguments) == 2):
        return None
    names = [_name(argument) for argument in call.arguments]
    assets = {entity.id for entity in instance.entities if entity.role == "asset"}
    executor = next((name for name in names if name in assets), None)
    group = next((domains[name] for name in names if name in domains), None)
    return Reach(executor, group, node.right.value) if executor is not None and group is not None else None


def _name(argument: Expr) -> str:
    if isinstance(argument, Attr):
        return _name(argument.base)
    if isinstance(argument, Index) and isinstance(argument.index, Number):
        return f"{_name(argument.base)}[{round(argument.index.value)}]"
    return argument.name if isinstance(argument, Ref) else ""


def _requests(instance: Instance, record: BoundaryRecord, reaches: tuple[Reach, ...]) -> Iterator[tuple[str, str]]:
    """(target, assignee) of this boundary's requests, one per sender and target."""
    seen: set[tuple[str, str]] = set()
    owner = {resource: agent.id for agent in instance.agents for resource in agent.controls}
    executors = {reach.executor for reach in reaches}
    said = [
        (message.sender, str(message.body.get("assignee") or ""), message.body)
        for message in record.messages
        if message.category == "assignment"
    ] + [
        (command.sender, command.resource, command.arguments)
        for command in record.commands
        if command.resource in executors and owner.get(command.resource) != command.sender
    ]
    controls = {agent.id: agent.controls[0] for agent in instance.agents if agent.controls}
    for sender, assignee, body in said:
        target = _meant(instance, record, body, reaches)
        if target is not None and (sender, target) not in seen:
            seen.add((sender, target))
            yield target, controls.get(assignee, assignee)


def _meant(
    instance: Instance, record: BoundaryRecord, body: dict[str, Datum], reaches: tuple[Reach, ...]
) -> str | None:
    targets = {entity.id: entity.group for entity in instance.entities if entity.role == "target"}
    named = next((value for value in body.values() if isinstance(value, str) and value in targets), None)
    place = numbers(body.get("position"), 2) or numbers((body.get("x"), body.get("y")), 2)
    if named is not None or place is None:
        return named
    near = [
        (math.dist(place, state.position[:2]), state.id)
        for state in _states(record)
        for reach in reaches
        if targets.get(state.id) == reach.group and math.dist(place, state.position[:2]) <= reach.radius_m
    ]
    return min(near)[1] if near else None


def _entries(count: _Count, instance: Instance, record: BoundaryRecord, reaches: tuple[Reach, ...]) -> None:
    """Entries at every macro-step, in time order with the interactions that the engines performed in between. A
    target is completed by an unlocked interaction or by what the mission's success asks of it."""
    groups = {entity.id: entity.group for entity in instance.entities if entity.role == "target"}
    kinds = {unlock.interaction for unlock in instance.unlocks}
    done = [(task.time_s, name) for task in record.task_events if task.kind in kinds for name in task.entities]
    for snapshot in record.snapshots:
        places = {state.id: state.position[:2] for state in snapshot.states}
        for reach in reaches:
            for target, group in groups.items():
                if group != reach.group or target not in places or reach.executor not in places:
                    continue
                pair = (reach.executor, target)
                if math.dist(places[reach.executor], places[target]) > reach.radius_m:
                    count.inside.discard(pair)
                elif pair not in count.inside:
                    count.inside.add(pair)
                    count.entry(target, reach.executor)
        count.completed |= {name for time_s, name in done if time_s <= snapshot.time_s and name in groups}
    count.completed |= completed_at(instance, record)


def _states(record: BoundaryRecord) -> tuple[BodyState, ...]:
    return record.snapshots[-1].states if record.snapshots else ()
