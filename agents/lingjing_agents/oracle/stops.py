"""Stops: where a body must be for a goal, directly or to take on or deliver what the goal is about."""

from __future__ import annotations

import math
from dataclasses import dataclass

from lingjing.plugins.tasks import (
    AssignGoal,
    LeafGoal,
    LevelGoal,
    PerformGoal,
    ReachGoal,
    StatusGoal,
    Task,
    field_named,
    possible,
)
from lingjing_agents.ground_plane import GroundPoint
from lingjing_agents.oracle.goal_state import MEANT_M, GoalState
from lingjing_agents.oracle.privileged_state import InstanceIndex, PrivilegedState

_DUST = 1e-6
"""Amounts below this count as zero. Chosen."""


@dataclass(frozen=True, slots=True)
class Stop:
    """A place at which a body works towards a goal."""

    goal: LeafGoal
    """The goal."""
    place: GroundPoint
    """The place, metres."""
    within_m: float
    """Largest distance from the place, metres; 0 for a place inside a region."""
    task: Task | None = None
    """The interaction to be done there; None to be there."""

    @property
    def target(self) -> str:
        """The id of the entity at the place; "" without one."""
        if self.task is not None:
            return self.task.target
        match self.goal:
            case ReachGoal(entity=name) | AssignGoal(target=name):
                return name
        return ""

    @property
    def name(self) -> str:
        """Its name in thoughts."""
        east, north = self.place
        action = f"{self.task.name} " if self.task is not None else ""
        return f"{action}{self.target or f'({east:.0f} m, {north:.0f} m)'}"


class StopPlanner:
    """Finds the stops of bodies. An exchange needs goods on board, or room for them: then another stop comes first."""

    def __init__(self, plan: InstanceIndex, goals: GoalState) -> None:
        self._plan, self._goals = plan, goals
        self._tasks = {
            (task.target, task.name): task
            for entity in plan.instance.entities
            for task in possible(entity, plan.instance)
        }

    def stop(self, truth: PrivilegedState, body: str, leaf: LeafGoal) -> Stop | None:
        """Return the next stop of a body for a goal, or None if the body cannot work towards it now."""
        match leaf:
            case PerformGoal():
                return self._nearest(truth, body, [(leaf.target, leaf.interaction)], leaf)
            case LevelGoal(ways=ways) | StatusGoal(ways=ways):
                return self._nearest(truth, body, [(way.target, way.interaction) for way in ways], leaf)
            case ReachGoal(movers=movers) if body in movers:
                place = self._goals.place(leaf)
                return None if place is None else Stop(leaf, place, leaf.radius_m)
            case AssignGoal(asset=asset, target=target) if body == asset:
                return Stop(leaf, truth.place(target), MEANT_M)
        return None

    def _nearest(self, truth: PrivilegedState, body: str, ways: list[tuple[str, str]], leaf: LeafGoal) -> Stop | None:
        """Return the nearest stop for one of several interactions."""
        own = isinstance(leaf, LevelGoal) and body in leaf.entities
        stops = [
            stop
            for way in ways
            if (task := self._tasks[way]).target and body in task.actors and truth.present(task.target)
            and (not self._of_assets(leaf) or own)
            and (stop := self._for(truth, body, task, leaf)) is not None
        ]  # fmt: skip
        return min(stops, key=lambda stop: (math.dist(truth.place(body), stop.place), stop.target), default=None)

    def _of_assets(self, leaf: LeafGoal) -> bool:
        """Return whether a goal is about amounts on board of assets, which these assets alone can change."""
        entities = leaf.entities if isinstance(leaf, LevelGoal) else ()
        return any(self._plan.entities[name].role == "asset" for name in entities)

    def _for(self, truth: PrivilegedState, body: str, task: Task, leaf: LeafGoal) -> Stop | None:
        """Return the stop for an interaction, or one that makes it possible."""
        if not task.moves_goods:
            return self._at(truth, task, leaf)
        if task.own and truth.stock(task.target, task.own) <= _DUST:
            return None
        if task.gives:
            return self._at(truth, task, leaf) if self.room(truth, body, task) > _DUST else self._emptied(
                truth, body, task.carried, leaf
            )  # fmt: skip
        if truth.stock(body, task.carried) > _DUST:
            return self._at(truth, task, leaf)
        return self._filled(truth, body, task.carried, leaf)

    def room(self, truth: PrivilegedState, body: str, task: Task) -> float:
        """Return how much more a body can take on."""
        field = field_named(task.up_to, self._plan.entities[body].properties) if task.up_to else None
        limit = self._plan.entities[body].number_or(field, 0.0) if field is not None else math.inf
        return limit - truth.stock(body, task.carried)

    def _emptied(self, truth: PrivilegedState, body: str, carried: str, leaf: LeafGoal) -> Stop | None:
        drops = [task for task in self._tasks.values() if task.takes and task.source == carried]
        return self._first(truth, body, drops, leaf)

    def _filled(self, truth: PrivilegedState, body: str, carried: str, leaf: LeafGoal) -> Stop | None:
        supplies = [task for task in self._tasks.values() if task.gives == carried]
        return self._first(truth, body, [t for t in supplies if self.room(truth, body, t) > _DUST], leaf)

    def _first(self, truth: PrivilegedState, body: str, tasks: list[Task], leaf: LeafGoal) -> Stop | None:
        able = [
            self._at(truth, task, leaf)
            for task in tasks
            if body in task.actors and truth.present(task.target)
            and (not task.own or truth.stock(task.target, task.own) > _DUST)
        ]  # fmt: skip
        return min(able, key=lambda stop: (math.dist(truth.place(body), stop.place), stop.target), default=None)

    def _at(self, truth: PrivilegedState, task: Task, leaf: LeafGoal) -> Stop:
        return Stop(leaf, truth.place(task.target), task.within_m, task)
