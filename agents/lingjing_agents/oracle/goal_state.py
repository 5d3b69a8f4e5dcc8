"""`GoalState`: the goals of an episode that are still to be worked towards, and those that the oracle has no way to."""

from __future__ import annotations

import math
from functools import cached_property

import msgspec

from lingjing.plugins.tasks import (
    Alternatives,
    AssignGoal,
    Goal,
    InspectGoal,
    Judged,
    LeafGoal,
    LevelGoal,
    OpenGoal,
    Ordered,
    PerformGoal,
    PictureGoal,
    ReachGoal,
    ReportGoal,
    StatusGoal,
    leaves_of,
)
from lingjing_agents.ground_plane import GroundPoint, inside
from lingjing_agents.oracle.privileged_state import InstanceIndex, PrivilegedState

_NO_BODY = "no agent commands a body that can do it"
_SPEED_MPS = 3.0
"""The speed of bodies that declare none, metres per second. Chosen."""
MEANT_M = 50.0
"""Distance in metres from a target within which a destination counts as an assignment to it."""


class GoalState:
    """The goals of one episode. `look` reads a boundary; all other methods answer for the latest one."""

    def __init__(self, plan: InstanceIndex) -> None:
        self._plan = plan
        self._unlocked: set[int] = set()
        self._truth: PrivilegedState

    def look(self, truth: PrivilegedState) -> None:
        """Read a boundary."""
        self._truth = truth

    @cached_property
    def _requests(self) -> frozenset[str]:
        """The kinds of messages that request another route, which inspectors send at an obstacle on the route."""
        return frozenset(spec.replan for spec in self._plan.instance.inspections if spec.replan)

    @cached_property
    def moved(self) -> frozenset[str]:
        """The ids of the bodies that some agent commands."""
        return frozenset(name for agent in self._plan.instance.agents for name in agent.commands)

    @cached_property
    def _lasting(self) -> frozenset[str]:
        """The rules with `held(…)`: a body stays where their conditions are true, until their events come."""
        return frozenset(rule.name for rule in self._plan.instance.rules if _calls(rule.condition, "held"))

    def wanted(self) -> tuple[LeafGoal, ...]:
        """The unmet leaves to work towards now: of alternatives the ones with a way, the nearest first."""
        return tuple(dict.fromkeys(self._wanted(self._plan.goals)))

    def spare(self) -> tuple[LeafGoal, ...]:
        """The unmet leaves of all alternatives that `wanted` leaves out, for bodies without other work."""
        wanted = self.wanted()
        return tuple(
            leaf
            for leaf in dict.fromkeys(self._unmet(self._plan.goals))
            if leaf not in wanted and not self.obstacle(leaf)
        )

    def obstacle(self, leaf: LeafGoal) -> str:
        """Return the reason for which the oracle cannot work towards a leaf; "" if it can."""
        match leaf:
            case OpenGoal(reason=reason):
                return reason
            case ReportGoal(matching=False, kind=kind) if kind not in self._requests:
                return "the oracle sends reports that a rule matches with pictures, and no others"
            case LevelGoal() | StatusGoal() if not leaf.ways:
                return "no interaction changes it that way"
        return "" if self._bodies(leaf) else _NO_BODY

    def met(self, goal: Goal) -> bool:
        """Return whether a goal is met now."""
        match goal:
            case Alternatives(least=least, parts=parts):
                return sum(map(self.met, parts)) >= least
            case Judged(rule=rule, entities=ids, part=part):
                achieved = any(name == rule and set(ids) <= set(about) for name, about in self._truth.known.achieved)
                return achieved or (self.met(part) and rule not in self._lasting)
            case Ordered(then=then):
                return self.met(then)
        return self._leaf_met(goal)

    def place(self, leaf: LeafGoal) -> GroundPoint | None:
        """Return the place of a leaf in metres; None without one."""
        match leaf:
            case PerformGoal(target=name) | ReachGoal(entity=name) | AssignGoal(target=name) if name:
                return self._truth.place(name)
            case StatusGoal(entity=name) | ReportGoal(about=name) if name:
                return self._truth.place(name)
            case LevelGoal(entities=(name, *_)):
                return self._truth.place(name)
            case ReachGoal(point=point) if point is not None:
                return point
            case ReachGoal(region=outline) if outline:
                return middle(outline)
        return None

    def _unmet(self, goal: Goal) -> list[LeafGoal]:
        if self.met(goal):
            return []
        match goal:
            case Alternatives(parts=parts):
                return [leaf for part in parts for leaf in self._unmet(part)]
            case Ordered(first=first, then=then):
                return self._unmet(then if id(goal) in self._unlocked else first)
            case Judged(part=part):
                return self._unmet(part)
        return [goal]

    def _wanted(self, goal: Goal) -> list[LeafGoal]:
        if self.met(goal):
            return []
        match goal:
            case Alternatives(least=least, parts=parts):
                unmet = [part for part in parts if not self.met(part)]
                lacking = least - (len(parts) - len(unmet))
                chosen = unmet if lacking >= len(unmet) else sorted(unmet, key=self._cost)[:lacking]
                return [leaf for part in chosen for leaf in self._wanted(part)]
            case Ordered(first=first, then=then):
                if self.met(first):
                    self._unlocked.add(id(goal))
                return self._wanted(then if id(goal) in self._unlocked else first)
            case Judged(part=part):
                return self._wanted(part) or [leaf for leaf in leaves_of(part) if isinstance(leaf, ReachGoal)]
        return [goal]

    def _cost(self, goal: Goal) -> tuple[int, float]:
        """Return the number of leaves without a way, and the shortest time in which a body is at one of them."""
        leaves = self._wanted(goal)
        times_s = [
            self.travel_s(body, place)
            for leaf in leaves
            if (place := self.place(leaf)) is not None
            for body in self._bodies(leaf)
        ]
        return sum(bool(self.obstacle(leaf)) for leaf in leaves), min(times_s, default=0.0)

    def travel_s(self, body: str, place: GroundPoint) -> float:
        """Return the time in seconds that a body needs to a place in a straight line, at its declared speed."""
        entity = self._plan.entities[body]
        speed_mps = max(entity.number_or("speed_mps", 0.0), entity.number_or("cruise_mps", 0.0)) or _SPEED_MPS
        return math.dist(self._truth.place(body), place) / speed_mps

    def _bodies(self, leaf: LeafGoal) -> frozenset[str]:
        """Return the ids of the bodies that some agent commands and that can work towards a leaf."""
        match leaf:
            case LevelGoal(ways=ways) | StatusGoal(ways=ways):
                return self.moved & {actor for way in ways for actor in way.actors}
            case PerformGoal(actors=bodies) | ReachGoal(movers=bodies):
                return self.moved.intersection(bodies)
            case AssignGoal(asset=body):
                return self.moved & {body}
        return self.moved

    def _leaf_met(self, leaf: Goal) -> bool:
        truth = self._truth
        match leaf:
            case PerformGoal(interaction=kind, target=target):
                return any(kind == name and target in about for name, about in truth.known.emitted)
            case LevelGoal(entities=entities, state=state):
                return leaf.holds(sum(truth.stock(name, state) for name in entities))
            case ReachGoal():
                return any(self._there(leaf, name) for name in leaf.movers)
            case StatusGoal(entity=name, words=words):
                body = truth.state(name)
                return body is not None and body.status in words
            case ReportGoal(about=about, matching=matching):
                return matching and about in truth.matched
            case PictureGoal(asset=name):
                return any(frame.entity == name for frame in truth.known.frames)
            case InspectGoal(inspection=name):
                return self._inspected(name)
            case AssignGoal(asset=asset, target=target):
                return truth.distance(asset, target) <= MEANT_M
        return False

    def _there(self, leaf: ReachGoal, mover: str) -> bool:
        here = self._truth.place(mover)
        if leaf.region:
            return inside(leaf.region, here)
        place = self.place(leaf)
        return place is not None and math.dist(here, place) <= leaf.radius_m

    def _inspected(self, name: str) -> bool:
        spec = next((spec for spec in self._plan.instance.inspections if spec.name == name), None)
        route = self._truth.routes.get(spec.asset) if spec is not None else None
        return route is not None and len(self._truth.known.inspected.get(name, ())) >= len(route.waypoints)


