"""The rules of bodies with an errand: take a picture, fly to a place."""

from __future__ import annotations

from typing import ClassVar

from lingjing.plugins.policy import Brief, Decision, Inbox, Observation, Resource
from lingjing_agents.errands import flight, picture, shown_place
from lingjing_agents.heuristic.events import view_of


class PictureTaker:
    """One body that takes one picture. Its state belongs to one episode."""

    roles: ClassVar[tuple[str, ...]] = ("photographer",)
    reads: ClassVar[tuple[str, ...]] = ()
    sends: ClassVar[tuple[str, ...]] = ()

    def __init__(self, body: Resource) -> None:
        self._body, self._has_one = body, False

    def act(self, observation: Observation, inbox: Inbox) -> Decision:
        """Return the command for a picture until there is one."""
        command = None if self._has_one else picture(self._body, observation)
        self._has_one = command is None
        return Decision(command=command)


class GoalFlyer:
    """One aircraft that flies to a given place."""

    roles: ClassVar[tuple[str, ...]] = ("pilot",)
    reads: ClassVar[tuple[str, ...]] = ()
    sends: ClassVar[tuple[str, ...]] = ()

    def __init__(self, brief: Brief, body: Resource) -> None:
        self._brief, self._body = brief, body

    def act(self, observation: Observation, inbox: Inbox) -> Decision:
        """Return the next command of the flight; none without exactly one visible place."""
        own, place = view_of(observation, self._body.id), shown_place(self._brief, observation)
        if own is None or place is None:
            return Decision()
        return Decision(command=flight(self._brief, self._body, own, place))
