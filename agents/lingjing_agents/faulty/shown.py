"""What a fault of perception changes in what an agent is shown."""

from __future__ import annotations

from dataclasses import replace

import msgspec
import numpy as np

from lingjing.plugins.policy import REFERENCE, FrameInfo, Observation, Picture, Privileged
from lingjing_agents.faulty.options import PlantedFault


def changed_observation(fault: PlantedFault, observation: Observation) -> Observation:
    """The observation in which no picture shows a target, for a fault of perception; else the same.

    Pictures are of one colour, the mean of their own; depth and classes, with which bodies keep clear of obstacles, are
    left. A privileged policy reads no boxes.
    """
    if fault.faculty != "perception":
        return observation
    pictures = tuple(one if one.camera == REFERENCE else _plain(one) for one in observation.pictures)
    known = observation.privileged
    return replace(observation, pictures=pictures, privileged=None if known is None else _without_boxes(known))


def _plain(picture: Picture) -> Picture:
    colour = picture.rgb.reshape(-1, 3).mean(axis=0).astype(np.uint8)
    return replace(picture, rgb=np.broadcast_to(colour, picture.rgb.shape).copy(), jpeg=b"")


def _without_boxes(known: Privileged) -> Privileged:
    def emptied(frame: FrameInfo) -> FrameInfo:
        return msgspec.structs.replace(frame, boxes=())

    return msgspec.structs.replace(known, frames=tuple(map(emptied, known.frames)))
