"""What faults of all other faculties change in an agent's answer."""

from __future__ import annotations

from collections.abc import Mapping

import msgspec

from lingjing.plugins.policy import STOP, Action, Brief, Datum, Decision, MessageSpec, Outgoing, Resource
from lingjing_agents.capability import has_verb
from lingjing_agents.faulty.options import PlantedFault


def changed_answer(fault: PlantedFault, brief: Brief, decision: Decision) -> Decision:
    """The decision with what the fault makes of its command or of its messages."""
    command, messages = decision.command, decision.messages
    match fault.faculty:
        case "localisation":
            messages = tuple(_mislocated(fault, brief, one) for one in messages)
        case "waypoint" | "routing" if command is not None and _concerns(fault, brief, command):
            command = _rerouted(fault, brief, command)
        case "handoff":
            messages = tuple(kept for one in messages for kept in _handed(fault, brief, one))
        case "execution" if command is not None:
            command = _halted(brief, command) if fault.chosen == "halted" else None
    return msgspec.structs.replace(decision, command=command, messages=messages)


def _kind(brief: Brief, message: Outgoing) -> MessageSpec | None:
    return next((one for one in brief.messages if one.kind == message.kind), None)


def _resource(brief: Brief, command: Action) -> Resource | None:
    """What a command is for: the named resource, or the first one that the agent has."""
    return next((one for one in brief.resources if command.resource in (None, one.id)), None)


def _sees(brief: Brief) -> bool:
    return any(resource.cameras for resource in brief.resources if resource.embodied)


def _mislocated(fault: PlantedFault, brief: Brief, message: Outgoing) -> Outgoing:
    """A report of the agent's own that says another place."""
    kind, place = _kind(brief, message), message.body.get("position")
    if kind is None or kind.category != "report" or not _sees(brief) or not isinstance(place, tuple | list):
        return message
    numbers = [float(value) for value in place if isinstance(value, int | float)]
    wrong: Datum = (numbers[0] + fault.east_m, numbers[1] + fault.north_m, *numbers[2:])
    return msgspec.structs.replace(message, body={**message.body, "position": wrong})


def _concerns(fault: PlantedFault, brief: Brief, command: Action) -> bool:
    """Whether a command is one of the faulty faculty: a place in the air or at sea, or a way on the ground."""
    resource = _resource(brief, command)
    if resource is None:
        return False
    motions = {verb.name: verb.motion for verb in resource.verbs}
    if ("straight" in motions.values()) != (fault.faculty == "waypoint"):
        return False
    due = ("turn",) if fault.chosen == "mirrored" else ("straight", "route")
    return motions.get(command.verb) in due


def _rerouted(fault: PlantedFault, brief: Brief, command: Action) -> Action:
    """The command to another place, or to turn to the other side."""
    if fault.chosen == "mirrored":
        resource = _resource(brief, command)
        turns = [verb.name for verb in resource.verbs if verb.motion == "turn"] if resource is not None else []
        return msgspec.structs.replace(command, verb=next((one for one in turns if one != command.verb), command.verb))
    x, y = _number(command.arguments, "x") + fault.east_m, _number(command.arguments, "y") + fault.north_m
    return msgspec.structs.replace(command, arguments={**command.arguments, "x": x, "y": y})


def _number(arguments: Mapping[str, Datum], name: str) -> float:
    value = arguments.get(name)
    return float(value) if isinstance(value, int | float) else 0.0


def _handed(fault: PlantedFault, brief: Brief, message: Outgoing) -> list[Outgoing]:
    """What becomes of a message that hands something over: all but reports of the agent's own pictures."""
    kind = _kind(brief, message)
    if kind is None or (kind.category == "report" and _sees(brief)):
        return [message]
    if fault.chosen == "dropped":
        return []
    others = [peer.id for peer in brief.peers]
    named = message.body.get("assignee")
    wrong = next((name for name in others if name != named and name not in message.to), None)
    if wrong is None:
        return []
    body = {**message.body, "assignee": wrong} if isinstance(named, str) else message.body
    return [msgspec.structs.replace(message, body=body, to=(wrong,) if message.to else ())]


def _halted(brief: Brief, command: Action) -> Action | None:
    """`stop` in place of the command; nothing for a body that has no such verb."""
    resource = _resource(brief, command)
    if resource is None or not has_verb(resource, STOP):
        return None
    return Action(verb=STOP, resource=resource.id)
