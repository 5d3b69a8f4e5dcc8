"""A layout for Foxglove: the city, each camera with its boxes, the score, the agents' commands, a log and a map.

The format is that of Foxglove's "Export layout" (`configById` and a tree of splits). "Import from file" reads it.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence

from lingjing.mission.instance import Entity, Instance
from lingjing.scene.surroundings import OVERHEAD_M
from lingjing.trace.topics import CITY, HIDDEN, SCENE, SCORE, agent_topic, entity_topic

MOST_CAMERAS = 8
MOST_AGENTS = 8
"""Most cameras and agents with panels. Chosen: more tabs do not fit."""

LayoutValue = bool | int | float | str | None | Sequence["LayoutValue"] | Mapping[str, "LayoutValue"]
"""A JSON value."""


def foxglove_layout(instance: Instance, *, truth: bool) -> str:
    """Return the layout as JSON. Without `truth`, hidden targets and true boxes are switched off.

    The trace contains them all the same, so a user can switch them on.
    """
    panels: dict[str, LayoutValue] = {
        "3D!world": _world(instance, truth=truth),
        "Plot!score": _plot(("score", "score"), ("scr", "subtask completion rate")),
        "RosOut!log": {"topicToRender": "/log", "minLogLevel": 1, "searchTerms": []},
        "map!map": {"center": _centre(instance), "zoomLevel": 14, "disabledTopics": []},
    }
    cameras = _cameras(instance)
    for topic in cameras:
        panels[f"Image!{topic}"] = _image(topic, truth=truth)
    agents = [agent.id for agent in instance.agents[:MOST_AGENTS]]
    for agent in agents:
        panels[f"RawMessages!{agent}"] = {"topicPath": agent_topic(agent, "thought"), "diffEnabled": False}
    if agents:
        panels["StateTransitions!receipts"] = {
            "isSynced": True,
            "paths": [
                {"value": f"{agent_topic(agent, 'receipt')}.status", "label": agent, "timestampMethod": "receiveTime"}
                for agent in agents
            ],
        }
    tabs = {
        "Tab!pictures": [(topic, f"Image!{topic}") for topic in cameras],
        "Tab!agents": [(agent, f"RawMessages!{agent}") for agent in agents],
    }
    for name, members in tabs.items():
        if members:
            panels[name] = {
                "activeTabIdx": 0,
                "tabs": [{"title": title.removeprefix("/camera/"), "layout": panel} for title, panel in members],
            }
    right = _stack([name for name in ("Tab!pictures", "Tab!agents", "map!map") if name in panels], "column")
    below = _stack(
        [name for name in ("Plot!score", "StateTransitions!receipts", "RosOut!log") if name in panels], "row"
    )
    main = {"first": "3D!world", "second": right, "direction": "row", "splitPercentage": 60}
    layout = {
        "configById": panels,
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 5},
        "layout": {"first": main, "second": below, "direction": "column", "splitPercentage": 72},
    }
    return json.dumps(layout, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def _stack(panels: Sequence[str], direction: str) -> LayoutValue:
    """Return a tree of splits with panels of equal size side by side."""
    if len(panels) == 1:
        return panels[0]
    return {
        "first": panels[0],
        "second": _stack(panels[1:], direction),
        "direction": direction,
        "splitPercentage": 100 / len(panels),
    }


def _world(instance: Instance, *, truth: bool) -> LayoutValue:
    places = _places(instance)
    wide = max((math.dist(a, b) for a in places for b in places), default=0.0)
    east, north = _middle(places)
    shown = [entity.id for entity in instance.entities if truth or "position" not in entity.hidden]
    return {
        "cameraState": {
            "perspective": True, "distance": max(150.0, 1.1 * wide), "phi": 50, "thetaOffset": 0, "fovy": 45,
            "near": 0.5, "far": 50000, "target": [east, north, 0], "targetOffset": [0, 0, 0],
            "targetOrientation": [0, 0, 0, 1],
        },
        "followMode": "follow-none",
        "followTf": "world",
        "scene": {"transforms": {"showLabel": False, "axisScale": 0}},
        "transforms": {f"frame:{entity.id}": {"visible": entity.id in shown} for entity in instance.entities},
        "topics": {
            SCENE: {"visible": True}, CITY: {"visible": True}, HIDDEN: {"visible": truth},
        },
        "layers": {},
    }  # fmt: skip


def _image(topic: str, *, truth: bool) -> LayoutValue:
    return {
        "imageMode": {
            "imageTopic": topic,
            "calibrationTopic": f"{topic}/calibration",
            "annotations": {f"{topic}/truth": {"visible": truth}, f"{topic}/reported": {"visible": True}},
            "synchronize": False,
        },
    }


def _plot(*series: tuple[str, str]) -> LayoutValue:
    return {
        "paths": [
            {"value": f"{SCORE}.{field}", "label": label, "enabled": True, "timestampMethod": "receiveTime"}
            for field, label in series
        ],
        "minYValue": 0,
        "maxYValue": 1,
        "showLegend": True,
        "isSynced": True,
        "xAxisVal": "timestamp",
    }


def _cameras(instance: Instance) -> list[str]:
    """Return the picture topics of the first `MOST_CAMERAS` cameras on entities of agents."""
    commanded = {name for agent in instance.agents for name in agent.controls}
    topics = [
        f"/camera/{entity_topic(entity.id)}/{camera.name}"
        for entity in instance.entities
        if entity.id in commanded
        for camera in entity.cameras
    ]
    return topics[:MOST_CAMERAS]


def _places(instance: Instance) -> list[tuple[float, float]]:
    return [entity.position[:2] for entity in instance.entities if _stands_on_the_map(entity)][:200]


def _stands_on_the_map(entity: Entity) -> bool:
    return entity.role == "asset" and entity.position[2] < OVERHEAD_M


def _middle(places: Sequence[tuple[float, float]]) -> tuple[float, float]:
    xs, ys = [x for x, _ in places] or [0.0], [y for _, y in places] or [0.0]
    return (min(xs) + max(xs)) / 2, (min(ys) + max(ys)) / 2


def _centre(instance: Instance) -> LayoutValue:
    latitude, longitude = instance.scene.origin
    return {"lat": latitude, "lon": longitude}
