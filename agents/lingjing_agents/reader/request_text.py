"""The brief, the observation and the inbox in the texts and pictures of a request of `react`.

They are read from what a model receives, and from nothing else. What a request does not say keeps a default.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from typing import Any, Literal

import numpy as np

from lingjing.decoding import converted
from lingjing.plugins.geometry import camera_axes, focal_px, world_to_pixel
from lingjing.plugins.policy import (
    REFERENCE,
    ArgumentSpec,
    Brief,
    CameraPose,
    CameraSpec,
    Cell,
    CellView,
    Datum,
    EntityView,
    Envelope,
    EventView,
    Field,
    Inbox,
    LimitSpec,
    MessageSpec,
    Observation,
    Peer,
    Picture,
    Receipt,
    Region,
    Resource,
    VerbMotion,
    VerbSpec,
    Weather,
)
from lingjing_agents.perception.images import opencv

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

_CLAIMS = re.compile(r"^\*(\w+)\*: all agents together may make (\d+) claims")
"""A rule that limits claims, with the limit's name and number."""

_MOTIONS: tuple[tuple[str, VerbMotion], ...] = (
    ("to the place", "straight"),
    ("^turns", "turn"),
    ("^rises", "up"),
    ("^sinks", "down"),
    ("^moves", "step"),
)
"""The motion of a verb, by a pattern of its meaning; the first one that fits counts."""

_Category = Literal["report", "assignment", "target_status", "other"]

_VIEWS: Mapping[str, Literal["nadir", "front", "oblique"]] = {
    "straight down": "nadir",
    "ahead": "front",
    "ahead and down": "oblique",
}
"""The view of a camera, by the words for its direction."""

FieldType = Literal["name", "text", "number", "flag", "position", "box", "frame", "names"]

_TYPES: tuple[tuple[str, FieldType], ...] = (
    ("[east, north]", "position"), ("[x_min", "box"), ("id of a picture", "frame"), ("true or false", "flag"),
    ("a number", "number"), ("a list", "names"), ("a text", "text"),
)  # fmt: skip


def agent_in(system: str) -> str:
    """Return the agent that a system text addresses."""
    return _matched(r"You are `([^`]+)`", system)[1]


def _matched(pattern: str, text: str) -> re.Match[str]:
    """Return the first match. Raises `ValueError` for a text that is no request of `react`."""
    match = re.search(pattern, text)
    if match is None:
        raise ValueError(f"no request of `react`: nothing like {pattern!r} in {text[:200]!r}")
    return match


CORE, TREE_CORE = 0.6, 0.3
"""Share of the side of a part of a depth table within which its depth holds, and that of a single near part. Chosen."""

LOWEST_M = 0.5
"""Height in metres of a block, at least: tops are whole metres, and a car of 0.45 m would lie on the ground."""

CROWN_M, TREE_M = 10.0, 2.2
"""Longest side of a crown, and height from which on a small block is a tree, in metres: a dog walks under its crown,
and `TREE_CORE` of its sides stands in the way. Chosen."""

BELOW_CROWN_M = 3.0
"""Assumed height of a crown's rim in metres: a dog passes below it, unless a car stands there. Chosen."""

POST_M = 4.0
"""Assumed height of a post in metres. Chosen."""

NEARER_M = 1.0
"""Difference of depth in metres from which on a part is nearer than another one. Depths are whole metres."""


# -- the brief


def brief_from(system: str) -> Brief:
    """Return the brief in a system text."""
    head = _matched(r"You are `([^`]+)`, (\w+) in a mission of (\d+) ticks of ([\d.]+) s", system)
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
        rules=tuple(_rules(system)),
        limits=tuple(_limits(system)),
    )


def _limits(system: str) -> Iterator[LimitSpec]:
    """Yield the limits of claims that the rules name."""
    for rule in _rules(system):
        if match := _CLAIMS.search(rule):
            limit = {"name": match[1], "most": int(match[2]), "counts": [{"kind": "claims"}]}
            yield converted(limit, LimitSpec)


def _rules(system: str) -> Iterator[str]:
    """Yield the rules of the mission, without the list's marks. P0 has none."""
    if "\nRULES OF THIS MISSION" in system:
        lines = system.split("\nRULES OF THIS MISSION", 1)[1].split("\n\n", 1)[0].splitlines()
        yield from (line.removeprefix("- ").removesuffix(".") for line in lines[1:])


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
        name, kind, more = _matched(r"^([^`]+)`: (\w+), (.*)", head).groups()
        properties: dict[str, Datum] = {key: float(value) for key, value in re.findall(r"(\w+) (-?[\d.e+]+)[,)]", more)}
        cameras = tuple(_camera(line) for line in lines if line.startswith("  camera"))
        verbs = tuple(_verbs([line for line in lines if not line.startswith("  camera")]))
        resources.append(
            Resource(
                id=name, type=kind, embodied=more.startswith("yours"), verbs=verbs, cameras=cameras,
                properties=properties,
            )
        )  # fmt: skip
    return resources