def _calls(expression: object, function: str) -> bool:
    """Return whether an expression calls a function."""
    if isinstance(expression, tuple):
        return any(_calls(part, function) for part in expression)
    if not isinstance(expression, msgspec.Struct):
        return False
    named = getattr(expression, "function", "") == function
    return named or any(_calls(getattr(expression, name), function) for name in expression.__struct_fields__)


def middle(outline: tuple[GroundPoint, ...]) -> GroundPoint:
    """Return a place well inside an outline: its centroid, or the inner point of a grid that is farthest from edges."""
    centre = (sum(x for x, _ in outline) / len(outline), sum(y for _, y in outline) / len(outline))
    if inside(outline, centre):
        return centre
    west, east = min(x for x, _ in outline), max(x for x, _ in outline)
    south, north = min(y for _, y in outline), max(y for _, y in outline)
    grid = [
        (west + (east - west) * column / _STEPS, south + (north - south) * row / _STEPS)
        for column in range(1, _STEPS)
        for row in range(1, _STEPS)
    ]
    inner = [point for point in grid if inside(outline, point)]
    return max(inner, key=lambda point: min(math.dist(point, corner) for corner in outline), default=centre)


_STEPS = 20
"""Rows and columns of the grid in which an inner point is looked for. Chosen."""
