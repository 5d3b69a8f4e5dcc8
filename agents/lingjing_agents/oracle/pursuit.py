"""The pursuit of goals: every body gets a stop, nearest pairs first, and each agent commands its own bodies to theirs.

It plays the missions with goals beyond required interactions and reports: amounts, distances, regions, status words,
transport in loads. Every agent computes the same allocation from the same truth.
"""

from __future__ import annotations

from collections.abc import Sequence

from lingjing.plugins.policy import DEAD, DORMANT, Action, Brief
from lingjing.plugins.tasks import (
    AssignGoal,
    LeafGoal,
    LevelGoal,
    PerformGoal,
    ReachGoal,
    StatusGoal,
    entry_regions,
    leaves_of,
)
from lingjing_agents.capability import walks
from lingjing_agents.oracle.ability import Ability
from lingjing_agents.oracle.aircraft import AircraftControl, flyer
from lingjing_agents.oracle.approaches import Approach, DogApproach, FlightApproach, PlaneApproach
from lingjing_agents.oracle.deliveries import supply_chain
from lingjing_agents.oracle.goal_state import GoalState
from lingjing_agents.oracle.privileged_state import InstanceIndex, PrivilegedState
from lingjing_agents.oracle.stops import Stop, StopPlanner
from lingjing_agents.oracle.vehicles import mover


def is_needed(plan: InstanceIndex) -> bool:
    """Return whether success has goals beyond the interactions and reports that the other abilities work towards."""
    return any(_is_beyond(leaf, plan) for leaf in leaves_of(plan.goals))


def _is_beyond(leaf: LeafGoal, plan: InstanceIndex) -> bool:
    match leaf:
        case PerformGoal(interaction=name, target=target):
            return not _is_served(name, target, plan)
        case LevelGoal(entities=entities, ways=ways):
            served = {way.target for way in ways if _is_served(way.interaction, way.target, plan)}
            return bool(ways) and not served.issuperset(entities)
        case StatusGoal(entity=entity, ways=ways):
            return bool(ways) and not any(_is_served(way.interaction, entity, plan) for way in ways)
        case ReachGoal(movers=movers):
            return not any(_is_visited(leaf, mover, plan) for mover in movers)
    return isinstance(leaf, AssignGoal)


def _is_served(interaction: str, target: str, plan: InstanceIndex) -> bool:
    """Return whether an interaction is a task of the other abilities."""
    chain = supply_chain(plan)
    deliveries = chain.deliveries if chain is not None else ()
    tasks = [task for task in plan.tasks if (task.name, task.target) == (interaction, target)]
    return any(not task.moves_goods or task in deliveries for task in tasks)


def _is_visited(leaf: ReachGoal, body: str, plan: InstanceIndex) -> bool:
    """Return whether the other abilities bring a body there for one of its tasks."""
    tasks = [task for task in plan.tasks if body in task.actors]
    if leaf.entity:
        return any(task.target == leaf.entity for task in tasks)
    rims = [region.polygon for task in tasks for region in entry_regions(task, plan.instance)]
    return bool(leaf.region) and leaf.region in rims


class Pursuit:
    """The allocation of stops to bodies, computed once for each boundary."""

    def __init__(self, plan: InstanceIndex, goals: GoalState) -> None:
        self._plan, self._goals = plan, goals
        self._stops = StopPlanner(plan, goals)
        self._known: tuple[int, dict[str, Stop]] = (-1, {})

    def stops(self, truth: PrivilegedState) -> dict[str, Stop]:
        """Return the stop of each body that has one."""
        if self._known[0] != truth.tick:
            self._known = truth.tick, self._allocated(truth)
        return self._known[1]

    def _allocated(self, truth: PrivilegedState) -> dict[str, Stop]:
        wanted = self._goals.wanted()
        work = [leaf for leaf in wanted if isinstance(leaf, PerformGoal | LevelGoal | StatusGoal)]
        free = [name for name in sorted(self._goals.moved) if _able(truth, name)]
        shared: dict[str, Stop] = {}
        self._pair(truth, free, work, shared)
        self._pair(truth, free, [leaf for leaf in work if self._is_transport(leaf)], shared, again=True)
        places = [leaf for leaf in wanted if leaf not in work]
        self._pair(truth, free, [leaf for leaf in places if leaf.at != "success"], shared)
        places_of_stops = {stop.place for stop in shared.values()}
        spare = [leaf for leaf in self._goals.spare() if self._goals.place(leaf) not in places_of_stops]
        self._pair(truth, free, spare, shared)
        self._pair(truth, free, places, shared, again=True)  # targets that must hold at the end come last
        return shared

    def _pair(
        self,
        truth: PrivilegedState,
        free: list[str],
        leaves: Sequence[LeafGoal],
        shared: dict[str, Stop],
        *,
        again: bool = False,
    ) -> None:
        """Give the nearest pairs of bodies and goals to each other; with `again` a goal takes several bodies."""
        left = list(leaves)
        pairs = [
            (self._goals.travel_s(body, stop.place), number, body, stop)
            for number, leaf in enumerate(leaves)
            for body in free
            if (stop := self._stops.stop(truth, body, leaf)) is not None
        ]
        for _, number, body, stop in sorted(pairs, key=lambda pair: pair[:3]):
            if body in free and (again or leaves[number] in left):
                free.remove(body)
                shared[body] = stop
                if not again:
                    left.remove(leaves[number])

    def _is_transport(self, leaf: LeafGoal) -> bool:
        ways = leaf.ways if isinstance(leaf, LevelGoal) else ()
        specs = {(e.id, spec.name): spec for e in self._plan.instance.entities for spec in e.interactions}
        return any(specs[way.target, way.interaction].moves_goods for way in ways)


class PursuitAbility(Ability):
    """Commands one body to its stops."""

    def __init__(self, body: str, pursuit: Pursuit, approach: Approach) -> None:
        self._body, self._pursuit, self._approach = body, pursuit, approach

    def act(self, truth: PrivilegedState) -> Action | None:
        """Return the command to the stop; None without one, or on arrival."""
        stop = self._pursuit.stops(truth).get(self._body)
        self.aim = "" if stop is None else stop.name
        self.goal = None if stop is None else stop.goal
        if stop is None or truth.busy(self._body):
            return None
        return self._approach.towards(truth, stop)


def pursuit_abilities(brief: Brief, plan: InstanceIndex, pursuit: Pursuit) -> list[Ability]:
    """Return an ability for each body that the agent commands: its own, and those that no agent embodies."""
    abilities: list[Ability] = []
    aircraft = flyer(brief)
    for resource in brief.resources:
        if not resource.embodied and resource.id in plan.owners:
            continue
        if resource == aircraft:
            abilities.append(PursuitAbility(resource.id, pursuit, FlightApproach(AircraftControl(resource, plan))))
        elif mover(resource):
            abilities.append(PursuitAbility(resource.id, pursuit, PlaneApproach(resource)))
        elif walks(resource.verbs):
            abilities.append(PursuitAbility(resource.id, pursuit, DogApproach(plan.entities[resource.id], plan)))
    return abilities


def _able(truth: PrivilegedState, name: str) -> bool:
    state = truth.state(name)
    return state is not None and state.status not in (DEAD, DORMANT)
