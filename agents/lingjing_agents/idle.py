"""`idle`: a policy that never acts. A mission that it wins is won without agents."""

from __future__ import annotations

from lingjing.plugins.policy import Brief, Decision, Inbox, Observation


class IdlePolicy:
    """A policy without commands and messages."""

    async def reset(self, brief: Brief) -> None:
        """Receive the brief."""

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        """Return the decision that does nothing."""
        return Decision()
