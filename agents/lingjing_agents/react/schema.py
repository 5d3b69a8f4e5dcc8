"""The JSON Schema of one step, generated from a brief: which verbs, resources and messages this agent has."""

from __future__ import annotations

import msgspec

from lingjing.plugins.policy import ArgumentSpec, Brief, Field, MessageSpec, Resource, VerbSpec

Schema = dict[str, object]


def step_schema(brief: Brief) -> bytes:
    """The schema as JSON text; the same brief gives the same bytes."""
    commands = [_command(resource, verb) for resource in brief.resources for verb in resource.verbs]
    messages = [_message(brief, message) for message in sendable(brief)]
    properties: Schema = {
        "thought": {"type": "string", "description": "what you see and why you act, in at most three sentences"},
        "command": {"anyOf": [*commands, {"type": "null"}]},
        "messages": {"type": "array", "items": {"anyOf": messages}} if messages else {"type": "array", "maxItems": 0},
    }
    return msgspec.json.encode(_object(properties, required=("thought", "command", "messages")))


def sendable(brief: Brief) -> tuple[MessageSpec, ...]:
    """The message kinds this agent may send."""
    mine = {brief.agent, brief.role, "all"}
    return tuple(message for message in brief.messages if mine.intersection(message.senders))


def _command(resource: Resource, verb: VerbSpec) -> Schema:
    arguments = {spec.name: _argument(resource, spec) for spec in verb.arguments}
    required = tuple(spec.name for spec in verb.arguments if not spec.optional)
    properties: Schema = {
        "verb": {"const": verb.name},
        "arguments": _object(dict(arguments), required=required),
        "resource": {"const": resource.id},
    }
    return _object(properties, required=("verb", "arguments", "resource"))


def _argument(resource: Resource, spec: ArgumentSpec) -> Schema:
    if takes_name(spec):
        names = [camera.name for camera in resource.cameras]
        return {"type": "string", "enum": names} if names else {"type": "string"}
    schema: Schema = {"type": "number"}
    if spec.unit:
        schema["description"] = spec.unit
    if spec.minimum is not None:
        schema["minimum"] = spec.minimum
    if spec.maximum is not None:
        schema["maximum"] = spec.maximum
    return schema


def takes_name(spec: ArgumentSpec) -> bool:
    """Whether an argument is a name and not a number."""
    return spec.unit == "name" or spec.name == "camera"


def _message(brief: Brief, message: MessageSpec) -> Schema:
    body = {field.name: _field(brief, field) for field in message.fields}
    required = tuple(field.name for field in message.fields if not field.optional)
    peers = [peer.id for peer in brief.peers]
    properties: Schema = {
        "kind": {"const": message.kind},
        "body": _object(dict(body), required=required),
        "to": {"type": "array", "items": {"type": "string", "enum": peers} if peers else {"type": "string"}},
    }
    return _object(properties, required=("kind", "body", "to"))


def _field(brief: Brief, field: Field) -> Schema:
    if field.name == "class" and brief.classes:
        return {"type": "string", "enum": list(brief.classes)}
    if field.type == "number":
        bounds = {"minimum": field.minimum, "maximum": field.maximum}
        return {"type": "number", **{key: value for key, value in bounds.items() if value is not None}}
    return dict(_FIELDS[field.type])


def _object(properties: Schema, required: tuple[str, ...]) -> Schema:
    return {"type": "object", "properties": properties, "required": list(required), "additionalProperties": False}


_FIELDS: dict[str, Schema] = {
    "name": {"type": "string"},
    "text": {"type": "string"},
    "frame": {"type": "string", "description": "id of the picture"},
    "flag": {"type": "boolean"},
    "names": {"type": "array", "items": {"type": "string"}},
    "position": {
        "type": "array",
        "items": {"type": "number"},
        "minItems": 2,
        "maxItems": 3,
        "description": "east, north, elevation in metres",
    },
    "box": {
        "type": "array",
        "items": {"type": "number", "minimum": 0, "maximum": 1},
        "minItems": 4,
        "maxItems": 4,
        "description": "x_min, y_min, x_max, y_max in 0..1, origin top left",
    },
}
