"""What a chat model is told: the system prompt from the brief, one text for each observation. Compact JSON inside."""

from __future__ import annotations

import msgspec

from lingjing.plugins.decisions import JsonSchema, sendable
from lingjing.plugins.geometry import ground_footprint
from lingjing.plugins.policy import Brief, EntityView, Inbox, Observation, Picture, Resource, VerbSpec

RULES = """\
World frame: east, north, elevation in metres; headings in degrees clockwise from north; wind comes from, a current \
goes to its direction; an observation has the weather if it is another than at the start. At each tick you may give \
at most one command and send messages. A command that takes longer than a tick keeps its resource busy; a new one is \
then rejected (`busy`) unless it is `stop`. A picture asked for with takePhoto arrives with the next observation. In \
a nadir picture image-up is the camera's heading; `ground` gives the positions (east, north) of the picture's corners \
on the water, clockwise from top left: interpolate between them to turn a pixel into a position. Boxes are normalised \
[x_min, y_min, x_max, y_max], origin top left, tight around what they show. Report only what you see in a picture.

Answer with one JSON object and nothing else: {"thought": string, "command": {"verb", "arguments", "resource"} or \
null, "messages": [{"kind", "body", "to"}]}."""


def system_prompt(brief: Brief, schema: JsonSchema | None = None) -> str:
    """Goal, role, what can be commanded and said, and the JSON Schema of an answer for services that take none."""
    parts = [
        f"You are `{brief.agent}`, {brief.role} in a mission of {brief.ticks} ticks of {brief.tick_s:g} s.",
        f"Goal: {brief.goal}",
        brief.prompt,
        RULES,
        "You may command:\n" + ("\n".join(map(_resource, brief.resources)) or "nothing: you only send messages."),
        "You may send:\n" + ("\n".join(_messages(brief)) or "nothing."),
        _speech(brief),
        "Known to everyone: " + _json(_common(brief)),
    ]
    if schema is not None:
        parts.append("JSON Schema of your answer: " + _json(schema))
    return "\n\n".join(part for part in parts if part)


def observation_text(observation: Observation, inbox: Inbox, brief: Brief, images: tuple[Picture, ...]) -> str:
    """One boundary as compact JSON; `images` are the pictures that go along, in this order."""
    cells = [
        {"name": cell.name, "visited_tick": cell.visited_tick, "by": cell.visited_by} for cell in observation.cells
    ]
    state: dict[str, object] = {
        "tick": observation.tick,
        "of": brief.ticks,
        "weather": observation.weather if observation.weather != brief.weather else (),
        "entities": [_entity(view) for view in observation.entities],
        "cells": cells,
        "events": [{"kind": event.kind, "entities": event.entities} for event in observation.events],
        "received": [{"from": note.sender, "kind": note.kind, "body": note.body} for note in inbox.messages],
        "receipts": [
            {"resource": receipt.resource, "status": receipt.status, "reason": receipt.reason, "detail": receipt.detail}
            for receipt in inbox.receipts
        ],
        "pictures": [_picture(picture, brief) for picture in images],
        "absent_pictures": [absent.reason for absent in observation.absent],
    }
    return _json({key: value for key, value in state.items() if value not in ([], ())})


def _resource(resource: Resource) -> str:
    cameras = ", ".join(f"{camera.name} ({camera.view})" for camera in resource.cameras)
    head = f"- {resource.id} ({resource.type})" + (f", cameras: {cameras}" if cameras else "")
    return head + ": " + ", ".join(map(_verb, resource.verbs))


def _verb(verb: VerbSpec) -> str:
    arguments = []
    for spec in verb.arguments:
        bound = f" <= {spec.maximum:g}" if spec.maximum is not None else ""
        arguments.append(spec.name + (f" [{spec.unit}]" if spec.unit else "") + bound + ("?" if spec.optional else ""))
    return f"{verb.name}({', '.join(arguments)})"


def _messages(brief: Brief) -> list[str]:
    return [
        f"- {message.kind}: "
        + ", ".join(f"{field.name}:{field.type}{'?' * field.optional}" for field in message.fields)
        for message in sendable(brief)
    ]


def _speech(brief: Brief) -> str:
    if brief.hub is None:
        return "Every message reaches all other agents one tick later; leave `to` empty."
    if brief.hub == brief.agent:
        return "You are the hub: others hear only you. Name the recipients of each message in `to`."
    return f"Every message goes to `{brief.hub}`, which decides what others hear; leave `to` empty."


def _common(brief: Brief) -> dict[str, object]:
    return {
        "peers": [{"id": peer.id, "role": peer.role, "resources": peer.resources} for peer in brief.peers],
        "regions": {region.name: region.polygon for region in brief.regions},
        "cells": {cell.name: _rounded(cell.centre) for cell in brief.cells},
        "classes": brief.classes,
        "water_level_m": brief.water_level_m,
        "settings": brief.settings,
        "weather": brief.weather,
    }


def _entity(view: EntityView) -> dict[str, object]:
    fields: dict[str, object] = {
        "id": view.id,
        "position": _rounded(view.position) if view.position is not None else None,
        "heading_deg": round(view.heading_deg) if view.heading_deg is not None else None,
        "status": view.status,
        "busy": view.busy,
        "resources": {key: round(value, 3) for key, value in (view.resources or {}).items()} or None,
    }
    return {key: value for key, value in fields.items() if value is not None}


def _picture(picture: Picture, brief: Brief) -> dict[str, object]:
    ground = ground_footprint(picture.pose, brief.water_level_m)
    fields: dict[str, object] = {
        "frame": picture.frame,
        "camera": f"{picture.entity}/{picture.camera}",
        "position": _rounded(picture.pose.position),
        "heading_deg": round(picture.pose.heading_deg, 1),
        "ground": [_rounded(corner) for corner in ground] if ground is not None else None,
    }
    return {key: value for key, value in fields.items() if value is not None}


def _rounded(point: tuple[float, ...]) -> list[float]:
    return [round(value, 1) for value in point]


def _json(value: object) -> str:
    return msgspec.json.encode(value).decode()
