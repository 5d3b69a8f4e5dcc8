"""What an agent is shown when one of its components is switched off: the paper's component ablations.

`second_view` are cameras beside the one that looks straight down, `grid` are the search cells. The other switches
(`history_tokens`, `memory`, `images`, `research`, `image_side`) are kept where the component is.
"""

from __future__ import annotations

from dataclasses import replace

import msgspec

from lingjing.plugins.policy import REFERENCE, Brief, Observation, Picture, Resource
from lingjing_agents.react.options import ReactOptions


def shown_brief(brief: Brief, options: ReactOptions) -> Brief:
    """The brief without what is switched off."""
    if not options.second_view:
        brief = msgspec.structs.replace(brief, resources=tuple(map(_top_view_only, brief.resources)))
    return brief if options.grid else msgspec.structs.replace(brief, cells=())


def shown_observation(observation: Observation, brief: Brief, options: ReactOptions) -> Observation:
    """The observation without what is switched off; `brief` is the one that is shown."""
    if not options.second_view:
        mounts = {resource.id: {camera.name for camera in resource.cameras} for resource in brief.resources}
        pictures = tuple(picture for picture in observation.pictures if _shown(picture, mounts))
        observation = replace(observation, pictures=pictures)
    return observation if options.grid else replace(observation, cells=())


def _top_view_only(resource: Resource) -> Resource:
    down = tuple(camera for camera in resource.cameras if camera.view == "nadir")
    return msgspec.structs.replace(resource, cameras=down) if down else resource


def _shown(picture: Picture, mounts: dict[str, set[str]]) -> bool:
    """Whether the picture is a reference, somebody else's, or from a camera that is left."""
    if picture.camera == REFERENCE or picture.entity not in mounts:
        return True
    return picture.camera in mounts[picture.entity]
