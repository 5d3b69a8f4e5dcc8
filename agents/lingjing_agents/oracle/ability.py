"""`Ability`: one task that an agent can carry out in any mission."""

from __future__ import annotations

from lingjing.plugins.policy import Action, Outgoing
from lingjing_agents.oracle.privileged_state import PrivilegedState


class Ability:
    """Base of the abilities. At each tick all abilities send their messages; the first with a command determines it."""

    def say(self, truth: PrivilegedState) -> list[Outgoing]:
        """Return messages for the next boundary."""
        return []

    def act(self, truth: PrivilegedState) -> Action | None:
        """Return a command, or None if there is nothing to do."""
        return None
