"""The JSON Schema of an agent's answers, and the faults of an answer against it.

For policies that receive decisions from another program, such as a language model. The schema is made from the brief's
action and message specs, by which the kernel admits decisions too. It rejects no decision that the kernel would admit.
It accepts none that the kernel would reject, except for reasons that are known only while the episode runs (busy
resources, permits, counted budgets, bounds of the city, pictures taken so far, the size of a message). The kernel clips
numbers beyond the bounds of an argument, so they are no fault; the description of the argument has the bounds.

`jsonschema` is imported when the first format is made.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from itertools import islice
from typing import Any, cast

import msgspec

from lingjing.decoding import converted, from_json
from lingjing.mission.faults import faults_of
from lingjing.mission.languages import phrases
from lingjing.mission.model import Field
from lingjing.mission.spec_schema import (
    REACH_M,
    JsonSchema,
    altitude_band,
    argument_bounds,
    field_schema,
    object_schema,
)
from lingjing.mission.vocabulary import PHOTO
from lingjing.plugins.policy import (
    ArgumentSpec,
    Brief,
    Decision,
    MessageSpec,
    NoDecisionError,
    Resource,
    UnreadBox,
    VerbSpec,
)

MESSAGES_PER_CALL = 32
"""The most messages of one decision: the kernel rejects further ones."""

FAULTS_TOLD = 20
"""The most faults that are listed of one answer. Chosen: they fit a repair request."""


class DecisionFormat:
    """The form of one agent's answers.

    `schema` is a JSON Schema (draft 2020-12) of an object with `thought`, `command` and `messages`, and with optional
    fields of the policy's own (`extra`: name → schema).
    """

    def __init__(self, brief: Brief, extra: Mapping[str, JsonSchema] | None = None) -> None:
        from jsonschema import Draft202012Validator

        self._extra = dict(extra or {})
        self.schema = decision_schema(brief, self._extra)
        self._validator = Draft202012Validator(self.schema)
        self._first = brief.resources[0].id if brief.resources else None
        self._boxes = {
            message.kind: [field.name for field in message.fields if field.type == "box"] for message in brief.messages
        }

    def completed(self, answer: object) -> object:
        """Return the answer with omitted parts filled in as the kernel does: no command, no messages, the first
        resource, empty objects, nothing for null. Fields that the schema does not have are removed."""
        if not isinstance(answer, dict):
            return answer
        completed_answer = {"thought": "", "messages": [], **_without_null(answer)}
        command, messages = completed_answer.get("command"), completed_answer["messages"]
        if isinstance(command, dict):
            command = {"verb": "", "arguments": {}, "resource": self._first, **_without_null(command)}
            command["arguments"] = _without_null(command["arguments"])
        if isinstance(messages, list):
            messages = [_message_completed(message) for message in messages]
        own = {name: completed_answer[name] for name in self._extra if name in completed_answer}
        return {"thought": completed_answer["thought"], "command": command, "messages": messages, **own}

    def faults(self, answer: Any) -> tuple[str, ...]:
        """Return every fault of a completed answer with the path to it, `FAULTS_TOLD` at most."""
        faults = dict.fromkeys(islice(faults_of(self._validator.iter_errors(answer)), FAULTS_TOLD))
        lines = (
            f"{fault.where or 'answer'}: {fault.message}" + f" ({fault.hint})" * bool(fault.hint) for fault in faults
        )
        return tuple(lines) or tuple(self._disordered(answer))

    def read(self, text: str) -> Decision:
        """Return the decision in a model's answer: the object between the first `{` and the last `}`.

        Raises `NoDecisionError` that lists the faults: the kernel substitutes a no-op and records them.
        """
        begin, end = text.find("{"), text.rfind("}") + 1
        try:
            answer = self.completed(from_json(text[begin:end] if begin >= 0 else text))
        except (msgspec.DecodeError, RecursionError) as error:
            raise NoDecisionError(f"the answer is no JSON: {error}") from error
        if faults := self.faults(answer):
            raise NoDecisionError("; ".join(faults))
        return self.decision(answer)

    def decision(self, answer: Any) -> Decision:
        """Return a completed answer without faults as a decision, without fields of the policy's own."""
        return converted({name: answer[name] for name in ("thought", "command", "messages")}, Decision)

    def unread_boxes(self, answer: object) -> tuple[UnreadBox, ...]:
        """Return the boxes of the reports in an answer with faults, as they are written; parts without the form of a
        report are left out."""
        boxes: list[UnreadBox] = []
        messages = answer.get("messages") if isinstance(answer, dict) else None
        for message in messages if isinstance(messages, list) else ():
            if not isinstance(message, dict) or not isinstance(body := message.get("body"), dict):
                continue
            for name in self._boxes.get(str(message.get("kind")), ()):
                try:
                    box = converted({"frame": body.get("frame"), "numbers": body.get(name)}, UnreadBox)
                except msgspec.ValidationError:
                    continue
                boxes.append(box)
        return tuple(boxes)

    def _disordered(self, answer: Any) -> Iterator[str]:
        """Yield the faults of boxes with edges in the wrong order, which JSON Schema cannot express."""
        for number, message in enumerate(answer["messages"]):
            for name in self._boxes[message["kind"]]:
                x0, y0, x1, y1 = message["body"].get(name, (0.0, 0.0, 1.0, 1.0))
                if not (x0 < x1 and y0 < y1):
                    yield f"messages[{number}].body.{name}: x_min, y_min, x_max, y_max with min < max are due"


