"""The names of a trace's topics.

Brackets of entity ids become underscores (`/geo/uav_1`), because Foxglove's message paths read brackets as slices.
"""

from __future__ import annotations

from lingjing.trace.records import FrameInfo

HEADER = "/lingjing/header"
BOUNDARY = "/lingjing/boundary"
FRAME = "/lingjing/frame"
OUTCOME = "/lingjing/outcome"
CAMERAS = "/camera/"
SCORE = "/score"
SCENE = "/scene"
HIDDEN = "/scene/hidden"
CITY = "/scene/city"
"""The mission's map, what of it is hidden from policies, and the city, each told once."""
TRANSFORMS = "/tf"
RECORDS = "/lingjing/"
"""What the topics of all own records begin with."""


def entity_topic(entity: str) -> str:
    """`uav[1]` as it stands in a topic: `uav_1`."""
    return entity.replace("[", "_").replace("]", "")


def agent_topic(agent: str, channel: str) -> str:
    """`/agent/<agent>/<channel>`: `thought`, `command`, `receipt`."""
    return f"/agent/{entity_topic(agent)}/{channel}"


def camera_topic(frame: FrameInfo, channel: str = "") -> str:
    """`/camera/<entity>/<camera>` for the colour picture; `depth`, `semantic`, `truth`, `reported` and `calibration`
    below it."""
    topic = f"{CAMERAS}{entity_topic(frame.entity)}/{frame.camera}"
    return f"{topic}/{channel}" if channel else topic
