"""Vehicles and vessels: each goes near the targets that it can serve, in the order of the shortest tour.

A body without open tasks goes to where the others are.
"""

from __future__ import annotations

import math

from lingjing.plugins.policy import Action, Brief, Datum, Outgoing, Resource
from lingjing.plugins.tasks import Task
from lingjing_agents.capability import route_to, speed, straight_to
from lingjing_agents.ground_plane import GroundPoint
from lingjing_agents.oracle.ability import Ability
from lingjing_agents.oracle.composing import MessageComposer
from lingjing_agents.oracle.detours import next_place
from lingjing_agents.oracle.privileged_state import InstanceIndex, PrivilegedState
from lingjing_agents.oracle.routes import RouteWatch
from lingjing_agents.paths.visiting_order import shares, shortest

SHORT = 0.6
"""The share of an interaction's distance at which a vessel stops. Chosen."""

NEAR_M = 8.0
"""Tolerance in metres around a vessel's stopping distance. Chosen."""
_RING_M = 14.0
"""Radius in metres of the places around a target that are tried after failed approaches. Chosen."""


def mover(resource: Resource) -> str:
    """Return the verb that moves a resource to a point in the plane; "" if it has none."""
    return straight_to(resource, "x", "y") or route_to(resource)


class _TargetApproach:
    """The next destination of a body."""

    def __init__(self, resource: Resource, plan: InstanceIndex) -> None:
        self.resource, self.verb, self._plan = resource, mover(resource), plan
        self._straight = bool(straight_to(resource, "x", "y"))
        self._sent: dict[str, int] = {}
        self._watch = RouteWatch(resource.id)

    def next(self, truth: PrivilegedState) -> tuple[Task, Action | None] | None:
        """Return the next task with the command towards it, or None without a task. The command is None to wait or on
        arrival.
        """
        tour = self.tour(truth) or self._meeting(truth)
        if not tour:
            return None
        task = tour[0]
        return task, self._to(truth, task, tour[1].target if len(tour) > 1 else "")

    def tour(self, truth: PrivilegedState) -> list[Task]:
        """Return the body's open tasks in the order of its tour."""
        tasks = {task.target: task for task in truth.tasks_of(self.resource.id) if not task.moves_goods}
        if not tasks:
            return []
        places = {name: truth.place(name) for name in tasks}
        bodies = {body.id: truth.place(body.id) for body in self._plan.able(*tasks.values())}
        start = bodies.get(self.resource.id, truth.place(self.resource.id))
        order = shortest(start, places)
        mine = order if len(bodies) < 2 else shares(bodies, order, places).get(self.resource.id, [])
        return [tasks[name] for name in mine]

    def _meeting(self, truth: PrivilegedState) -> list[Task]:
        """Return the nearest task that others do or have done: a mission may require all bodies at one place."""
        able = [task for task in self._plan.tasks if self.resource.id in task.actors and not task.moves_goods]
        there = [task for task in able if truth.present(task.target)]
        return sorted(there, key=lambda task: (truth.distance(self.resource.id, task.target), task.target))[:1]

    def _to(self, truth: PrivilegedState, task: Task, onward: str) -> Action | None:
        here, there = truth.place(self.resource.id), truth.place(task.target)
        stop_m = SHORT * task.within_m if self._straight else 0.0
        reach_m = stop_m + NEAR_M if self._straight else task.within_m - 1.0
        waits = self._watch.is_to_wait(truth)
        if math.dist(here, there) <= reach_m or waits or truth.forbidden(self.resource.id, self.verb):
            return None
        if self._straight:
            east, north = truth.drift(task.target)
            lead_s = max(0.0, math.dist(here, there) - stop_m) / speed(self.resource)
            there = there[0] + lead_s * east, there[1] + lead_s * north
            goal = _rim(here, there, truth.place(onward) if onward else here, stop_m)
        else:
            goal = next_place(truth, self.resource.id, there)
            if goal == there:
                goal = self._around(task.target, there)
        arguments: dict[str, Datum] = {"x": goal[0], "y": goal[1]}
        return Action(verb=self.verb, arguments=arguments, resource=self.resource.id)

    def _around(self, target: str, there: GroundPoint) -> GroundPoint:
        """Return the target's place, or places around it after two approaches that did not arrive."""
        tries = self._sent.get(target, 0)
        self._sent[target] = tries + 1
        if tries < 2:
            return there
        angle = math.radians(60.0 * tries)
        return there[0] + _RING_M * math.sin(angle), there[1] + _RING_M * math.cos(angle)


class _DriverAbility(Ability):
    """Commands an embodied vehicle or vessel."""

    def __init__(self, course: _TargetApproach, composer: MessageComposer) -> None:
        self._course, self._composer = course, composer

    def say(self, truth: PrivilegedState) -> list[Outgoing]:
        """Return a status message whenever the task changes."""
        task = next(iter(self._course.tour(truth)), None)
        return self._composer.progress(self._course.resource.id, task, {})

    def act(self, truth: PrivilegedState) -> Action | None:
        """Return the command to the next target."""
        if truth.busy(self._course.resource.id):
            return None
        following = self._course.next(truth)
        self.aim = following[0].target if following is not None else ""
        return following[1] if following is not None else None


class _ClaimAbility(Ability):
    """Commands a body of another agent, if this agent may command it and has no task of its own.

    The command is the one that the body's driver would send. Of several commands to the body at one boundary the
    kernel admits the first and rejects the others as conflicts.
    """

    def __init__(self, course: _TargetApproach) -> None:
        self._course = course
        self._claimed: set[str] = set()

    def act(self, truth: PrivilegedState) -> Action | None:
        """Return a command once for each target, and only if the body is idle."""
        if truth.busy(self._course.resource.id):
            return None
        following = self._course.next(truth)
        if following is None or following[1] is None or following[0].target in self._claimed:
            return None
        self.aim = following[0].target
        self._claimed.add(self.aim)
        return following[1]


def vehicle_abilities(brief: Brief, plan: InstanceIndex, composer: MessageComposer) -> list[Ability]:
    """Return the abilities for bodies that move in the plane and serve targets other than by moving goods."""
    abilities: list[Ability] = []
    for resource in brief.resources:
        if not mover(resource):
            continue
        course = _TargetApproach(resource, plan)
        abilities.append(_DriverAbility(course, composer) if resource.embodied else _ClaimAbility(course))
    return abilities


def _rim(here: GroundPoint, there: GroundPoint, onward: GroundPoint, radius_m: float) -> GroundPoint:
    """Return the point within `radius_m` of `there` that makes the way from `here` to `onward` shortest."""
    angles = [math.tau * step / 24 for step in range(24)]
    options = [(there[0] + radius_m * math.cos(a), there[1] + radius_m * math.sin(a)) for a in angles]
    return min(options, key=lambda point: math.dist(here, point) + math.dist(point, onward))