def _camera(line: str) -> CameraSpec:
    name, looks, width, height, wide = _matched(
        r"^  camera `(\w+)`: looks (.+), (\d+)x(\d+) px, ([\d.]+) degrees wide", line
    ).groups()
    capture: Literal["each_tick", "on_request"] = "each_tick" if "at every tick" in line else "on_request"
    return CameraSpec(
        name=name, view=_VIEWS[looks], width=int(width), height=int(height), hfov_deg=float(wide),
        channels=("rgb", "depth") if "with depth" in line else ("rgb",), capture=capture,
    )  # fmt: skip


def _verbs(lines: list[str]) -> Iterator[VerbSpec]:
    """Yield the verbs of a resource. A body that turns at junctions goes to a place along roads."""
    on_roads = any("junction" in line for line in lines)
    for line in lines:
        name, inside, meaning = _matched(r"  (\w+)\((.*?)\): (.*)", line).groups()
        motion: VerbMotion = next((motion for words, motion in _MOTIONS if re.search(words, meaning)), "")
        if motion == "straight" and on_roads:
            motion = "route"
        yield VerbSpec(name=name, arguments=tuple(_arguments(inside)), doc=meaning, motion=motion)


def _arguments(inside: str) -> Iterator[ArgumentSpec]:
    """Yield the arguments between the brackets of a verb."""
    for name, bounds, omitted in re.findall(
        r"(\w+):((?: -?[\d.]+ to -?[\d.]+)?(?: [a-z/|_]+)?)((?:, [^:,]+ left out)?)", inside
    ):
        span = re.search(r"(-?[\d.]+) to (-?[\d.]+)", bounds)
        default = re.search(r"(-?[\d.]+) if left out", omitted)
        unit = "name" if "|" in bounds or name == "camera" else "deg" if "degrees" in bounds else "m"
        yield ArgumentSpec(
            name=name,
            unit=unit,
            minimum=float(span[1]) if span else None,
            maximum=float(span[2]) if span else None,
            default=float(default[1]) if default else None,
            optional="left out" in omitted,
        )


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
            MessageSpec(
                kind=match[1],
                type=record,
                category=converted(match[2], _Category),
                fields=fields,
                senders=(role,),
                recipients=to,
            )
        )
    return messages


def _all_messages(system: str, role: str, known: dict[str, Any]) -> list[MessageSpec]:
    """Return the kinds that the agent may send, then those of others; a shared kind appears once."""
    by_kind = {message.kind: message for message in _messages(_section(system, "YOU MAY SEND"), role, known)}
    roles = {item["id"]: item["role"] for item in known.get("agents", ())}
    for line in _section(system, "YOU MAY RECEIVE").splitlines() if "YOU MAY RECEIVE\n" in system else ():
        kind, category, senders, names = _matched(r"^- (\w+) \((\w+)\) from ([^:]+): (.*)", line).groups()
        fields = tuple(
            Field(name=name.rstrip("?"), type="name", optional=name.endswith("?")) for name in names.split(", ")
        )
        record = next((name for needs, name, _ in _RECORDS if needs <= {field.name for field in fields}), "note")
        own = by_kind.get(kind)
        others = tuple(dict.fromkeys(roles[name] for name in senders.split(", ")))
        reached = tuple(dict.fromkeys((*(own.recipients if own else ()), role)))
        by_kind[kind] = MessageSpec(
            kind=kind, type=record, category=converted(category, _Category), fields=own.fields if own else fields,
            senders=(*(own.senders if own else ()), *others), recipients=reached,
        )  # fmt: skip
    return list(by_kind.values())


def _field(text: str) -> Field:
    name, optional, holds = _matched(r"^(\w+)( \(may be left out\))?: (.*)", text).groups()
    kind: FieldType = next((kind for words, kind in _TYPES if words in holds), "name")
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
            EventView(id=f"e{state['tick']}-{number}", kind=event["kind"], tick=event["tick"], entities=names)
            for number, event in enumerate(state.get("events", ()))
            for names in (tuple(event["entities"]),)
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
    cv2 = opencv()
    bgr = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)
    width, height = described["size_px"]
    if bgr is None or bgr.shape[:2] != (height, width):
        raise ValueError(f"the image of {described['frame']} is not of its size_px")
    rgb = np.ascontiguousarray(bgr[:, :, ::-1]).astype(np.uint8, copy=False)
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
        rgb=rgb, depth=depth_from(described, pose),
    )  # fmt: skip


