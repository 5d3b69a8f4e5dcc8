"""`References`: what would have been right, agent by agent and boundary by boundary.

A reference is a privileged policy. It is asked with what the agent was given, and with the truth in the same
observation. It begins with the episode and goes on as long as the agent decided as it did; where the agent departed
from it, one that is asked from boundary T on would take for said or done what was not, so a new one begins at T.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Collection, Mapping, Sequence

from lingjing.causal.faculties import TrueSituation, faculties_of, replaced
from lingjing.errors import InfrastructureError
from lingjing.kernel.candidates import received
from lingjing.kernel.sequential import SequentialPolicies
from lingjing.kernel.step import Published
from lingjing.plugins.policy import Brief, Policy
from lingjing.trace.records import Decision, DecisionRecord


class References:
    """References of some agents; `build` makes one. Their briefs are the agents' own."""

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
        """What would be right for each agent now. Raises `InfrastructureError` if a reference gives no answer."""
        inputs = {
            agent: (
                dataclasses.replace(published.observations[agent], privileged=published.truths[agent]),
                published.inboxes[agent],
            )
            for agent in self._briefs
        }
        made = {}
        for agent, policy in self._policies.items():
            (answer,) = (received(one) for one in policy.act(inputs))
            if answer.substituted:
                raise InfrastructureError(
                    f"the reference of `{agent}` gives no answer at boundary {published.record.tick}: {answer.detail}",
                    hint="choose another with --reference: a privileged policy that can play this mission",
                )
            made[agent] = answer.decision
        return made

    def begin(self, agents: Collection[str]) -> None:
        """From now on these are to be followed: those that their agents have departed from begin anew."""
        fresh = {agent: self._briefs[agent] for agent in agents if agent in self._departed and agent in self._briefs}
        self._policies |= self._fresh(fresh)
        self._begun |= set(agents)

    def keep(self, agents: Collection[str]) -> None:
        """Only these are of use from now on."""
        self._briefs = {agent: brief for agent, brief in self._briefs.items() if agent in agents}
        self._policies = {agent: self._policies[agent] for agent in self._briefs}

    def note(
        self, decisions: Sequence[DecisionRecord], due: Mapping[str, Decision], scenes: Mapping[str, TrueSituation]
    ) -> tuple[tuple[str, str], ...]:
        """Take note of who departed from its reference; the (faculty, agent) pairs in which they did."""
        found = tuple(
            (faculty, made.agent)
            for made in decisions
            if made.agent in due
            for faculty in faculties_of(scenes[made.agent].instance, scenes[made.agent].agent)
            if replaced(faculty, made.decision, due[made.agent], scenes[made.agent]) is not made.decision
        )
        self._departed |= {agent for _, agent in found} - self._begun
        return found

    def _fresh(self, briefs: Mapping[str, Brief]) -> dict[str, SequentialPolicies]:
        made = {}
        for agent, brief in briefs.items():
            made[agent] = SequentialPolicies({agent: self._build(agent)}, self._limit_s)
            for answer in made[agent].reset({agent: brief}).values():
                if answer.reason:
                    raise InfrastructureError(f"the reference of `{agent}` cannot take its brief: {answer.detail}")
        return made
