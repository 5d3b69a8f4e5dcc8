"""Errands in missions without interactions: a picture, a flight to a given place."""

from __future__ import annotations

from lingjing.plugins.policy import Action, Brief, Resource
from lingjing_agents.errands import camera_body, flight, picture, shown_place, wants_pictures
from lingjing_agents.oracle.ability import Ability
from lingjing_agents.oracle.aircraft import flyer
from lingjing_agents.oracle.privileged_state import InstanceIndex, PrivilegedState


class _PictureAbility(Ability):
    """Takes one picture."""

    def __init__(self, body: Resource) -> None:
        self._body, self._has_one = body, False

    def act(self, truth: PrivilegedState) -> Action | None:
        """Return the command for a picture until there is one."""
        command = None if self._has_one else picture(self._body, truth.observation)
        self._has_one = command is None
        return command


class _GoalAbility(Ability):
    """Flies to the only place that the agent observes."""

    def __init__(self, brief: Brief, body: Resource) -> None:
        self._brief, self._body = brief, body

    def act(self, truth: PrivilegedState) -> Action | None:
        """Return the next command of the flight."""
        own = next((view for view in truth.observation.entities if view.id == self._body.id), None)
        place = shown_place(self._brief, truth.observation)
        return None if own is None or place is None else flight(self._brief, self._body, own, place)


def errand_abilities(brief: Brief, plan: InstanceIndex) -> list[Ability]:
    """Return the abilities for missions in which no target is served and nothing reported."""
    abilities: list[Ability] = []
    camera, aircraft = camera_body(brief), flyer(brief)
    if camera is not None and wants_pictures(brief):
        abilities.append(_PictureAbility(camera))
    if aircraft is not None and not plan.tasks and not plan.kinds:
        abilities.append(_GoalAbility(brief, aircraft))
    return abilities
