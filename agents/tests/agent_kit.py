"""Briefs and observations for tests of the agents, made by hand: no mission, no engine."""

from __future__ import annotations

import msgspec
import numpy as np

from lingjing.mission.kinds import builtin_engines
from lingjing.mission.kinds_format import VerbKind
from lingjing.plugins.geometry import camera_pose
from lingjing.plugins.policy import (
    ArgumentSpec,
    Brief,
    CameraSpec,
    Cell,
    CellView,
    Datum,
    EntityView,
    Envelope,
    EventView,
    Field,
    Inbox,
    MessageSpec,
    Observation,
    Peer,
    Picture,
    Policy,
    Region,
    Resource,
    VerbSpec,
    Weather,
)
from lingjing.testing import PluginHost, build_policy


def react(**options: object) -> Policy:
    """Return a `react` policy, built as an episode builds it."""
    return build_policy(PluginHost().policy("react"), options)


WEST, SOUTH, EAST, NORTH = -123.7, -1090.0, 665.1, -752.0
WEATHER = Weather(wind_mps=4.0, wind_from_deg=220.0, current_mps=0.15, current_to_deg=60.0)
NADIR = CameraSpec(
    name="nadir", view="nadir", width=1920, height=1080, hfov_deg=84.0, channels=("rgb",), capture="on_request"
)
EYE = CameraSpec(
    name="front", view="front", width=1280, height=720, hfov_deg=90.0, channels=("rgb",), capture="on_request"
)
REPORT = MessageSpec(
    kind="detection",
    type="report",
    category="report",
    fields=(
        Field(name="frame", type="frame"),
        Field(name="class", type="name"),
        Field(name="box", type="box"),
        Field(name="position", type="position"),
        Field(name="confidence", type="number", minimum=0.0, maximum=1.0),
        Field(name="cell", type="name", optional=True),
        Field(name="hover", type="flag", optional=True),
    ),
    senders=("searcher",),
    recipients=("all",),
)
ASSIGNMENT = MessageSpec(
    kind="assignment",
    type="assignment",
    category="assignment",
    fields=(
        Field(name="assignee", type="name"),
        Field(name="task", type="name"),
        Field(name="cell", type="name", optional=True),
        Field(name="position", type="position", optional=True),
    ),
    senders=("coordinator", "searcher"),
    recipients=("all",),
)
STATUS = MessageSpec(
    kind="progress",
    type="status",
    category="target_status",
    fields=(
        Field(name="task", type="name"),
        Field(name="state", type="name"),
        Field(name="cell", type="name", optional=True),
        Field(name="position", type="position", optional=True),
    ),
    senders=("searcher", "rescuer", "coordinator"),
    recipients=("all",),
)

GUIDANCE = MessageSpec(
    kind="guide",
    type="guidance",
    category="assignment",
    fields=(
        Field(name="assignee", type="name"),
        Field(name="step", type="name"),
        Field(name="amount", type="number", optional=True),
        Field(name="position", type="position", optional=True),
    ),
    senders=("coordinator",),
    recipients=("all",),
)
JAM = MessageSpec(
    kind="jammed",
    type="trafficJam",
    category="target_status",
    fields=(
        Field(name="waypoint", type="number"),
        Field(name="position", type="position"),
        Field(name="confidence", type="number", optional=True),
    ),
    senders=("coordinator",),
    recipients=("all",),
)


def sent_by(message: MessageSpec, *senders: str, to: tuple[str, ...] = ("all",)) -> MessageSpec:
    """Return the same kind of message with other senders."""
    return msgspec.structs.replace(message, senders=senders, recipients=to)


def length(name: str, **more: float) -> ArgumentSpec:
    return ArgumentSpec(name=name, unit="m", **more)


def verb(name: str, *arguments: ArgumentSpec) -> VerbSpec:
    """Return a verb as declared by the built-in engine that has these arguments."""
    names = {argument.name for argument in arguments}
    above, turned = names & {"z", "distance", "altitude"}, "angle" in names
    engine = "multirotor" if above else "quadruped" if turned else "vessel" if name == "moveTo" else "road"
    kind = builtin_engines()[engine].verbs.get(name, VerbKind())
    return VerbSpec(name=name, arguments=arguments, doc=kind.doc, motion=kind.motion)


def quadrotor(index: int) -> Resource:
    return Resource(
        id=f"uav[{index}]",
        type="quadrotor",
        embodied=True,
        verbs=(
            verb("takeoff", ArgumentSpec(name="altitude", unit="m", optional=True)),
            verb("setDestination", length("x"), length("y"), length("z")),
            verb("forward", length("distance", minimum=0.0, maximum=50.0)),
            verb("stop"),
            verb("takePhoto", ArgumentSpec(name="camera", unit="name", optional=True)),
        ),
        cameras=(NADIR,),
        properties={"band_low_m": 20.0, "band_high_m": 160.0, "cruise_mps": 12.0},
    )


