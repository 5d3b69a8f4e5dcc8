"""The layout for Foxglove: its topics exist in the trace, and it shows the truth only on request."""

from __future__ import annotations

import json
from typing import Any

import mcap.reader
import msgspec

from lingjing import Trace
from lingjing.viewer.foxglove_layout import MOST_AGENTS, MOST_CAMERAS, foxglove_layout


def panels_of(layout: Any) -> list[str]:
    return [layout] if isinstance(layout, str) else [*panels_of(layout["first"]), *panels_of(layout["second"])]


def test_every_panel_is_placed_once_and_shows_a_topic_of_the_file(trace: Trace) -> None:
    made = json.loads(foxglove_layout(trace.header.instance, truth=True))
    placed = panels_of(made["layout"])
    tabs = [tab["layout"] for name in placed if name.startswith("Tab!") for tab in made["configById"][name]["tabs"]]
    assert sorted(placed + tabs) == sorted(made["configById"])
    with trace.path.open("rb") as file:
        summary = mcap.reader.make_reader(file).get_summary()
    assert summary is not None
    topics = {channel.topic for channel in summary.channels.values()}
    pictures = {name: panel["imageMode"] for name, panel in made["configById"].items() if name.startswith("Image!")}
    assert len(pictures) == 3
    for image in pictures.values():
        assert {image["imageTopic"], image["calibrationTopic"], *image["annotations"]} <= topics
    paths = [path["value"] for panel in made["configById"].values() for path in panel.get("paths", ())]
    assert {path.rpartition(".")[0] for path in paths} <= topics | {"/agent/skipper/receipt"}
    assert {panel["topicPath"] for panel in made["configById"].values() if "topicPath" in panel} <= topics


def test_hidden_entities_are_switched_off_without_the_truth(trace: Trace) -> None:
    for truth in (False, True):
        panels = json.loads(foxglove_layout(trace.header.instance, truth=truth))["configById"]
        world = panels["3D!world"]
        assert world["topics"]["/scene/hidden"]["visible"] is truth
        assert world["transforms"]["frame:victim[1]"]["visible"] is truth
        assert world["transforms"]["frame:boat"]["visible"] is True
        for name, panel in panels.items():
            if name.startswith("Image!"):
                shown = {
                    topic.rpartition("/")[2]: options["visible"]
                    for topic, options in panel["imageMode"]["annotations"].items()
                }
                assert shown == {"truth": truth, "reported": True}


def test_many_agents_and_no_agents_have_a_layout(trace: Trace) -> None:
    instance = trace.header.instance
    crowd = tuple(msgspec.structs.replace(instance.agents[0], id=f"scout[{n}]") for n in range(100))
    asset = next(item for item in instance.entities if item.cameras)
    many = msgspec.structs.replace(
        instance,
        agents=crowd,
        entities=tuple(msgspec.structs.replace(asset, id=f"uav[{n}]") for n in range(100)),
    )
    many = msgspec.structs.replace(
        many, agents=tuple(msgspec.structs.replace(item, controls=(f"uav[{n}]",)) for n, item in enumerate(crowd))
    )
    made = json.loads(foxglove_layout(many, truth=False))
    assert len([name for name in made["configById"] if name.startswith("Image!")]) == MOST_CAMERAS
    assert len([name for name in made["configById"] if name.startswith("RawMessages!")]) == MOST_AGENTS
    empty = msgspec.structs.replace(instance, agents=(), entities=(), regions=(), cells=())
    assert set(panels_of(json.loads(foxglove_layout(empty, truth=False))["layout"])) == {
        "3D!world", "map!map", "Plot!score", "RosOut!log",
    }  # fmt: skip