def decision_schema(brief: Brief, extra: Mapping[str, JsonSchema] | None = None) -> JsonSchema:
    """Return the JSON Schema of a decision of the brief's agent, with optional fields of the policy's own. The same
    brief gives the same schema."""
    commands = [
        _command(resource, verb) for resource in brief.resources for verb in resource.verbs if _can(resource, verb)
    ]
    messages = [_message(brief, message) for message in sendable(brief)]
    return object_schema(
        {
            "thought": {"type": "string", "description": "what you see and why you act, in at most three sentences"},
            "command": {"anyOf": [*commands, {"type": "null"}]},
            "messages": {"type": "array", "items": {"anyOf": messages}, "maxItems": MESSAGES_PER_CALL}
            if messages
            else {"type": "array", "maxItems": 0},
            **(extra or {}),
        },
        ("thought", "command", "messages"),
    )


def prompt_schema(schema: JsonSchema) -> JsonSchema:
    """Return a decision's schema for the text of a prompt: it accepts the same answers and is shorter.

    Descriptions and the bounds of places are left out, because prompts say them beside the verbs and messages. Commands
    with the same arguments are one branch. The order is that of the schema, so the same brief gives the same text.
    """
    fields: dict[str, Any] = dict(cast("Mapping[str, Any]", schema["properties"]))
    branches = [branch["properties"] for branch in fields["command"]["anyOf"] if "properties" in branch]
    grouped: dict[str, dict[str, list[str]]] = {}
    for branch in branches:
        arguments = msgspec.json.encode(_plain(branch["arguments"])).decode()
        verbs = grouped.setdefault(arguments, {})
        verbs.setdefault(branch["verb"]["const"], []).append(branch["resource"]["const"])
    commands = [
        _short_command(resources, verbs, from_json(arguments))
        for arguments, by_verb in grouped.items()
        for resources, verbs in _by_resources(by_verb)
    ]
    short = {
        **{name: _plain(field) for name, field in fields.items()},
        "command": {"anyOf": [*commands, {"type": "null"}]},
    }
    return {**schema, "properties": short}


def _by_resources(by_verb: Mapping[str, list[str]]) -> Iterator[tuple[list[str], list[str]]]:
    """Yield the resources that share verbs, and these verbs."""
    sharing: dict[tuple[str, ...], list[str]] = {}
    for verb, resources in by_verb.items():
        sharing.setdefault(tuple(resources), []).append(verb)
    for shared, verbs in sharing.items():
        yield list(shared), verbs


def _short_command(resources: list[str], verbs: list[str], arguments: JsonSchema) -> JsonSchema:
    properties: JsonSchema = {"resource": _one_of(resources), "verb": _one_of(verbs), "arguments": arguments}
    return object_schema(properties, tuple(properties))


def _one_of(names: list[str]) -> JsonSchema:
    return {"const": names[0]} if len(names) == 1 else {"enum": names}


def _plain(value: Any) -> Any:
    """Return a schema without descriptions and without the bounds of places."""
    if isinstance(value, list):
        return [_plain(item) for item in value]
    if not isinstance(value, dict):
        return value
    kept = {name: item for name, item in value.items() if not (name == "description" and isinstance(item, str))}
    if kept.get("minimum") == -REACH_M and kept.get("maximum") == REACH_M:
        kept = {name: item for name, item in kept.items() if name not in ("minimum", "maximum")}
    return {name: _plain(item) for name, item in kept.items()}


def sendable(brief: Brief) -> tuple[MessageSpec, ...]:
    """Return the message kinds that the brief's agent may send: those of its role that another agent may receive, and
    reports, which the adjudicator receives."""
    return tuple(
        message
        for message in brief.messages
        if message.is_sent_by(brief.role) and (message.category == "report" or _has_receiver(brief, message))
    )


def recipients(brief: Brief, message: MessageSpec) -> tuple[str, ...]:
    """Return the agents that a hub may name as recipients of a message kind."""
    return tuple(peer.id for peer in brief.peers if message.is_for(peer.role))


def _has_receiver(brief: Brief, message: MessageSpec) -> bool:
    if brief.hub == brief.agent:
        return bool(recipients(brief, message))
    return bool(brief.peers) and (brief.hub is None or brief.hub in {peer.id for peer in brief.peers})


def _can(resource: Resource, verb: VerbSpec) -> bool:
    """Return True if a resource can carry out a verb: taking a picture needs a camera."""
    return verb.name != PHOTO or bool(resource.cameras)


