"""What the oracle knows at a boundary: the truth, indexed by what its abilities ask for."""

from __future__ import annotations

import math
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
from lingjing.plugins.tasks import Task, asked, field_named, possible, reported
from lingjing_agents.ground_plane import GroundPoint

ABSENT = (DORMANT, CLEARED)
"""Status words of what is not there."""


class InstanceIndex:
    """What does not change in an episode: tasks, who may be reported how, who embodies what; `first_seen` is where
    everything was at first, and when (s)."""

    def __init__(self, instance: Instance) -> None:
        self.instance = instance
        self.entities = {entity.id: entity for entity in instance.entities}
        self.tasks = tuple(_of_inspected(task, instance) for task in asked(instance))
        self.kinds = reported(instance)
        self.supplies = tuple(task for entity in instance.entities for task in possible(entity, instance) if task.gives)
        self.owners = {name: agent for agent in instance.agents for name in agent.controls}
        self.first_seen: dict[str, tuple[GroundPoint, float]] = {}

    def bodies(self, engine: str) -> tuple[Entity, ...]:
        """The assets of an engine that some agent embodies."""
        entities = self.instance.entities
        return tuple(one for one in entities if one.role == "asset" and one.engine == engine and one.id in self.owners)

    def able(self, *tasks: Task) -> tuple[Entity, ...]:
        """The assets that may do one of these and that some agent embodies."""
        able = {name for task in tasks for name in task.actors if name in self.owners}
        return tuple(one for one in self.instance.entities if one.id in able)


class PrivilegedState:
    """One boundary as one agent's oracle sees it. `UsageError` if the truth was not handed over."""

    def __init__(self, brief: Brief, plan: InstanceIndex, observation: Observation, inbox: Inbox) -> None:
        self.brief, self.plan, self.observation, self.inbox = brief, plan, observation, inbox
        self.known = privileged(observation)
        self.tick, self.time_s = observation.tick, observation.time_s
        self.states = {state.id: state for state in self.known.states}
        self.routes: dict[str, Route] = {route.entity: route for route in self.known.routes}
        for name, state in self.states.items():
            plan.first_seen.setdefault(name, (state.position[:2], self.time_s))

    def place(self, name: str) -> GroundPoint:
        """East and north of an entity now."""
        state = self.states.get(name)
        return state.position[:2] if state is not None else self.plan.entities[name].position[:2]

    def state(self, name: str) -> BodyState | None:
        """An entity's state, if it has one."""
        return self.states.get(name)

    def distance(self, one: str, other: str) -> float:
        """Metres between two entities in the plane."""
        return math.dist(self.place(one), self.place(other))

    def drift(self, target: str) -> tuple[float, float]:
        """Mean velocity (east, north; m/s) of a target so far; the water's current before anything has moved."""
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
        """How much of a stock an entity has; stocks are named without their units."""
        state = self.states.get(name)
        resources = state.resources if state is not None else {}
        field = field_named(stock, resources)
        return 0.0 if field is None else resources[field]

    def busy(self, name: str) -> bool:
        """Whether a resource of this agent is still doing something."""
        view = next((view for view in self.observation.entities if view.id == name), None)
        return view is not None and bool(view.busy)

    def forbidden(self, resource: str, verb: str) -> bool:
        """Whether the mission does not permit a command yet."""
        return (resource, "") in self.known.forbidden or (resource, verb) in self.known.forbidden

    def present(self, name: str) -> bool:
        """Whether a target is there now."""
        state = self.states.get(name)
        return state is None or state.status not in ABSENT

    @cached_property
    def matched(self) -> frozenset[str]:
        """Targets that a report has been matched with, and, of those that a report must also place, been placed."""
        rules = {rule.name for rule in self.plan.instance.rules if rule.matching}
        return frozenset(name for rule, binding in self.known.achieved if rule in rules for name in binding)

    @cached_property
    def left(self) -> tuple[Task, ...]:
        """The tasks that are still to be done and whose targets are there."""
        return tuple(task for task in self.plan.tasks if self.present(task.target) and not self._done(task))

    def _done(self, task: Task) -> bool:
        if task.moves_goods and task.takes:
            return self.stock(task.target, task.takes) <= 0.0
        return any(kind == task.name and task.target in about for kind, about in self.known.emitted)

    @cached_property
    def unreported(self) -> tuple[str, ...]:
        """Targets that are there, that a rule wants reported and that no report has been matched with."""
        return tuple(
            entity.id
            for entity in self.plan.instance.entities
            if entity.group in self.plan.kinds and self.present(entity.id) and entity.id not in self.matched
        )


def _of_inspected(task: Task, instance: Instance) -> Task:
    """The task; where its target is the destination of inspected routes, for those alone whose routes they are."""
    inspected = {one.asset for one in instance.inspections if one.destination == task.target}
    actors = tuple(name for name in task.actors if name in inspected)
    return replace(task, actors=actors) if actors else task


def privileged(observation: Observation) -> Privileged:
    """The truth that an observation carries. `UsageError` if it carries none."""
    if observation.privileged is None:
        raise UsageError("policy `oracle` was given no privileged observation", hint="declare it as privileged")
    return observation.privileged
