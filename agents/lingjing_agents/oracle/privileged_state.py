"""The ground truth of a boundary, indexed for the oracle's abilities."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cached_property

from msgspec.structs import replace

from lingjing.plugins.policy import (
    CLEARED,
    DORMANT,
    BodyState,
    Brief,
    Entity,
    Inbox,
    Instance,
    Observation,
    Privileged,
    Route,
    UsageError,
)
from lingjing.plugins.tasks import (
    Alternatives,
    Goal,
    Judged,
    Ordered,
    PerformGoal,
    Task,
    asked,
    field_named,
    goals,
    leaves_of,
    possible,
    reported,
)
from lingjing_agents.ground_plane import GroundPoint

ABSENT = (DORMANT, CLEARED)
"""Status words of entities that are not present."""


class InstanceIndex:
    """The constants of an episode: tasks, report kinds, owners of bodies."""

    def __init__(self, instance: Instance) -> None:
        self.instance = instance
        self.entities = {entity.id: entity for entity in instance.entities}
        self.tasks = tuple(_of_inspected(task, instance) for task in asked(instance))
        self.kinds = reported(instance)
        self.goals = goals(instance)
        self.earlier = {(task.name, task.target): tuple(_earlier(self.goals, task)) for task in self.tasks}
        """The interactions that unlock each task, by its interaction and target."""
        self.supplies = tuple(task for entity in instance.entities for task in possible(entity, instance) if task.gives)
        self.owners = {name: agent for agent in instance.agents for name in agent.controls}
        self.first_seen: dict[str, tuple[GroundPoint, float]] = {}
        """The first known position of each entity with its time in seconds."""

    def bodies(self, engine: str) -> tuple[Entity, ...]:
        """Return the assets of an engine that an agent embodies."""
        entities = self.instance.entities
        owned = (body for body in entities if body.role == "asset" and body.id in self.owners)
        return tuple(body for body in owned if body.engine == engine)

    def able(self, *tasks: Task) -> tuple[Entity, ...]:
        """Return the assets that may do one of these tasks and that an agent embodies."""
        able = {name for task in tasks for name in task.actors if name in self.owners}
        return tuple(entity for entity in self.instance.entities if entity.id in able)


class PrivilegedState:
    """One boundary for one agent's oracle. Raises `UsageError` without a ground truth."""

    def __init__(self, brief: Brief, plan: InstanceIndex, observation: Observation, inbox: Inbox) -> None:
        self.brief, self.plan, self.observation, self.inbox = brief, plan, observation, inbox
        self.known = privileged(observation)
        self.tick, self.time_s = observation.tick, observation.time_s
        self.states = {state.id: state for state in self.known.states}
        self.routes: dict[str, Route] = {route.entity: route for route in self.known.routes}
        for name, state in self.states.items():
            plan.first_seen.setdefault(name, (state.position[:2], self.time_s))

    def place(self, name: str) -> GroundPoint:
        """Return an entity's present east and north in metres."""
        state = self.states.get(name)
        return state.position[:2] if state is not None else self.plan.entities[name].position[:2]

    def state(self, name: str) -> BodyState | None:
        """Return an entity's state, or None."""
        return self.states.get(name)

    def distance(self, first: str, second: str) -> float:
        """Return the planar distance in metres between two entities."""
        return math.dist(self.place(first), self.place(second))

    def drift(self, target: str) -> tuple[float, float]:
        """Return a target's mean velocity so far (east, north; m/s), or the water's current before any motion."""
        if "drift_mps" not in self.plan.entities[target].properties:
            return 0.0, 0.0
        first, since_s = self.plan.first_seen[target]
        if self.time_s - since_s < self.brief.tick_s:
            weather = self.observation.weather
            bearing = math.radians(weather.current_to_deg)
            return weather.current_mps * math.sin(bearing), weather.current_mps * math.cos(bearing)
        here, passed = self.place(target), self.time_s - since_s
        return (here[0] - first[0]) / passed, (here[1] - first[1]) / passed

    def stock(self, name: str, stock: str) -> float:
        """Return the amount of a stock of an entity; stocks are named without their units."""
        state = self.states.get(name)
        resources = state.resources if state is not None else {}
        field = field_named(stock, resources)
        return 0.0 if field is None else resources[field]

    def busy(self, name: str) -> bool:
        """Return whether a resource of this agent has a pending request."""
        view = next((view for view in self.observation.entities if view.id == name), None)
        return view is not None and bool(view.busy)

    def forbidden(self, resource: str, verb: str) -> bool:
        """Return whether the mission does not permit a command yet."""
        return (resource, "") in self.known.forbidden or (resource, verb) in self.known.forbidden

    def present(self, name: str) -> bool:
        """Return whether a target is present."""
        state = self.states.get(name)
        return state is None or state.status not in ABSENT

    @cached_property
    def matched(self) -> frozenset[str]:
        """Targets that a report has been matched with, and placed where a report must also place them."""
        rules = {rule.name for rule in self.plan.instance.rules if rule.matching}
        return frozenset(name for rule, binding in self.known.achieved if rule in rules for name in binding)

    @cached_property
    def left(self) -> tuple[Task, ...]:
        """The open tasks with present targets."""
        return tuple(task for task in self.plan.tasks if self.present(task.target) and not self._done(task))

    def _done(self, task: Task) -> bool:
        if task.moves_goods and task.takes:
            return self.stock(task.target, task.takes) <= 0.0
        return any(kind == task.name and task.target in about for kind, about in self.known.emitted)

    def tasks_of(self, body: str) -> list[Task]:
        """Return the open tasks that a body may do now: not those that other open tasks of it unlock."""
        able = [task for task in self.left if body in task.actors]
        mine = {(task.name, task.target) for task in able}
        ready = [task for task in able if not mine.intersection(self.plan.earlier[task.name, task.target])]
        return ready or able

    @cached_property
    def unreported(self) -> tuple[str, ...]:
        """Present targets that a rule wants reported and that no report has been matched with."""
        return tuple(
            entity.id
            for entity in self.plan.instance.entities
            if entity.group in self.plan.kinds and self.present(entity.id) and entity.id not in self.matched
        )


def _earlier(goal: Goal, task: Task) -> Iterator[tuple[str, str]]:
    """Yield (interaction, target) of each interaction that a task waits for."""
    match goal:
        case Ordered(first=first, then=then):
            leaves = (leaf for leaf in leaves_of(then) if isinstance(leaf, PerformGoal))
            if any((leaf.interaction, leaf.target) == (task.name, task.target) for leaf in leaves):
                yield from ((f.interaction, f.target) for f in leaves_of(first) if isinstance(f, PerformGoal))
            yield from _earlier(first, task)
            yield from _earlier(then, task)
        case Alternatives(parts=parts):
            for part in parts:
                yield from _earlier(part, task)
        case Judged(part=part):
            yield from _earlier(part, task)


def _of_inspected(task: Task, instance: Instance) -> Task:
    """Return the task. If its target is the destination of inspected routes, only their assets may do it."""
    inspected = {spec.asset for spec in instance.inspections if spec.destination == task.target}
    actors = tuple(name for name in task.actors if name in inspected)
    return replace(task, actors=actors) if actors else task


def privileged(observation: Observation) -> Privileged:
    """Return the ground truth of an observation. Raises `UsageError` without one."""
    if observation.privileged is None:
        raise UsageError("policy `oracle` received no privileged observation", hint="declare it as privileged")
    return observation.privileged
