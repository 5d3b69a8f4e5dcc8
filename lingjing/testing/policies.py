"""Policies for tests: scripted ones, and `build_policy`, which makes the policy of a declaration with options."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from lingjing.plugins.loading import build_policy
from lingjing.plugins.policy import Brief, Inbox, Observation, Policy
from lingjing.trace.records import Decision

Script = Mapping[str, Mapping[int, Decision]]
"""The decision of each agent id at each boundary number; a missing one is a decision that does nothing."""


class ScriptedPolicy:
    """A policy of one agent that makes the decisions of a script."""

    def __init__(self, script: Script) -> None:
        self._script = script
        self._agent = ""

    async def reset(self, brief: Brief) -> None:
        """Receive the agent's id. Raises `ValueError` for a script with an agent that the mission does not have."""
        known = {brief.agent, *(peer.id for peer in brief.peers)}
        unknown = sorted(set(self._script) - known)
        if unknown:
            raise ValueError(f"no agent is called {', '.join(unknown)}: the mission has {', '.join(sorted(known))}")
        self._agent = brief.agent

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        """Return the scripted decision of this boundary."""
        return self._script.get(self._agent, {}).get(observation.tick, Decision())


def scripted(script: Script) -> Callable[[], Policy]:
    """Return a policy for `lingjing.run` and `lingjing.testing.play` that makes the decisions of a script.

    Its name in reports is `scripted`.
    """

    def make() -> Policy:
        return ScriptedPolicy(script)

    make.__qualname__ = "scripted"
    return make


__all__ = ["Script", "ScriptedPolicy", "build_policy", "scripted"]
