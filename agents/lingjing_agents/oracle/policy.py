"""The oracle's policy object: abilities are selected at the first boundary and run in one order at each."""

from __future__ import annotations

from collections.abc import Sequence

from lingjing.plugins.policy import Brief, Decision, Inbox, Observation
from lingjing_agents.oracle.ability import Ability
from lingjing_agents.oracle.aircraft import aircraft_abilities
from lingjing_agents.oracle.composing import MessageComposer
from lingjing_agents.oracle.deliveries import delivery_abilities
from lingjing_agents.oracle.dogs import dog_abilities
from lingjing_agents.oracle.errands import errand_abilities
from lingjing_agents.oracle.goal_state import GoalState
from lingjing_agents.oracle.hub import hub_abilities
from lingjing_agents.oracle.privileged_state import InstanceIndex, PrivilegedState, privileged
from lingjing_agents.oracle.pursuit import Pursuit, is_needed, pursuit_abilities
from lingjing_agents.oracle.reporting import ReportAbility, report_abilities
from lingjing_agents.oracle.thoughts import Thoughts
from lingjing_agents.oracle.vehicles import vehicle_abilities


class OraclePolicy:
    """The oracle for every role. It reads the open tasks from the ground truth at each tick."""

    async def reset(self, brief: Brief) -> None:
        """Store the brief. The ground truth comes with the first observation."""
        self._brief = brief
        self._plan: InstanceIndex | None = None
        self._abilities: tuple[Ability, ...] = ()

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        """Return all messages and the first command of the abilities. Raises `UsageError` without a ground truth."""
        known = privileged(observation)
        if self._plan is None:
            self._plan = InstanceIndex(known.instance)
            self._goals = GoalState(self._plan)
            self._abilities = abilities(self._brief, self._plan, self._goals)
            self._thoughts = Thoughts(self._brief, self._plan, self._goals)
        truth = PrivilegedState(self._brief, self._plan, observation, inbox)
        self._goals.look(truth)
        messages = [message for ability in self._abilities for message in ability.say(truth)]
        command = None
        for ability in self._abilities:
            command = command or ability.act(truth)
        thought = self._thoughts.of(self._abilities, command)
        return Decision(command=command, messages=tuple(messages), thought=thought)


def abilities(brief: Brief, plan: InstanceIndex, goals: GoalState) -> tuple[Ability, ...]:
    """Return an agent's abilities, the most urgent first."""
    composer = MessageComposer(brief)
    reports = report_abilities(brief, plan, composer)
    reporter = next((ability for ability in reports if isinstance(ability, ReportAbility)), None)
    if is_needed(plan):
        drives: Sequence[Ability] = pursuit_abilities(brief, plan, Pursuit(plan, goals))
    else:
        drives = (*delivery_abilities(brief, plan, composer), *vehicle_abilities(brief, plan, composer))
    return (
        *reports,
        *aircraft_abilities(brief, plan, reporter, composer),
        *dog_abilities(brief, plan, composer, reporter),
        *drives,
        *hub_abilities(brief, plan, composer),
        *errand_abilities(brief, plan),
    )
