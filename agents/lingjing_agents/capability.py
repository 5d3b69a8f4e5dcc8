"""What a brief lets an agent do: read from verbs, cameras and message fields, never from the names in a mission."""

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
"""What a coordinator calls its order to look at a waypoint; who has looked says `inspect-N` of the Nth."""

CLEAR, JAMMED = "clear", "jammed"
"""The state of a waypoint, as who has looked says it: whether something stands in the way there."""


def has_verb(resource: Resource, verb: str) -> bool:
    """Whether the resource's action schema has that verb."""
    return any(spec.name == verb for spec in resource.verbs)


def walks(verbs: Sequence[VerbSpec]) -> bool:
    """Whether a body with these verbs turns on the spot, by an angle that it is told, and goes to no place by itself:
    an aircraft of a plug-in may turn as well."""
    turns = [verb.arguments for verb in verbs if verb.motion == "turn"]
    goes = any(verb.motion in ("straight", "route") for verb in verbs)
    return not goes and any(turns) and all(argument.unit == "deg" for arguments in turns for argument in arguments)


def straight_to(resource: Resource, *coordinates: str) -> str:
    """The verb with which a body goes straight to a place that these arguments name; "" if it has none."""
    return _going(resource, "straight", coordinates)


def route_to(resource: Resource) -> str:
    """The verb with which a body drives to a place on a map; "" if it has none."""
    return _going(resource, "route", ("x", "y"))


def _going(resource: Resource, motion: VerbMotion, coordinates: tuple[str, ...]) -> str:
    for verb in resource.verbs:
        if verb.motion == motion and {argument.name for argument in verb.arguments} == set(coordinates):
            return verb.name
    return ""


def flying_camera(brief: Brief) -> Resource | None:
    """The first embodied resource that can go to a point and look down: what makes an agent a searcher."""
    for resource in brief.resources:
        able = straight_to(resource, "x", "y", "z") and has_verb(resource, PHOTO)
        if resource.embodied and able and nadir_camera(resource) is not None:
            return resource
    return None


def vessel(brief: Brief, *, embodied: bool = True) -> Resource | None:
    """The first resource that goes straight to places on the water and that the agent embodies, or (`embodied=False`)
    may merely command."""
    for resource in brief.resources:
        if resource.embodied == embodied and straight_to(resource, "x", "y"):
            return resource
    return None


def vehicle(brief: Brief) -> Resource | None:
    """The first embodied resource that drives: it goes to places on a map, without a height."""
    for resource in brief.resources:
        if resource.embodied and route_to(resource):
            return resource
    return None


def nadir_camera(resource: Resource) -> CameraSpec | None:
    """The first camera that looks straight down."""
    return next((camera for camera in resource.cameras if camera.view == "nadir"), None)


def rated(resource: Resource, name: str, default: float) -> float:
    """A number among the resource's properties (`band_high_m`, `cruise_mps`, …), in the unit of its name."""
    value = resource.properties.get(name)
    return float(value) if isinstance(value, int | float) else default


def speed(resource: Resource) -> float:
    """Its `speed_mps`; 3 m/s where it states none."""
    stated = rated(resource, "speed_mps", 0.0)
    return stated if stated > 0 else 3.0


def photo(body: Resource, camera: CameraSpec) -> Action:
    """The command that has a body's camera take a picture."""
    return Action(verb=PHOTO, arguments={"camera": camera.name}, resource=body.id)


def fly(body: Resource, x: float, y: float, z: float) -> Action:
    """The command that sends a flier to a place in the world, metres to the centimetre."""
    return Action(
        verb=straight_to(body, "x", "y", "z"),
        arguments={"x": round(x, 2), "y": round(y, 2), "z": round(z, 2)},
        resource=body.id,
    )


def drive(body: Resource, place: GroundPoint) -> Action:
    """The command that sends a vehicle or a vessel to a place, metres to the centimetre."""
    x, y = centimetres(place)
    return Action(verb=straight_to(body, "x", "y") or route_to(body), arguments={"x": x, "y": y}, resource=body.id)


def first_argument_bounds(
    verbs: tuple[VerbSpec, ...], name: str, least: float = 0.0, most: float = math.inf
) -> tuple[float, float]:
    """The smallest (at least `least`) and the largest value of a verb's first argument; `most` if it has no bound."""
    for spec in verbs:
        if spec.name == name and spec.arguments:
            argument = spec.arguments[0]
            return max(argument.minimum or least, least), most if argument.maximum is None else argument.maximum
    return least, most


def may_send(brief: Brief, category: str) -> MessageSpec | None:
    """The first message kind of that category that this agent may send in this mode."""
    return next((message for message in sendable(brief) if message.category == category), None)


def sends(brief: Brief, record: str) -> MessageSpec | None:
    """The first message kind made of that record (`assignment`, `trafficJam`, …) that this agent may send."""
    return next((message for message in sendable(brief) if message.type == record), None)


def exchanged(brief: Brief, record: str) -> bool:
    """Whether anybody in the mission may send messages made of that record."""
    return any(message.type == record for message in brief.messages)


def compose(message: MessageSpec, body: Mapping[str, Datum], to: tuple[str, ...] = ()) -> Outgoing:
    """A message with those of the given fields that its record declares; None values are left out."""
    names = {field.name for field in message.fields}
    kept: dict[str, Datum] = {name: value for name, value in body.items() if name in names and value is not None}
    return Outgoing(kind=message.kind, body=kept, to=to)


def centimetres(place: Sequence[float]) -> tuple[float, ...]:
    """A place rounded to the centimetre, as messages give it."""
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
    """A message that a picture shows something of a class in a box at a place, `more` of what its record has fields
    for."""
    body: dict[str, Datum] = {
        "frame": frame,
        "class": cls,
        "box": tuple(round(edge, 6) for edge in box),
        "position": tuple(position),
        "confidence": round(confidence, 3),
    }
    return compose(message, {**body, **more})


def natural(name: str) -> tuple[tuple[int, int, str], ...]:
    """A sort key that puts `uav[2]` before `uav[10]`; the agreed order among agents."""
    parts = re.findall(r"\d+|\D+", name)
    return tuple((0, int(part), "") if part.isdigit() else (1, 0, part) for part in parts)


def team(brief: Brief) -> tuple[str, ...]:
    """Ids of the agents that share this agent's role, itself included, in the agreed order."""
    mates = {peer.id for peer in brief.peers if peer.role == brief.role and peer.resources}
    return tuple(sorted(mates | {brief.agent}, key=natural))
