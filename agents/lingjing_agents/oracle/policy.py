"""The oracle's policy object: abilities found at the first boundary, asked in one order at each."""

from __future__ import annotations

from lingjing.plugins.policy import Brief, Decision, Inbox, Observation
from lingjing_agents.oracle.ability import Ability
from lingjing_agents.oracle.dispatching import dispatching
from lingjing_agents.oracle.flying import flying
from lingjing_agents.oracle.leading import leading
from lingjing_agents.oracle.looking import Reporting, reporting
from lingjing_agents.oracle.sailing import going
from lingjing_agents.oracle.talking import Voice
from lingjing_agents.oracle.truth import Plan, Truth, privileged
from lingjing_agents.oracle.walking import walking


class OraclePolicy:
    """One mind for every role; what is left to do is read from the truth at each tick."""

    async def reset(self, brief: Brief) -> None:
        """Remember the brief; the truth comes with the first observation."""
        self._brief = brief
        self._plan: Plan | None = None
        self._abilities: tuple[Ability, ...] = ()

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        """Say what there is to say and give the first command. `UsageError` if the truth was not handed over."""
        known = privileged(observation)
        if self._plan is None:
            self._plan = Plan(known.instance)
            self._abilities = abilities(self._brief, self._plan)
        truth = Truth(self._brief, self._plan, observation, inbox)
        messages = [message for ability in self._abilities for message in ability.say(truth)]
        command = None
        for ability in self._abilities:
            command = command or ability.act(truth)
        return Decision(command=command, messages=tuple(messages))


def abilities(brief: Brief, plan: Plan) -> tuple[Ability, ...]:
    """What an agent can do, most urgent first."""
    voice = Voice(brief)
    reports = reporting(brief, plan, voice)
    eyes = next((one for one in reports if isinstance(one, Reporting)), None)
    return (
        *reports,
        *flying(brief, plan, eyes, voice),
        *walking(brief, plan, voice, eyes),
        *dispatching(brief, plan, voice),
        *going(brief, plan, voice),
        *leading(brief, plan, voice),
    )