def _command(resource: Resource, verb: VerbSpec) -> JsonSchema:
    arguments = {spec.name: _argument(resource, verb, spec) for spec in verb.arguments}
    required = tuple(spec.name for spec in verb.arguments if not spec.optional and spec.default is None)
    properties: JsonSchema = {
        "resource": {"const": resource.id},
        "verb": {"const": verb.name},
        "arguments": object_schema(arguments, required),
    }
    return object_schema(properties, tuple(properties))


def _argument(resource: Resource, verb: VerbSpec, spec: ArgumentSpec) -> JsonSchema:
    if spec.unit == "name":
        photo = verb.name == PHOTO and spec.name == "camera"
        return {"type": "string", "enum": [camera.name for camera in resource.cameras]} if photo else {"type": "string"}
    low, high = argument_bounds(spec, resource.properties)
    bounds = f"clipped to {_bound(low)}..{_bound(high)}" if math.isfinite(low) or math.isfinite(high) else ""
    words = ", ".join(part for part in (spec.unit, bounds) if part)
    schema: JsonSchema = {"type": "number", "minimum": -REACH_M, "maximum": REACH_M}
    return {**schema, "description": words} if words else schema


def _bound(value: float) -> str:
    return f"{value:g}" if math.isfinite(value) else ""


def _message(brief: Brief, message: MessageSpec) -> JsonSchema:
    body = {field.name: _field(brief, field) for field in message.fields}
    required = tuple(field.name for field in message.fields if not field.optional)
    to: JsonSchema = {"type": "array", "items": {"type": "string"}}
    if brief.hub == brief.agent:
        names = list(recipients(brief, message))
        to = (
            {"type": "array", "items": {"type": "string", "enum": names}} if names else {"type": "array", "maxItems": 0}
        )
    properties: JsonSchema = {"kind": {"const": message.kind}, "body": object_schema(body, required), "to": to}
    return object_schema(properties, tuple(properties))


def field_values(brief: Brief, field: Field) -> str:
    """Return the values of a message's field in words; every kind of field has such words.

    The kernel admits any name. The listed names are those that a reader of the message understands.
    """
    say = phrases(brief.language, __package__)
    if field.type == "number":
        bounds = ((field.minimum, "at least {bound:g}"), (field.maximum, "at most {bound:g}"))
        limits = [say(words, bound=bound) for bound, words in bounds if bound is not None]
        return say.text(", ").join(part for part in (say("a number"), *limits, field.unit) if part)
    if field.type in ("name", "names"):
        names_of = _NAMED.get(field.name.removesuffix("s") if field.type == "names" else field.name)
        known = names_of(brief) if names_of else ()
        many = say("a list, each ") if field.type == "names" else ""
        if known:
            return many + say("one of {names}", names=", ".join(known))
        return many + say(_FREE.get(field.name, "a short word"))
    return say(_FLAGS.get(field.name, _MEANT[field.type]))


def _bodies(brief: Brief) -> tuple[str, ...]:
    """Return the ids that a task can be assigned to: the agents, then the entities that they command."""
    agents = (brief.agent, *(peer.id for peer in brief.peers))
    held = (*(body.id for body in brief.resources), *(name for peer in brief.peers for name in peer.resources))
    return tuple(dict.fromkeys((*agents, *held)))


_NAMED: dict[str, Callable[[Brief], tuple[str, ...]]] = {
    "class": lambda brief: brief.classes,
    "assignee": _bodies,
    "cell": lambda brief: tuple(cell.name for cell in brief.cells),
}
_FREE = {
    "stop": "id of a place among the entities you observe",
    "stops": "id of a place among the entities you observe, in the order of the tour",
    "cell": "leave it out, because this mission has no cells",
    "task": "a short word that its reader understands, such as search, inspect, look, drive, rescue or extinguish",
    "state": "a short word, such as clear, jammed, searched, done, missed or blocked",
    "step": "verb of the assignee's next command, such as forward, left, right or stop",
}
_FLAGS = {"hover": "true if the body that took the picture should stay over the place, else false"}
"""The meanings of flags with a name that says too little (the paper's sea rescue, line 664)."""
_MEANT = {
    "text": "a text",
    "frame": "id of a picture that was taken, such as you were given it",
    "flag": "true or false",
    "position": "[east, north] or [east, north, elevation], m",
    "box": "[x_min, y_min, x_max, y_max] of the whole picture, each 0 to 1, x to the right, y down, min < max",
}


def _field(brief: Brief, field: Field) -> JsonSchema:
    if field.name in _NAMED and field.type == "name" and _NAMED[field.name](brief):
        return {**field_schema(field), "description": field_values(brief, field)}
    return field_schema(field)


def _without_null(values: Any) -> Any:
    return {key: value for key, value in values.items() if value is not None} if isinstance(values, dict) else values


def _message_completed(message: object) -> object:
    if not isinstance(message, dict):
        return message
    whole = {"kind": "", "body": {}, "to": [], **_without_null(message)}
    return {**whole, "body": _without_null(whole["body"])}


__all__ = [
    "PHOTO", "DecisionFormat", "JsonSchema", "altitude_band", "argument_bounds", "decision_schema", "field_values",
    "prompt_schema", "recipients", "sendable",
]  # fmt: skip
