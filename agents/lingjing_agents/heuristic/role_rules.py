"""`RoleRules`: what the rules of every role have in common."""

from __future__ import annotations

from typing import ClassVar, Protocol

from lingjing.plugins.policy import Decision, Inbox, Observation


class RoleRules(Protocol):
    """One role's rules: a pure function of what it has seen so far. All state is of one episode.

    `reads` and `sends` are the message records it serves, by the names that the language's standard library gives them
    (`report`, `assignment`, `status`, …).
    """

    reads: ClassVar[tuple[str, ...]]
    sends: ClassVar[tuple[str, ...]]

    def act(self, observation: Observation, inbox: Inbox) -> Decision:
        """The decision for this boundary."""
        ...
