"""One step of a model: text in, a checked decision or a list of faults out.

Services that promise a schema do not always keep it, so everything is validated here.
"""

from __future__ import annotations

import math

import msgspec

from lingjing.plugins.policy import Action, ArgumentSpec, Brief, Datum, Decision, Field, MessageSpec, Outgoing, Resource
from lingjing_agents.react.answer import StepError, step_text
from lingjing_agents.react.schema import sendable, takes_name

Value = bool | float | str | None | list[bool | float | str]


class _Command(msgspec.Struct, forbid_unknown_fields=True):
    verb: str
    arguments: dict[str, Value] = {}
    resource: str | None = None


class _Message(msgspec.Struct, forbid_unknown_fields=True):
    kind: str
    body: dict[str, Value] = {}
    to: list[str] = []


class _Step(msgspec.Struct):
    thought: str = ""
    command: _Command | None = None
    messages: list[_Message] = []


def read_step(text: str, brief: Brief) -> Decision:
    """The decision in a model's answer. Raises `StepError`, which lists every fault found."""
    try:
        step = msgspec.json.decode(step_text(text).encode("utf-8", "replace"), type=_Step)
    except (msgspec.DecodeError, RecursionError) as error:
        raise StepError(f"not a step: {error}") from error
    faults: list[str] = []
    command = _check_command(step.command, brief, faults) if step.command is not None else None
    messages = tuple(_check_message(message, brief, faults) for message in step.messages)
    if faults:
        raise StepError("; ".join(faults))
    return Decision(command=command, messages=messages, thought=step.thought)


def _check_command(command: _Command, brief: Brief, faults: list[str]) -> Action | None:
    resource = _resource(command.resource, brief)
    if resource is None:
        known = ", ".join(each.id for each in brief.resources) or "none"
        faults.append(f"you do not command `{command.resource}` (yours: {known})")
        return None
    verb = next((spec for spec in resource.verbs if spec.name == command.verb), None)
    if verb is None:
        known = ", ".join(spec.name for spec in resource.verbs)
        faults.append(f"`{resource.id}` has no verb `{command.verb}` (it has: {known})")
        return None
    specs = {spec.name: spec for spec in verb.arguments}
    given = {name: value for name, value in command.arguments.items() if value is not None}
    faults.extend(f"`{verb.name}` takes no argument `{name}`" for name in given if name not in specs)
    faults.extend(
        f"`{verb.name}` needs the argument `{name}`"
        for name, spec in specs.items()
        if not spec.optional and name not in given
    )
    arguments = {
        name: _argument(verb.name, specs[name], value, faults) for name, value in given.items() if name in specs
    }
    return Action(verb=verb.name, arguments=arguments, resource=resource.id)


def _resource(name: str | None, brief: Brief) -> Resource | None:
    if name is None:
        return brief.resources[0] if brief.resources else None
    return next((resource for resource in brief.resources if resource.id == name), None)


def _argument(verb: str, spec: ArgumentSpec, value: Value, faults: list[str]) -> Datum:
    if takes_name(spec):
        if not isinstance(value, str):
            faults.append(f"`{spec.name}` of `{verb}` must be a name")
    elif not _is_number(value):
        faults.append(f"`{spec.name}` of `{verb}` must be a number")
    return tuple(value) if isinstance(value, list) else value


def _check_message(message: _Message, brief: Brief, faults: list[str]) -> Outgoing:
    spec = next((each for each in sendable(brief) if each.kind == message.kind), None)
    if spec is None:
        known = ", ".join(each.kind for each in sendable(brief)) or "none"
        faults.append(f"you cannot send `{message.kind}` (you can send: {known})")
        return Outgoing(kind=message.kind)
    peers = {peer.id for peer in brief.peers}
    faults.extend(
        f"there is no peer `{name}` (peers: {', '.join(sorted(peers))})" for name in message.to if name not in peers
    )
    return Outgoing(kind=spec.kind, body=_body(spec, message, faults), to=tuple(message.to))


def _body(spec: MessageSpec, message: _Message, faults: list[str]) -> dict[str, Datum]:
    fields = {field.name: field for field in spec.fields}
    given = {name: value for name, value in message.body.items() if value is not None}
    faults.extend(f"`{spec.kind}` has no field `{name}`" for name in given if name not in fields)
    faults.extend(
        f"`{spec.kind}` needs the field `{name}`"
        for name, field in fields.items()
        if not field.optional and name not in given
    )
    for name, value in given.items():
        if name in fields and not _fits(fields[name], value):
            faults.append(f"`{name}` of `{spec.kind}` must be {_WANTED[fields[name].type]}")
    return {name: tuple(value) if isinstance(value, list) else value for name, value in given.items()}


def _fits(field: Field, value: Value) -> bool:
    if field.type == "number":
        low = field.minimum if field.minimum is not None else -math.inf
        high = field.maximum if field.maximum is not None else math.inf
        return _is_number(value) and low <= float(value) <= high  # type: ignore[arg-type]
    if field.type == "flag":
        return isinstance(value, bool)
    if field.type in {"position", "box", "names"}:
        return isinstance(value, list) and _fits_list(field.type, value)
    return isinstance(value, str)


def _fits_list(kind: str, value: list[bool | float | str]) -> bool:
    if kind == "names":
        return all(isinstance(item, str) for item in value)
    numbers = [float(item) for item in value if _is_number(item)]
    if len(numbers) != len(value):
        return False
    if kind == "position":
        return len(numbers) in {2, 3}
    return len(numbers) == 4 and 0 <= numbers[0] < numbers[2] <= 1 and 0 <= numbers[1] < numbers[3] <= 1


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value)


_WANTED = {
    "name": "a name",
    "text": "a text",
    "frame": "a picture's id",
    "number": "a number within its bounds",
    "flag": "true or false",
    "names": "a list of names",
    "position": "[east, north] or [east, north, elevation] in metres",
    "box": "[x_min, y_min, x_max, y_max] with 0 <= min < max <= 1",
}
