"""`Thoughts`: what an agent wants at a tick and why, and the conditions that it has no way to work towards."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from lingjing.plugins.policy import NOTE, Action, Brief
from lingjing.plugins.tasks import InspectGoal, LeafGoal, LevelGoal, PerformGoal, ReportGoal, StatusGoal
from lingjing_agents.oracle.ability import Ability
from lingjing_agents.oracle.goal_state import GoalState
from lingjing_agents.oracle.privileged_state import InstanceIndex


class Thoughts:
    """The thoughts of one agent."""

    def __init__(self, brief: Brief, plan: InstanceIndex, goals: GoalState) -> None:
        self._brief, self._plan, self._goals = brief, plan, goals

    def of(self, abilities: Sequence[Ability], command: Action | None) -> str:
        """Return the thought of a boundary: the aims of the agent's abilities, the command, and notes."""
        wanted = self._goals.wanted()
        aims = dict.fromkeys((ability.aim, ability.goal) for ability in abilities if ability.aim)
        lines = [self._aim(aim, goal, wanted) for aim, goal in aims] or [self._none(wanted)]
        if command is not None:
            lines.append(f"So {command.resource or 'my body'} gets the command {command.verb}.")
        return "\n".join((*lines, *self._notes(wanted)))

    def _aim(self, aim: str, goal: LeafGoal | None, wanted: Sequence[LeafGoal]) -> str:
        leaf = goal or next((leaf for leaf in wanted if aim in _about(leaf)), None)
        return f"I go for {aim}{_because(leaf)}."

    def _none(self, wanted: Sequence[LeafGoal]) -> str:
        leaf = next((leaf for leaf in wanted if not self._goals.obstacle(leaf)), None)
        if leaf is None:
            return "I do nothing: success needs nothing that I can do."
        return f"I have nothing to do myself; others work towards `{leaf.text}` of {leaf.at}."

    def _notes(self, wanted: Sequence[LeafGoal]) -> Iterator[str]:
        for leaf in wanted:
            if reason := self._goals.obstacle(leaf):
                yield f"{NOTE}cannot work towards `{leaf.text}` of {leaf.at}: {reason}"


def _about(leaf: LeafGoal) -> tuple[str, ...]:
    """Return the names of what a leaf is about."""
    match leaf:
        case PerformGoal(target=name) | ReportGoal(about=name) | InspectGoal(inspection=name):
            return (name,)
        case LevelGoal(entities=names, ways=ways):
            return (*names, *(way.target for way in ways))
        case StatusGoal(entity=name):
            return (name,)
    return tuple(str(getattr(leaf, field)) for field in ("entity", "target", "asset") if hasattr(leaf, field))


def _because(leaf: LeafGoal | None) -> str:
    return "" if leaf is None else f", because `{leaf.text}` of {leaf.at} is not met"
