"""`Ability`: one task that an agent can carry out in any mission."""

from __future__ import annotations

from lingjing.plugins.policy import Action, Outgoing
from lingjing.plugins.tasks import LeafGoal
from lingjing_agents.oracle.privileged_state import PrivilegedState


class Ability:
    """Base of the abilities. At each tick all abilities send their messages; the first with a command determines it."""

    aim: str = ""
    """Id of the entity, or name of the inspection, that the latest command is for; "" for none."""

    goal: LeafGoal | None = None
    """The goal that the latest command is for, if the ability knows it."""

    def say(self, truth: PrivilegedState) -> list[Outgoing]:
        """Return messages for the next boundary."""
        return []

    def act(self, truth: PrivilegedState) -> Action | None:
        """Return a command, or None if there is nothing to do."""
        return None
