"""The brief and the observation without a component that is switched off: the paper's component ablations.

The switch `second_view` concerns the cameras beside the one that looks straight down, `grid` the search cells. The
modules of the other components read their switches (`history_tokens`, `memory`, `images`, `research`, `image_side`).
"""

from __future__ import annotations

from dataclasses import replace

import msgspec

from lingjing.plugins.policy import REFERENCE, Brief, Observation, Picture, Resource
from lingjing_agents.react.options import ReactOptions


def shown_brief(brief: Brief, options: ReactOptions) -> Brief:
    """Return the brief without the components that are switched off."""
    if not options.second_view:
        brief = msgspec.structs.replace(brief, resources=tuple(map(_top_view_only, brief.resources)))
    return brief if options.grid else msgspec.structs.replace(brief, cells=())


def shown_observation(observation: Observation, brief: Brief, options: ReactOptions) -> Observation:
    """Return the observation without the components that are switched off. `brief` is the result of `shown_brief`."""
    if not options.second_view:
        mounts = {resource.id: {camera.name for camera in resource.cameras} for resource in brief.resources}
        pictures = tuple(picture for picture in observation.pictures if _shown(picture, mounts))
        observation = replace(observation, pictures=pictures)
    return observation if options.grid else replace(observation, cells=())


def _top_view_only(resource: Resource) -> Resource:
    down = tuple(camera for camera in resource.cameras if camera.view == "nadir")
    return msgspec.structs.replace(resource, cameras=down) if down else resource


def _shown(picture: Picture, mounts: dict[str, set[str]]) -> bool:
    """Return True for a reference picture, a picture of a foreign entity, and one from a camera that is left."""
    if picture.camera == REFERENCE or picture.entity not in mounts:
        return True
    return picture.camera in mounts[picture.entity]
