"""`FaultyPolicy`: a policy whose inputs and answers pass through its planted faults."""

from __future__ import annotations

from lingjing.plugins.policy import Brief, Decision, Inbox, Observation, Policy
from lingjing_agents.faulty.answered import changed_answer
from lingjing_agents.faulty.options import FaultyOptions
from lingjing_agents.faulty.shown import changed_observation


class FaultyPolicy:
    """Plays as the wrapped policy does, except where a fault of this agent acts."""

    def __init__(self, wrapped: Policy, options: FaultyOptions) -> None:
        self._wrapped, self._faults = wrapped, options.faults

    async def reset(self, brief: Brief) -> None:
        """The wrapped policy is told all; it knows nothing of its faults."""
        self._brief = brief
        await self._wrapped.reset(brief)

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        """What the wrapped policy answers to what it is shown, changed by the faults that act now."""
        acting = [fault for fault in self._faults if fault.acts(observation.agent, observation.tick)]
        for fault in acting:
            observation = changed_observation(fault, observation)
        decision = await self._wrapped.act(observation, inbox)
        for fault in acting:
            decision = changed_answer(fault, self._brief, decision)
        return decision


def faulty_oracle(options: FaultyOptions) -> Policy:
    """The oracle with faults. Privileged as the oracle is."""
    from lingjing_agents.oracle import OraclePolicy

    return FaultyPolicy(OraclePolicy(), options)


def faulty_heuristic(options: FaultyOptions) -> Policy:
    """The heuristic with faults."""
    from lingjing_agents.heuristic.policy import HeuristicPolicy

    return FaultyPolicy(HeuristicPolicy(), options)
