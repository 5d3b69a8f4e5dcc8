"""A "model" that plays from the text of its requests alone.

It parses a request into a brief, an observation and an inbox, runs the rules of `heuristic` on them, and answers in
JSON. An episode that it wins shows that the requests contain enough information.
"""

from __future__ import annotations

import base64
import json
import re
from typing import Any

import cv2
import numpy as np
from lingjing_agents.heuristic.policy import HeuristicPolicy

from agents.tests.agent_kit import verb
from agents.tests.chat_server import Reply
from lingjing.plugins.policy import (
    REFERENCE,
    ArgumentSpec,
    Brief,
    CameraPose,
    CameraSpec,
    Cell,
    CellView,
    Decision,
    EntityView,
    Envelope,
    EventView,
    Field,
    Inbox,
    MessageSpec,
    Observation,
    Peer,
    Picture,
    Receipt,
    Region,
    Resource,
    VerbSpec,
    Weather,
)

_RECORDS = (
    ({"frame", "class", "box"}, "report", "report"),
    ({"assignee", "stops"}, "tour", "assignment"),
    ({"assignee", "step"}, "guidance", "assignment"),
    ({"assignee", "task"}, "assignment", "assignment"),
    ({"waypoint", "position"}, "trafficJam", "target_status"),
    ({"stop", "delivered"}, "delivery", "target_status"),
    ({"task", "state"}, "status", "target_status"),
)
"""The record and the category of a message, by its fields."""

_TYPES = (
    ("[east, north]", "position"), ("[x_min", "box"), ("id of a picture", "frame"), ("true or false", "flag"),
    ("a number", "number"), ("a list", "names"), ("a text", "text"),
)  # fmt: skip


class ReadingModel:
    """A "model" with one heuristic policy for each agent that sends requests."""

    def __init__(self) -> None:
        self._minds: dict[str, tuple[HeuristicPolicy, Brief]] = {}
        self._references: dict[str, tuple[Picture, ...]] = {}

    def __call__(self, request: dict[str, Any]) -> Reply:
        turns = request["messages"]
        system = turns[0]["content"]
        state, images = _last_state(turns)
        agent = re.search(r"You are `([^`]+)`", system)[1]  # type: ignore[index]
        if agent not in self._minds:
            mind, brief = HeuristicPolicy(), brief_from(system)
            _run(mind.reset(brief))
            self._minds[agent] = mind, brief
        mind, brief = self._minds[agent]
        decision = _run(mind.act(observation_from(state, images, brief), inbox_from(state, brief)))
        return Reply(_answer(decision))


def _run(coroutine: Any) -> Any:
    """Return the result of a coroutine that never waits."""
    try:
        coroutine.send(None)
    except StopIteration as ended:
        return ended.value
    raise AssertionError("the heuristic waits for something")


def _last_state(turns: list[dict[str, Any]]) -> tuple[dict[str, Any], list[bytes]]:
    content = turns[-1]["content"]
    if isinstance(content, str):
        assert content.startswith("{"), content  # a complaint about an answer
        return json.loads(content), []
    urls = [part["image_url"]["url"] for part in content[1:]]
    return json.loads(content[0]["text"]), [base64.b64decode(url.split(",", 1)[1]) for url in urls]


def _answer(decision: Decision) -> dict[str, Any]:
    command = decision.command
    return {
        "thought": decision.thought,
        "command": None
        if command is None
        else {"resource": command.resource, "verb": command.verb, "arguments": dict(command.arguments)},
        "messages": [
            {"kind": message.kind, "body": dict(message.body), "to": list(message.to)} for message in decision.messages
        ],
    }


# -- the brief


def brief_from(system: str) -> Brief:
    """Return the brief in a system text."""
    head = re.search(r"You are `([^`]+)`, (\w+) in a mission of (\d+) ticks of ([\d.]+) s", system)
    assert head is not None
    known = json.loads(_section(system, "KNOWN FROM THE START").splitlines()[0])
    speech = _section(system, "YOU MAY SEND")
    hub = re.search(r"Every message goes to `([^`]+)`", speech)
    mode = "single" if not known.get("agents") else "star" if hub or "You are the hub" in speech else "broadcast"
    index = re.search(r"\[(\d+)\]$", head[1])
    return Brief(
        agent=head[1],
        role=head[2],
        index=int(index[1]) if index else 0,
        goal="",
        prompt="",
        mode=mode,
        hub=hub[1] if hub else head[1] if "You are the hub" in speech else None,
        tick_s=float(head[4]),
        ticks=int(head[3]),
        seed=0,
        resources=tuple(_resources(_section(system, "YOU MAY COMMAND"))),
        peers=tuple(
            Peer(id=peer["id"], role=peer["role"], resources=tuple(peer["resources"]))
            for peer in known.get("agents", ())
        ),
        messages=tuple(_all_messages(system, head[2], known)),
        regions=tuple(
            Region(name=name, polygon=tuple((x, y) for x, y in corners))
            for name, corners in known.get("regions_east_north_m", {}).items()
        ),
        cells=tuple(map(_cell, known.get("cells", ()))),
        classes=tuple(known["classes"]),
        weather=Weather(**known["weather"]),
        water_level_m=known["water_level_m"],
        settings=known.get("settings", {}),
    )