def depth_from(described: dict[str, Any], pose: CameraPose) -> np.ndarray | None:
    """Return the depth image (height, width; m) of the parts in a description; None without them.

    A part states the depth of its middle. Its rim has the greatest depth of the picture, that of open ground: else the
    gaps between houses, often narrower than a part, would close. A single near part is a tree, and has a wider rim.
    """
    if "standing" in described:
        return _depth_of_standing(described["standing"], pose)
    if "depth_m" not in described:
        return None
    width, height = pose.width, pose.height
    parts = np.array(
        [[np.inf if depth is None else depth for depth in row] for row in described["depth_m"]], np.float32
    )
    places = [(np.arange(size) + 0.5) * parts.shape[axis] / size for axis, size in ((0, height), (1, width))]
    rows, columns = (place.astype(np.int64) for place in places)
    whole: np.ndarray = parts[np.ix_(rows, columns)]
    rim = np.maximum(*(np.abs(place % 1.0 - 0.5) for place in np.meshgrid(*places, indexing="ij")))
    core = np.where(_single(parts), TREE_CORE, CORE)[np.ix_(rows, columns)]
    return np.where(rim < core / 2.0, whole, whole.max())


def _depth_of_standing(described: dict[str, Any], pose: CameraPose) -> np.ndarray:
    """Return the depth image (height, width; m) of level ground with blocks on it, seen by a camera above."""
    ground_m = described["ground"]
    depth = _plane_depth(pose, ground_m)
    posts = [(x, y, x + 1, y + 1, ground_m + POST_M) for x, y in described.get("posts_east_north_m", ())]
    blocks = [*posts, *described["west_south_east_north_top_m"]]
    for west, south, east, north, top in sorted(blocks, key=lambda block: block[4]):
        elevation = max(float(top), ground_m + LOWEST_M)
        if max(east - west, north - south) > CROWN_M or elevation <= ground_m + TREE_M:
            _paint(depth, pose, (west, south, east, north), elevation)
            continue
        _paint(depth, pose, (west, south, east, north), min(elevation, ground_m + BELOW_CROWN_M))
        x, y, wide, deep = (
            (west + east) / 2.0,
            (south + north) / 2.0,
            TREE_CORE * (east - west),
            TREE_CORE * (north - south),
        )
        _paint(depth, pose, (x - wide / 2.0, y - deep / 2.0, x + wide / 2.0, y + deep / 2.0), elevation)
    return depth


def _paint(depth: np.ndarray, pose: CameraPose, sides: tuple[float, float, float, float], elevation_m: float) -> None:
    """Draw the top of a block into a depth image; `sides` are west, south, east and north."""
    west, south, east, north = sides
    corners = ((west, south), (east, south), (east, north), (west, north))
    pixels = [world_to_pixel(pose, (x, y, elevation_m)) for x, y in corners]
    if any(pixel is None for pixel in pixels):
        return
    outline = np.array([pixel[:2] for pixel in pixels if pixel]).round().astype(np.int32)
    (left, top), (right, bottom) = np.maximum((outline.min(axis=0), outline.max(axis=0) + 1), 0)
    part = depth[top:bottom, left:right]
    if part.size:
        mask = np.zeros(part.shape, np.uint8)
        opencv().fillConvexPoly(mask, outline - (left, top), 1)
        shown = _plane_depth(pose, elevation_m, (slice(left, right), slice(top, bottom)))
        part[mask > 0] = shown[mask > 0]


def _plane_depth(
    pose: CameraPose, elevation_m: float, part: tuple[slice, slice] = (slice(None), slice(None))
) -> np.ndarray:
    """Return the depth image (height, width; m) of a horizontal plane, or a part of it (columns, rows); infinite where
    a pixel does not show the plane."""
    right, down, forward = camera_axes(pose)
    focal = focal_px(pose)
    u = ((np.arange(pose.width) + 0.5 - pose.width / 2.0) / focal)[part[0]]
    v = ((np.arange(pose.height) + 0.5 - pose.height / 2.0) / focal)[part[1]]
    fall = forward[2] + u[None, :] * right[2] + v[:, None] * down[2]  # of the ray, for each metre of depth
    below: np.ndarray = np.where(fall < -1e-3, (elevation_m - pose.position[2]) / np.minimum(fall, -1e-3), np.inf)
    return below


def _single(parts: np.ndarray) -> np.ndarray:
    """Return True for the parts of a depth table that are nearer than all four neighbours."""
    around = np.pad(parts, 1, constant_values=np.inf)
    beside = (around[:-2, 1:-1], around[2:, 1:-1], around[1:-1, :-2], around[1:-1, 2:])
    nearest: np.ndarray = np.minimum.reduce(beside)
    return nearest > parts + NEARER_M


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