def dog(*, eyes: bool = True, shortest_m: float = 0.0, longest_m: float = 10.0) -> Resource:
    angle = ArgumentSpec(name="angle", unit="deg", minimum=0.0, maximum=90.0)
    verbs = [verb("forward", length("distance", minimum=shortest_m, maximum=longest_m)), verb("left", angle)]
    verbs += [verb("right", angle), verb("stop")]
    if eyes:
        verbs.append(verb("takePhoto", ArgumentSpec(name="camera", unit="name", optional=True)))
    return Resource(id="dog", type="robot_dog", embodied=True, verbs=tuple(verbs), cameras=(EYE,) if eyes else ())


def lifeboat(*, embodied: bool) -> Resource:
    return Resource(
        id="boat",
        type="lifeboat",
        embodied=embodied,
        verbs=(verb("moveTo", length("x"), length("y")),),
        properties={"speed_mps": 3.0},
    )


def grid(rows: int = 3, columns: int = 3, overlap: float = 0.2) -> tuple[Cell, ...]:
    wide, high = (EAST - WEST) / columns, (NORTH - SOUTH) / rows
    cells = []
    for row in range(rows):
        for column in range(columns):
            west, south = WEST + column * wide, SOUTH + row * high
            dx, dy = overlap * wide / 2, overlap * high / 2
            x0, x1 = max(WEST, west - dx), min(EAST, west + wide + dx)
            y0, y1 = max(SOUTH, south - dy), min(NORTH, south + high + dy)
            cells.append(
                Cell(
                    name=f"cells-{row + 1}-{column + 1}",
                    grid="cells",
                    row=row + 1,
                    column=column + 1,
                    polygon=((x0, y0), (x1, y0), (x1, y1), (x0, y1)),
                    centre=(west + wide / 2, south + high / 2),
                )
            )
    return tuple(cells)


def brief(agent: str = "scout[1]", mode: str = "broadcast", uavs: int = 3, **changes: object) -> Brief:
    """Return the brief of one agent of a sea rescue: `scout[i]`, `skipper` or (star only) `commander`."""
    everyone = [Peer(id=f"scout[{i}]", role="searcher", resources=(f"uav[{i}]",)) for i in range(1, uavs + 1)]
    everyone.append(Peer(id="skipper", role="rescuer", resources=("boat",)))
    if mode == "star":
        everyone.append(Peer(id="commander", role="coordinator", resources=()))
    me = next(peer for peer in everyone if peer.id == agent)
    resources: tuple[Resource, ...] = ()
    index = 0
    if agent.startswith("scout"):
        index = int(agent[6:-1])
        resources = (quadrotor(index),)
        if mode == "broadcast":
            resources += (lifeboat(embodied=False),)
    elif agent == "skipper":
        resources = (lifeboat(embodied=True),)
    values: dict[str, object] = {
        "agent": agent,
        "role": me.role,
        "index": index,
        "goal": "Find every person in the water.",
        "prompt": "",
        "mode": mode,
        "hub": "commander" if mode == "star" else None,
        "tick_s": 10.0,
        "ticks": 60,
        "seed": 7,
        "resources": resources,
        "peers": tuple(peer for peer in everyone if peer.id != agent),
        "messages": (REPORT, ASSIGNMENT, STATUS),
        "regions": (Region(name="search", polygon=((WEST, SOUTH), (EAST, SOUTH), (EAST, NORTH), (WEST, NORTH))),),
        "cells": grid(),
        "classes": ("person_in_water",),
        "weather": WEATHER,
        "water_level_m": -3.5,
        "settings": {"altitude": 100.0, "victims": 3.0, "uavs": float(uavs)},
    }
    return Brief(**{**values, **changes})  # type: ignore[arg-type]


def view(
    entity: str, position: tuple[float, float, float], *, busy: bool | None = False, heading: float = 0.0,
    status: str = "hovering",
) -> EntityView:  # fmt: skip
    return EntityView(
        id=entity, type="", position=position, velocity=(0.0, 0.0, 0.0), heading_deg=heading, status=status, busy=busy
    )


def observe(agent: str, tick: int, *entities: EntityView, **parts: object) -> Observation:
    parts = {"weather": WEATHER, **parts}
    return Observation(agent=agent, tick=tick, time_s=10.0 * tick, entities=entities, **parts)  # type: ignore[arg-type]


def envelope(sender: str, spec: MessageSpec, body: dict[str, Datum], tick: int = 1, to: str = "me") -> Envelope:
    return Envelope(
        id=f"m{tick}-1", tick=tick, sender=sender, recipient=to, kind=spec.kind, category=spec.category, body=body,
        bytes=1, deliver_at=tick,
    )  # fmt: skip


def picture(position: tuple[float, float, float], rgb: np.ndarray | None = None, tick: int = 1) -> Picture:
    pixels = np.zeros((1080, 1920, 3), np.uint8) if rgb is None else rgb
    return Picture(
        frame=f"f{tick}-uav[1]-nadir", entity="uav[1]", camera="nadir", tick=tick, time_s=10.0 * tick,
        pose=camera_pose(position, 0.0, NADIR), rgb=pixels,
    )  # fmt: skip


__all__ = [
    "ASSIGNMENT", "EYE", "GUIDANCE", "JAM", "NADIR", "REPORT", "STATUS", "CellView", "EventView", "Inbox", "brief",
    "dog", "envelope", "grid", "lifeboat", "observe", "picture", "quadrotor", "sent_by", "view",
]  # fmt: skip
