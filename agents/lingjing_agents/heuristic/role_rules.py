"""`RoleRules`: the interface of the rules of every role."""

from __future__ import annotations

from typing import ClassVar, Protocol

from lingjing.plugins.policy import Decision, Inbox, Observation


class RoleRules(Protocol):
    """The rules of one role: a deterministic function of the observations so far. The state belongs to one episode.

    Rules are selected by an agent's abilities, so a mission may use other role names.
    """

    roles: ClassVar[tuple[str, ...]]
    """The roles that the rules serve in the shipped missions."""
    reads: ClassVar[tuple[str, ...]]
    """The message records that they read, by their names in the standard library (`report`, `assignment`,
    `status`, …).
    """
    sends: ClassVar[tuple[str, ...]]
    """The message records that they send."""

    def act(self, observation: Observation, inbox: Inbox) -> Decision:
        """Return the decision for this boundary."""
        ...