def _section(system: str, head: str) -> str:
    return system.split(f"{head}\n", 1)[1].split("\n\n", 1)[0]


def _cell(described: dict[str, Any]) -> Cell:
    (west, east), (south, north) = described["east_m"], described["north_m"]
    grid, row, column = described["name"].rsplit("-", 2)
    return Cell(
        name=described["name"], grid=grid, row=int(row), column=int(column), centre=tuple(described["centre_m"]),
        polygon=((west, south), (east, south), (east, north), (west, north)),
    )  # fmt: skip


def _resources(section: str) -> list[Resource]:
    resources = []
    for block in re.split(r"^- `", section, flags=re.MULTILINE)[1:]:
        head, *lines = block.splitlines()
        name, kind, more = re.match(r"([^`]+)`: (\w+), (.*)", head).groups()  # type: ignore[union-attr]
        properties = {key: float(value) for key, value in re.findall(r"(\w+) (-?[\d.e+]+)[,)]", more)}
        cameras = tuple(_camera(line) for line in lines if line.startswith("  camera"))
        verbs = tuple(_verb(line) for line in lines if not line.startswith("  camera"))
        resources.append(
            Resource(
                id=name, type=kind, embodied=more.startswith("yours"), verbs=verbs, cameras=cameras,
                properties=properties,
            )
        )  # fmt: skip
    return resources


def _camera(line: str) -> CameraSpec:
    name, looks, width, height, wide = re.match(  # type: ignore[union-attr]
        r"  camera `(\w+)`: looks (.+), (\d+)x(\d+) px, ([\d.]+) degrees wide", line
    ).groups()
    view = {"straight down": "nadir", "ahead": "front", "ahead and down": "oblique"}[looks]
    capture = "each_tick" if "at every tick" in line else "on_request"
    return CameraSpec(
        name=name, view=view, width=int(width), height=int(height), hfov_deg=float(wide), channels=("rgb",),
        capture=capture,
    )  # fmt: skip


def _verb(line: str) -> VerbSpec:
    name, inside = re.match(r"  (\w+)\((.*?)\):", line).groups()  # type: ignore[union-attr]
    arguments = []
    for match in re.findall(r"(\w+):((?: -?[\d.]+ to -?[\d.]+)?(?: [a-z/|_]+)?)((?:, [^:,]+ left out)?)", inside):
        bounds = re.search(r"(-?[\d.]+) to (-?[\d.]+)", match[1])
        default = re.search(r"(-?[\d.]+) if left out", match[2])
        unit = "name" if "|" in match[1] or match[0] == "camera" else "deg" if "degrees" in match[1] else "m"
        arguments.append(
            ArgumentSpec(
                name=match[0], unit=unit, minimum=float(bounds[1]) if bounds else None,
                maximum=float(bounds[2]) if bounds else None, default=float(default[1]) if default else None,
                optional="may be left out" in match[2],
            )
        )  # fmt: skip
    return verb(name, *arguments)


def _messages(section: str, role: str, known: dict[str, Any]) -> list[MessageSpec]:
    roles = {item["id"]: item["role"] for item in known.get("agents", ())}
    messages = []
    for line in section.splitlines():
        match = re.match(r"- (\w+) \((\w+)\): \{(.*)\}(?:; `to`: some of (.*))?", line)
        if match is None:
            continue
        fields = tuple(_field(item) for item in re.split(r"; (?=\w+(?: \(may be left out\))?: )", match[3]))
        record = next((name for needs, name, _ in _RECORDS if needs <= {field.name for field in fields}), "note")
        to = tuple(dict.fromkeys(roles[name] for name in match[4].split(", "))) if match[4] else ("all",)
        messages.append(
            MessageSpec(kind=match[1], type=record, category=match[2], fields=fields, senders=(role,), recipients=to)
        )
    return messages


def _all_messages(system: str, role: str, known: dict[str, Any]) -> list[MessageSpec]:
    """Return the kinds that the agent may send, then those of others; a shared kind appears once."""
    by_kind = {message.kind: message for message in _messages(_section(system, "YOU MAY SEND"), role, known)}
    for line in _section(system, "OTHERS MAY SEND").splitlines() if "OTHERS MAY SEND\n" in system else ():
        kind, category, senders, to, names = re.match(  # type: ignore[union-attr]
            r"- (\w+) \((\w+)\) from (.+) to (.+): (.*)", line
        ).groups()
        fields = tuple(
            Field(name=name.rstrip("?"), type="name", optional=name.endswith("?")) for name in names.split(", ")
        )
        record = next((name for needs, name, _ in _RECORDS if needs <= {field.name for field in fields}), "note")
        own = by_kind.get(kind)
        others = tuple(senders.split(", "))
        by_kind[kind] = MessageSpec(
            kind=kind, type=record, category=category, fields=own.fields if own else fields,
            senders=(*(own.senders if own else ()), *others), recipients=tuple(to.split(", ")),
        )  # fmt: skip
    return list(by_kind.values())


