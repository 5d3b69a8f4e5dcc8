"""`Ability`: one thing that an agent can do, whatever the mission."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from lingjing.plugins.policy import Action, Brief, Outgoing
from lingjing_agents.oracle.talking import Voice
from lingjing_agents.oracle.truth import Plan, Truth


class Ability(Protocol):
    """Looks at the truth once a tick: first everything is said, then the first ability with a command gives it."""

    def say(self, truth: Truth) -> list[Outgoing]:
        """Messages for the next boundary."""
        ...

    def act(self, truth: Truth) -> Action | None:
        """A command, if there is something to do."""
        ...


Maker = Callable[[Brief, Plan, Voice], "list[Ability]"]
"""Gives an agent those abilities of one kind that its resources and messages allow."""
