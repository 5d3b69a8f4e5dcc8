"""Topic names of a trace.

Brackets in entity ids become underscores (`/geo/uav_1`), because Foxglove's message paths parse brackets as slices.
"""

from __future__ import annotations

from lingjing.trace.records import FrameInfo

HEADER = "/lingjing/header"
BOUNDARY = "/lingjing/boundary"
FRAME = "/lingjing/frame"
OUTCOME = "/lingjing/outcome"
ENGINE_FRAME = "/lingjing/engine_frame"
CAMERAS = "/camera/"
"""Prefix of the topics of all cameras."""
SCORE = "/score"
SCENE = "/scene"
"""The part of the mission's map that policies may know. Written once."""
HIDDEN = "/scene/hidden"
"""The part of the mission's map that is hidden from policies. Written once."""
CITY = "/scene/city"
"""The meshes of the city. Written once."""
TRANSFORMS = "/tf"
RECORDS = "/lingjing/"
"""Prefix of the topics of the project's own records."""


CHANNELS = ("depth", "semantic", "instance")
"""The channels of a picture beside its colours."""


def entity_topic(entity: str) -> str:
    """Return an entity id in the form for topics: `uav_1` for `uav[1]`."""
    return entity.replace("[", "_").replace("]", "")


def agent_topic(agent: str, channel: str) -> str:
    """Return `/agent/<agent>/<channel>`. `channel` is `thought`, `command` or `receipt`."""
    return f"/agent/{entity_topic(agent)}/{channel}"


def camera_topic(frame: FrameInfo, channel: str = "") -> str:
    """Return `/camera/<entity>/<camera>` for the colour picture (""), or the topic of another channel below it.

    Other channels are those of `CHANNELS`, `truth`, `reported` and `calibration`.
    """
    topic = f"{CAMERAS}{entity_topic(frame.entity)}/{frame.camera}"
    return f"{topic}/{channel}" if channel else topic