def _field(text: str) -> Field:
    name, optional, holds = re.match(r"(\w+)( \(may be left out\))?: (.*)", text).groups()  # type: ignore[union-attr]
    kind = next((kind for words, kind in _TYPES if words in holds), "name")
    low, high = (re.search(rf"at {word} (-?[\d.]+)", holds) for word in ("least", "most"))
    return Field(
        name=name, type=kind, optional=bool(optional), minimum=float(low[1]) if low else None,
        maximum=float(high[1]) if high else None, unit="kg" if holds.endswith(", kg") else "",
    )  # fmt: skip


# -- a boundary


def observation_from(state: dict[str, Any], images: list[bytes], brief: Brief) -> Observation:
    """Return the observation in a state, with the accompanying pictures."""
    searched = state.get("cells_searched", {})
    cells = [CellView(name=name, visited_tick=item["tick"], visited_by=item["by"]) for name, item in searched.items()]
    cells += [CellView(name=name) for name in state.get("cells_unsearched", ())]
    order = {cell.name: number for number, cell in enumerate(brief.cells)}
    pictures = [_picture(described, data) for described, data in zip(state.get("pictures", ()), images, strict=True)]
    if state["tick"] > 0:  # the contract shows reference pictures once
        pictures = [item for item in pictures if item.camera != REFERENCE]
    return Observation(
        agent=brief.agent,
        tick=state["tick"],
        time_s=state["time_s"],
        entities=tuple(map(_entity, state.get("entities", ()))),
        cells=tuple(sorted(cells, key=lambda cell: order[cell.name])),
        events=tuple(
            EventView(id=f"e{number}", kind=item["kind"], tick=item["tick"], entities=tuple(item["entities"]))
            for number, item in enumerate(state.get("events", ()))
        ),
        pictures=tuple(pictures),
        weather=Weather(**state["weather"]) if "weather" in state else brief.weather,
    )


def _entity(described: dict[str, Any]) -> EntityView:
    route = described.get("route")
    moving = described.get("velocity_east_north_up_mps", [0.0, 0.0, 0.0])
    return EntityView(
        id=described["id"],
        type=described.get("type", ""),
        position=tuple(described["position"]) if "position" in described else None,
        velocity=tuple(moving) if "heading_deg" in described else None,
        heading_deg=described.get("heading_deg"),
        status=described.get("status"),
        resources=described.get("resources"),
        busy=described.get("busy"),
        route=tuple(tuple(point["position"]) for point in route) if route else None,
    )


def _picture(described: dict[str, Any], data: bytes) -> Picture:
    rgb = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)[:, :, ::-1]
    width, height = described["size_px"]
    assert rgb.shape[:2] == (height, width)
    if described.get("reference"):
        pose = CameraPose(
            position=(0.0, 0.0, 0.0), heading_deg=0.0, tilt_deg=0.0, hfov_deg=75.0, width=width, height=height
        )
        return Picture(frame=described["frame"], entity="", camera=REFERENCE, tick=0, time_s=0.0, pose=pose, rgb=rgb)
    entity, camera = described["camera"].split("/")
    pose = CameraPose(
        position=tuple(described["camera_position"]), heading_deg=described["heading_deg"],
        tilt_deg=described["tilt_deg"], roll_deg=described["roll_deg"],
        hfov_deg=described["field_of_view_deg"], width=width, height=height,
    )  # fmt: skip
    return Picture(
        frame=described["frame"], entity=entity, camera=camera, tick=described["tick"], time_s=0.0, pose=pose,
        rgb=np.ascontiguousarray(rgb),
    )  # fmt: skip


def inbox_from(state: dict[str, Any], brief: Brief) -> Inbox:
    """Return the inbox in a state."""
    notes = []
    for number, item in enumerate(state.get("received", ())):
        fields = set(item["body"])
        category = next((category for needs, _, category in _RECORDS if needs <= fields), "other")
        body = {name: tuple(value) if isinstance(value, list) else value for name, value in item["body"].items()}
        notes.append(
            Envelope(
                id=f"m{state['tick']}-{number}", tick=item["sent_at_tick"] + 1, sender=item["from"],
                recipient=brief.agent, kind=item["kind"], category=category, body=body, bytes=1,
                deliver_at=state["tick"],
            )
        )  # fmt: skip
    receipts = [
        Receipt(
            request=item["request"], tick=state["tick"], sender=brief.agent if item["from"] == "you" else item["from"],
            resource=item.get("resource", item.get("message", "")), status=item["status"],
            reason=item.get("reason", ""), detail=item.get("detail", ""),
        )
        for item in state.get("receipts", ())
    ]  # fmt: skip
    return Inbox(messages=tuple(notes), receipts=tuple(receipts))
