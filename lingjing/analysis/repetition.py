"""Rep: the share of target events that were unnecessary (the paper's repeated target rate).

The paper (its table of communication metrics): "Number of repeated target events divided by all valid target events in
the matched episodes. A valid event is an assignment request or target-region entry for a target in the scenario. It is
repeated when the target was already assigned or completed. Continuous presence in one target region counts as one
entry. If no valid target event occurs, Rep is reported as N/A."

A target event is an assignment request that means a target of the scenario, or an executor's entry into a target's
region. Executors and regions are read from the mission: `distance_xy(boat, v) <= 50 m` in a rule makes `boat` an
executor of `v` within 50 m, and so does an interaction of the target's type (`extinguish { by = road, within = 30 m }`)
every asset of that engine. A place that only hands something out (a depot) is visited again and again and is no target
in this sense. A request means targets by their names, one or a tour of them, or by a position inside the region in
which its assignee serves; a `step` without a name guides somebody on its way and assigns nothing. Requests are
assignment messages and commands to an executor from agents that do not embody it; one sender's requests for one
target at one tick are one event.

A request is repeated when its target is already assigned or completed; an entry is repeated when the target is
completed or assigned to somebody else, since the assignee's own arrival is what was asked for. So is the assignee's
first answer that it takes what another gave it. A demand larger than one executor's load may be assigned to as many as
it takes. To enter is to come within the radius, as seen at every macro-step, whether to stop there or to drive past; to
act on the target from farther away is an entry too. Staying inside is one entry.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field

from lingjing.analysis.completion import completed_at
from lingjing.analysis.detection import numbers, ratio
from lingjing.mission.feasibility.needs import VisitNeed, mentions
from lingjing.mission.feasibility.outline import Body, of_instance
from lingjing.mission.instance import Datum, Entity, Instance
from lingjing.mission.tasks import Task, possible
from lingjing.trace.reader import Trace
from lingjing.trace.records import BodyState, BoundaryRecord, TaskEvent

_STEP = "step"
"""The field of a message that guides somebody by one step."""
_LEFT = "left_"
"""What the values of an interaction begin with that say how much of it is still to be done."""


@dataclass(frozen=True, slots=True)
class Reach:
    """An executor entity, the target group it serves and the radius (m) in which it does."""

    executor: str
    group: str
    radius_m: float


@dataclass(frozen=True, slots=True)
class _Request:
    """Who asked for which target of whom; `assignees` are bodies where the named agents have any."""

    sender: str
    target: str
    assignees: tuple[str, ...]


@dataclass
class _Count:
    room: dict[str, int] = field(default_factory=dict)
    assigned: dict[str, dict[str, str]] = field(default_factory=dict)
    completed: set[str] = field(default_factory=set)
    inside: set[tuple[str, str]] = field(default_factory=set)
    events: int = 0
    repeated: int = 0

    def request(self, asked: _Request, embodied: tuple[str, ...]) -> None:
        """`embodied` is what the sender controls."""
        holders = self.assigned.setdefault(asked.target, {})
        own = next((body for body in asked.assignees if body in embodied), None)
        if own is not None and holders.get(own, asked.sender) != asked.sender:
            holders[own] = asked.sender  # the assignee takes what another gave it
            return
        full = len(holders) >= self.room.get(asked.target, 1) or any(body in holders for body in asked.assignees)
        self.events += 1
        self.repeated += full or asked.target in self.completed
        if not full:
            holders.update(dict.fromkeys(asked.assignees, asked.sender))

    def entry(self, target: str, executor: str) -> None:
        self.events += 1
        holders = self.assigned.get(target)
        self.repeated += target in self.completed or (bool(holders) and executor not in (holders or {}))


def repeated_target_rate(trace: Trace) -> float | None:
    """Repeated target events over all target events, None if there was none."""
    instance = trace.header.instance
    reaches = reaches_of(instance)
    embodied = {agent.id: agent.controls for agent in instance.agents}
    count = _Count(room=_room(instance))
    for record in trace.boundaries:
        for asked in _requests(instance, record, reaches):
            count.request(asked, embodied.get(asked.sender, ()))
        _entries(count, instance, record, reaches)
    return ratio(count.repeated, count.events)


def reaches_of(instance: Instance) -> tuple[Reach, ...]:
    """Who executes what within which radius: the distances that the instance's rules ask for, else the interactions of
    its targets."""
    outline = of_instance(instance)
    found: dict[tuple[str, str], Reach] = {}
    for rule in instance.rules:
        domains = {parameter.name: parameter.domain for parameter in rule.parameters}
        for leaf in mentions(rule.condition, outline, domains):
            if isinstance(leaf, VisitNeed) and isinstance(leaf.goal, Body) and leaf.goal.id in domains.values():
                for name in _assets(leaf.movers, instance):
                    reach = Reach(name, leaf.goal.entity.group, leaf.radius_m)
                    found.setdefault((reach.executor, reach.group), reach)
    for target, task, executor in _services(instance):
        reach = Reach(executor.id, target.group, task.within_m)
        found.setdefault((reach.executor, reach.group), reach)
    return tuple(found.values())


def _assets(movers: tuple[Body, ...], instance: Instance) -> Iterator[str]:
    """The assets that bodies stand for: themselves, or each member of the group of that name."""
    named = {body.id for body in movers}
    for entity in instance.entities:
        if entity.role == "asset" and (entity.id in named or entity.group in named):
            yield entity.id


def _services(instance: Instance) -> Iterator[tuple[Entity, Task, Entity]]:
    """Target, interaction and asset that can do it, without places that only hand something out."""
    assets = [entity for entity in instance.entities if entity.role == "asset"]
    for target in instance.entities:
        for task in possible(target, instance) if target.role == "target" else ():
            if not task.gives:
                yield from ((target, task, asset) for asset in assets if asset.id in task.actors)


def _targets(instance: Instance) -> dict[str, str]:
    """Group by target, without places that only hand something out."""
    return {
        entity.id: entity.group
        for entity in instance.entities
        if entity.role == "target" and not ((tasks := possible(entity, instance)) and all(task.gives for task in tasks))
    }


def _room(instance: Instance) -> dict[str, int]:
    """How many executors a target takes whose demand is larger than what one of them can bring."""
    found: dict[str, int] = {}
    for target, task, asset in _services(instance):
        demand = target.properties.get(f"{task.takes}_kg") if task.moves_goods else None
        brought = asset.properties.get("payload_kg", asset.properties.get(f"{task.source}_kg"))
        if isinstance(demand, int | float) and isinstance(brought, int | float) and brought > 0:
            needed = max(1, math.ceil(demand / brought))
            found[target.id] = min(found.get(target.id, needed), needed)
    return found


def _requests(instance: Instance, record: BoundaryRecord, reaches: tuple[Reach, ...]) -> Iterator[_Request]:
    """The requests of one boundary, one per sender and target."""
    owner = {resource: agent.id for agent in instance.agents for resource in agent.controls}
    controls = {agent.id: agent.controls[0] for agent in instance.agents if agent.controls}
    executors = {reach.executor for reach in reaches}
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
        for target in _targets_of(instance, record, body, assignee, reaches):
            found.setdefault((sender, target), {})[assignee] = None
    for (sender, target), assignees in found.items():
        yield _Request(sender, target, tuple(assignees))


def assignments_at(instance: Instance, record: BoundaryRecord) -> Iterator[tuple[str, tuple[str, ...]]]:
    """The bodies that assignment messages of one boundary are for, each with the targets that are meant. A message
    that names no assignee is for its recipient."""
    controls = {agent.id: agent.controls for agent in instance.agents}
    reaches = reaches_of(instance)
    seen: set[tuple[str, str]] = set()
    for message in record.messages:
        named = str(message.body.get("assignee") or message.recipient)
        if message.category == "assignment" and (message.id, named) not in seen:
            seen.add((message.id, named))
            for body in controls.get(named, (named,)):
                yield body, _targets_of(instance, record, message.body, body, reaches)


def _targets_of(
    instance: Instance, record: BoundaryRecord, body: dict[str, Datum], assignee: str, reaches: tuple[Reach, ...]
) -> tuple[str, ...]:
    return _meant(instance, record, body, [one for one in reaches if _serves(one, assignee, instance)])


def _serves(reach: Reach, assignee: str, instance: Instance) -> bool:
    """Whether a request to `assignee` may mean a place in this reach; one to nobody known may mean any."""
    return reach.executor == assignee or assignee not in {entity.id for entity in instance.entities}


def _meant(instance: Instance, record: BoundaryRecord, body: dict[str, Datum], reaches: list[Reach]) -> tuple[str, ...]:
    """The targets that a request names, else the nearest one in whose region its position lies."""
    targets = _targets(instance)
    words = [word for value in body.values() for word in (value if isinstance(value, tuple) else (value,))]
    named = tuple(dict.fromkeys(word for word in words if isinstance(word, str) and word in targets))
    place = numbers(body.get("position"), 2) or numbers((body.get("x"), body.get("y")), 2)
    if named or place is None or _STEP in body:
        return named
    near = [
        (math.dist(place, state.position[:2]), state.id)
        for state in _states(record)
        for reach in reaches
        if targets.get(state.id) == reach.group and math.dist(place, state.position[:2]) <= reach.radius_m
    ]
    return (min(near)[1],) if near else ()


def _entries(count: _Count, instance: Instance, record: BoundaryRecord, reaches: tuple[Reach, ...]) -> None:
    """Entries at every macro-step, in time order with the interactions that the engines performed in between. A
    target is completed by an unlocked interaction or by what the mission's success asks of it."""
    groups = _targets(instance)
    kinds = {unlock.interaction for unlock in instance.unlocks}
    acts = [
        task
        for task in record.task_events
        if task.kind in kinds and not task.name and task.entities[:1] and task.entities[0] in groups
    ]
    for snapshot in record.snapshots:
        states = {state.id: state for state in snapshot.states}
        past = [task for task in acts if task.time_s <= snapshot.time_s]
        acts = [task for task in acts if task.time_s > snapshot.time_s]
        for target, executor in ((task.entities[0], task.entities[1]) for task in past if len(task.entities) > 1):
            if (executor, target) not in count.inside:
                count.inside.add((executor, target))
                count.entry(target, executor)
        for reach in reaches:
            for target, group in groups.items():
                if group == reach.group and target in states and reach.executor in states:
                    _presence(count, states[reach.executor], states[target], reach.radius_m)
        count.completed |= {name for task in past if not _left(task) for name in task.entities if name in groups}
    count.completed |= completed_at(instance, record)


def _presence(count: _Count, body: BodyState, target: BodyState, radius_m: float) -> None:
    pair = (body.id, target.id)
    if math.dist(body.position[:2], target.position[:2]) > radius_m:
        count.inside.discard(pair)
    elif pair not in count.inside:
        count.inside.add(pair)
        count.entry(target.id, body.id)


def _left(task: TaskEvent) -> bool:
    """Whether an interaction left something to be done, as a delivery of a part does."""
    return any(key.startswith(_LEFT) and value > 0 for key, value in task.values.items())


def _states(record: BoundaryRecord) -> tuple[BodyState, ...]:
    return record.snapshots[-1].states if record.snapshots else ()
