"""The selection of a walker's rules, at the first boundary, because the reference picture comes with the first
observation.

Without a camera it carries out guided steps (`step_executor`). If reports may name fires it searches for flames
(`fire_searcher`). Otherwise it goes to ordered places and searches for the building of a reference picture, or explores
(`building_finder`).
"""

from __future__ import annotations

from types import MappingProxyType
from typing import ClassVar

from lingjing.plugins.policy import Brief, CameraSpec, Decision, Inbox, Observation, Resource
from lingjing_agents.capability import has_verb, may_send, walks
from lingjing_agents.heuristic.dogs.building_finder import BuildingFinder
from lingjing_agents.heuristic.dogs.fire_searcher import FireSearcher
from lingjing_agents.heuristic.dogs.step_executor import StepExecutor
from lingjing_agents.heuristic.events import view_of
from lingjing_agents.heuristic.role_rules import RoleRules
from lingjing_agents.heuristic.target_types import Detectors

STEPS = ("forward", "left", "right")
"""The verbs of walkers. Their declarations do not state the direction of a turn, so it is known by name."""

REFERENCE = "reference"
"""The camera name of reference pictures."""


def walking_body(brief: Brief) -> Resource | None:
    """Return the first embodied resource that turns by degrees and has the verbs of `STEPS`, or None."""
    for resource in brief.resources:
        if resource.embodied and walks(resource.verbs) and all(has_verb(resource, verb) for verb in STEPS):
            return resource
    return None


def _front_camera(body: Resource) -> CameraSpec | None:
    """Return the first camera that looks ahead, or None."""
    return next((camera for camera in body.cameras if camera.view == "front"), None)


class DogRules:
    """One walker with the rules that fit its task."""

    roles: ClassVar[tuple[str, ...]] = (*FireSearcher.roles, *BuildingFinder.roles, *StepExecutor.roles)
    reads: ClassVar[tuple[str, ...]] = (*FireSearcher.reads, *BuildingFinder.reads)
    sends: ClassVar[tuple[str, ...]] = FireSearcher.sends

    def __init__(self, brief: Brief, body: Resource, detectors: Detectors = MappingProxyType({})) -> None:
        self._brief, self._body, self._detectors = brief, body, detectors
        self._rules: RoleRules | None = None

    def act(self, observation: Observation, inbox: Inbox) -> Decision:
        """Select the rules once, then follow them."""
        if self._rules is None:
            self._rules = self._chosen(observation)
        return self._rules.act(observation, inbox)

    def _chosen(self, observation: Observation) -> RoleRules:
        camera = _front_camera(self._body)
        if camera is None:
            return StepExecutor(self._brief, self._body)
        reference = next((picture for picture in observation.pictures if picture.camera == REFERENCE), None)
        own = view_of(observation, self._body.id)
        burning = any("fire" in name for name in self._brief.classes) and may_send(self._brief, "report") is not None
        if reference is None and burning:
            return FireSearcher(self._brief, self._body, camera, self._detectors)
        here = own.position[:2] if own is not None and own.position is not None else (0.0, 0.0)
        return BuildingFinder(self._brief, self._body, camera, reference, here, self._detectors)
