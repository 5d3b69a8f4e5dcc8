"""`Ability`: one thing that an agent can do, whatever the mission."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from lingjing.plugins.policy import Action, Brief, Outgoing
from lingjing_agents.oracle.composing import MessageComposer
from lingjing_agents.oracle.privileged_state import InstanceIndex, PrivilegedState


class Ability(Protocol):
    """Looks at the truth once a tick: first everything is said, then the first ability with a command gives it."""

    def say(self, truth: PrivilegedState) -> list[Outgoing]:
        """Messages for the next boundary."""
        ...

    def act(self, truth: PrivilegedState) -> Action | None:
        """A command, if there is something to do."""
        ...


Maker = Callable[[Brief, InstanceIndex, MessageComposer], "list[Ability]"]
"""Gives an agent those abilities of one kind that its resources and messages allow."""
