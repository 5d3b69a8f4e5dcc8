"""The capabilities of an agent, derived from verbs, cameras and message fields, never from the names in a mission."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence

from lingjing.plugins.decisions import sendable
from lingjing.plugins.policy import (
    PHOTO,
    Action,
    Brief,
    CameraSpec,
    Datum,
    MessageSpec,
    Outgoing,
    Resource,
    VerbMotion,
    VerbSpec,
)
from lingjing_agents.ground_plane import GroundPoint
from lingjing_agents.perception.images import ImageBox

INSPECT = "inspect"
"""The task name of a coordinator's order to inspect a waypoint; a report on the Nth waypoint has the task
`inspect-N`.
"""

CLEAR, JAMMED = "clear", "jammed"
"""The reported state of a waypoint: free, or blocked by something."""


def has_verb(resource: Resource, verb: str) -> bool:
    """Return whether the resource's action space has that verb."""
    return any(spec.name == verb for spec in resource.verbs)


def walks(verbs: Sequence[VerbSpec]) -> bool:
    """Return whether a body with these verbs is a walker.

    A walker turns on the spot by an angle and has no verb that goes to a place. (A plug-in's aircraft may turn as
    well.)
    """
    turns = [verb.arguments for verb in verbs if verb.motion == "turn"]
    goes = any(verb.motion in ("straight", "route") for verb in verbs)
    return not goes and any(turns) and all(argument.unit == "deg" for arguments in turns for argument in arguments)


def straight_to(resource: Resource, *coordinates: str) -> str:
    """Return the verb that moves a body straight to a place with these coordinates; "" if it has none."""
    return _going(resource, "straight", coordinates)


def route_to(resource: Resource) -> str:
    """Return the verb that drives a body to a place on a map; "" if it has none."""
    return _going(resource, "route", ("x", "y"))


def _going(resource: Resource, motion: VerbMotion, coordinates: tuple[str, ...]) -> str:
    for verb in resource.verbs:
        if verb.motion == motion and {argument.name for argument in verb.arguments} == set(coordinates):
            return verb.name
    return ""


def flying_camera(brief: Brief) -> Resource | None:
    """Return the first embodied resource that flies to a point and has a downward camera, which makes an agent a
    searcher.
    """
    for resource in brief.resources:
        able = straight_to(resource, "x", "y", "z") and has_verb(resource, PHOTO)
        if resource.embodied and able and nadir_camera(resource) is not None:
            return resource
    return None


def vessel(brief: Brief, *, embodied: bool = True) -> Resource | None:
    """Return the first resource that moves straight on the water.

    With `embodied` the agent embodies it; otherwise the agent may only command it.
    """
    for resource in brief.resources:
        if resource.embodied == embodied and straight_to(resource, "x", "y"):
            return resource
    return None


def vehicle(brief: Brief) -> Resource | None:
    """Return the first embodied resource that drives to places on a map, without a height."""
    for resource in brief.resources:
        if resource.embodied and route_to(resource):
            return resource
    return None


def nadir_camera(resource: Resource) -> CameraSpec | None:
    """Return the first camera that looks straight down."""
    return next((camera for camera in resource.cameras if camera.view == "nadir"), None)


def rated(resource: Resource, name: str, default: float) -> float:
    """Return a number among the resource's properties (`band_high_m`, `cruise_mps`, …), in the unit of its name."""
    value = resource.properties.get(name)
    return float(value) if isinstance(value, int | float) else default


def speed(resource: Resource) -> float:
    """Return the resource's `speed_mps`, or 3 m/s if it declares none."""
    stated = rated(resource, "speed_mps", 0.0)
    return stated if stated > 0 else 3.0


def photo(body: Resource, camera: CameraSpec) -> Action:
    """Return the command that takes a picture with a body's camera."""
    return Action(verb=PHOTO, arguments={"camera": camera.name}, resource=body.id)


def fly(body: Resource, x: float, y: float, z: float) -> Action:
    """Return the command that sends an aircraft to a place; coordinates in metres, rounded to the centimetre."""
    return Action(
        verb=straight_to(body, "x", "y", "z"),
        arguments={"x": round(x, 2), "y": round(y, 2), "z": round(z, 2)},
        resource=body.id,
    )


def drive(body: Resource, place: GroundPoint) -> Action:
    """Return the command that sends a vehicle or a vessel to a place; coordinates in metres, rounded to the
    centimetre.
    """
    x, y = centimetres(place)
    return Action(verb=straight_to(body, "x", "y") or route_to(body), arguments={"x": x, "y": y}, resource=body.id)


def first_argument_bounds(
    verbs: tuple[VerbSpec, ...], name: str, least: float = 0.0, most: float = math.inf
) -> tuple[float, float]:
    """Return the smallest (at least `least`) and the largest value of a verb's first argument; `most` if it has no
    bound.
    """
    for spec in verbs:
        if spec.name == name and spec.arguments:
            argument = spec.arguments[0]
            return max(argument.minimum or least, least), most if argument.maximum is None else argument.maximum
    return least, most


def may_send(brief: Brief, category: str) -> MessageSpec | None:
    """Return the first message kind of that category that this agent may send in this mode, or None."""
    return next((message for message in sendable(brief) if message.category == category), None)


def sends(brief: Brief, record: str) -> MessageSpec | None:
    """Return the first message kind of that record type (`assignment`, `trafficJam`, …) that this agent may send, or
    None.
    """
    return next((message for message in sendable(brief) if message.type == record), None)


def exchanged(brief: Brief, record: str) -> bool:
    """Return whether any agent of the mission may send messages of that record type."""
    return any(message.type == record for message in brief.messages)


def compose(message: MessageSpec, body: Mapping[str, Datum], to: tuple[str, ...] = ()) -> Outgoing:
    """Return a message with those fields of `body` that its record declares; None values are left out."""
    names = {field.name for field in message.fields}
    kept: dict[str, Datum] = {name: value for name, value in body.items() if name in names and value is not None}
    return Outgoing(kind=message.kind, body=kept, to=to)


def centimetres(place: Sequence[float]) -> tuple[float, ...]:
    """Return a place rounded to the centimetre, as in messages."""
    return tuple(round(value, 2) for value in place)


def sighting(
    message: MessageSpec,
    frame: str,
    cls: str,
    box: ImageBox,
    position: Sequence[float],
    confidence: float,
    **more: Datum,
) -> Outgoing:
    """Return a message that reports an object of class `cls` in a picture's box, at a position.

    `more` are further values; those without a field in the record are left out.
    """
    body: dict[str, Datum] = {
        "frame": frame,
        "class": cls,
        "box": tuple(round(edge, 6) for edge in box),
        "position": tuple(position),
        "confidence": round(confidence, 3),
    }
    return compose(message, {**body, **more})


def natural(name: str) -> tuple[tuple[int, int, str], ...]:
    """Return a sort key that puts `uav[2]` before `uav[10]`: the common order of agents."""
    parts = re.findall(r"\d+|\D+", name)
    return tuple((0, int(part), "") if part.isdigit() else (1, 0, part) for part in parts)


def claims_limit(brief: Brief) -> int | None:
    """Return the number of claims that all agents together may make; None without a limit."""
    limited = (limit.most for limit in brief.limits if any(item.kind == "claims" for item in limit.counts))
    return min(limited, default=None)


def team(brief: Brief) -> tuple[str, ...]:
    """Return the ids of the agents with this agent's role, itself included, in the common order."""
    mates = {peer.id for peer in brief.peers if peer.role == brief.role and peer.resources}
    return tuple(sorted(mates | {brief.agent}, key=natural))
