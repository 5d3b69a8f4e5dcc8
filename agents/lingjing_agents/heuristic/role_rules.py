"""`RoleRules`: what the rules of every role have in common."""

from __future__ import annotations

from typing import ClassVar, Protocol

from lingjing.plugins.policy import Decision, Inbox, Observation


class RoleRules(Protocol):
    """One role's rules: a pure function of what it has seen so far. All state is of one episode.

    `roles` are those that it serves in the shipped missions, `reads` and `sends` the message records, by the names that
    the language's standard library gives them (`report`, `assignment`, `status`, …). The rules of an agent are chosen
    by what it can do, so a mission may call its roles otherwise.
    """

    roles: ClassVar[tuple[str, ...]]
    reads: ClassVar[tuple[str, ...]]
    sends: ClassVar[tuple[str, ...]]

    def act(self, observation: Observation, inbox: Inbox) -> Decision:
        """The decision for this boundary."""
        ...
