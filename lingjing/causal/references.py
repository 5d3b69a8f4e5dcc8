"""References of agents: privileged policies. Their decisions count as right.

A reference receives the agent's observations with the ground truth added. It starts with the episode and continues as
long as the agent decides as it does. After a departure its memory no longer matches the episode; therefore a new
reference starts at the boundary of a substitution.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Collection, Mapping, Sequence

from lingjing.causal.faculties import TrueSituation, faculties_of, replace_faculty
from lingjing.errors import InfrastructureError
from lingjing.kernel.candidates import normalise_decision
from lingjing.kernel.sequential import SequentialPolicies
from lingjing.kernel.step import Published
from lingjing.plugins.policy import Brief, Policy
from lingjing.trace.records import Decision, DecisionRecord


class References:
    """The references of some agents; `build` makes a policy for an agent. They receive the agents' own briefs."""

    def __init__(
        self, agents: Collection[str], briefs: Mapping[str, Brief], build: Callable[[str], Policy], limit_s: float
    ) -> None:
        self._briefs = {agent: briefs[agent] for agent in briefs if agent in agents}
        self._build = build
        self._limit_s = limit_s
        self._policies = self._fresh(self._briefs)
        self._departed: set[str] = set()
        self._begun: set[str] = set()

    def decide(self, published: Published) -> dict[str, Decision]:
        """Return the reference decision of each agent. Raises `InfrastructureError` if a reference gives no answer."""
        inputs = {
            agent: (
                dataclasses.replace(published.observations[agent], privileged=published.truths[agent]),
                published.inboxes[agent],
            )
            for agent in self._briefs
        }
        made = {}
        for agent, policy in self._policies.items():
            (answer,) = (normalise_decision(answered) for answered in policy.act(inputs))
            if answer.substituted:
                raise InfrastructureError(
                    f"the reference of `{agent}` gives no answer at boundary {published.record.tick}: {answer.detail}",
                    hint="choose another privileged policy with --reference",
                )
            made[agent] = answer.decision
        return made

    def begin(self, agents: Collection[str]) -> None:
        """Start the substitution of these agents: references that their agents have departed from are started again."""
        fresh = {agent: self._briefs[agent] for agent in agents if agent in self._departed and agent in self._briefs}
        self._policies |= self._fresh(fresh)
        self._begun |= set(agents)

    def keep(self, agents: Collection[str]) -> None:
        """Drop the references of all other agents."""
        self._briefs = {agent: brief for agent, brief in self._briefs.items() if agent in agents}
        self._policies = {agent: self._policies[agent] for agent in self._briefs}

    def note(
        self, decisions: Sequence[DecisionRecord], due: Mapping[str, Decision], scenes: Mapping[str, TrueSituation]
    ) -> tuple[tuple[str, str], ...]:
        """Record the departures at a boundary and return their (faculty, agent) pairs."""
        departures = tuple(
            (faculty, made.agent)
            for made in decisions
            if made.agent in due
            for faculty in faculties_of(scenes[made.agent].instance, scenes[made.agent].agent)
            if replace_faculty(faculty, made.decision, due[made.agent], scenes[made.agent]) is not made.decision
        )
        self._departed |= {agent for _, agent in departures} - self._begun
        return departures

    def _fresh(self, briefs: Mapping[str, Brief]) -> dict[str, SequentialPolicies]:
        made = {}
        for agent, brief in briefs.items():
            made[agent] = SequentialPolicies({agent: self._build(agent)}, self._limit_s)
            for answer in made[agent].reset({agent: brief}).values():
                if answer.reason:
                    raise InfrastructureError(f"the reference of `{agent}` cannot take its brief: {answer.detail}")
        return made
