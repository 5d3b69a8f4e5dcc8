"""`Ability`: one thing that an agent can do, whatever the mission."""

from __future__ import annotations

from lingjing.plugins.policy import Action, Outgoing
from lingjing_agents.oracle.privileged_state import PrivilegedState


class Ability:
    """Looks at the truth once a tick: first everything is said, then the first ability with a command gives it."""

    def say(self, truth: PrivilegedState) -> list[Outgoing]:
        """Messages for the next boundary."""
        return []

    def act(self, truth: PrivilegedState) -> Action | None:
        """A command, if there is something to do."""
        return None
