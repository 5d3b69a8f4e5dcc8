"""`FaultyPolicy`: a policy with planted faults, and the effects of each fault on observations and decisions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import msgspec
import numpy as np

from lingjing.plugins.policy import (
    REFERENCE,
    STOP,
    Action,
    Brief,
    Datum,
    Decision,
    FrameInfo,
    Inbox,
    MessageSpec,
    Observation,
    Outgoing,
    Picture,
    Policy,
    Privileged,
    Resource,
)
from lingjing_agents.capability import has_verb
from lingjing_agents.faulty.options import FaultyOptions, PlantedFault


class FaultyPolicy:
    """Plays as the wrapped policy does, except where a fault of this agent acts."""

    def __init__(self, wrapped: Policy, options: FaultyOptions) -> None:
        self._wrapped, self._faults = wrapped, options.faults

    async def reset(self, brief: Brief) -> None:
        """Reset the wrapped policy, which has no knowledge of the faults."""
        self._brief = brief
        await self._wrapped.reset(brief)

    async def act(self, observation: Observation, inbox: Inbox) -> Decision:
        """Return the wrapped policy's decision on the changed observation, with the changes of all acting faults."""
        acting = [fault for fault in self._faults if fault.acts(observation.agent, observation.tick)]
        for fault in acting:
            observation = _changed_observation(fault, observation)
        decision = await self._wrapped.act(observation, inbox)
        for fault in acting:
            decision = _changed_decision(fault, self._brief, decision)
        return decision


def faulty_oracle(options: FaultyOptions) -> Policy:
    """Build the oracle with faults. It is privileged, as the oracle is."""
    from lingjing_agents.oracle import OraclePolicy

    return FaultyPolicy(OraclePolicy(), options)


def faulty_heuristic(options: FaultyOptions) -> Policy:
    """Build the heuristic with faults."""
    from lingjing_agents.heuristic.policy import HeuristicPolicy

    return FaultyPolicy(HeuristicPolicy(), options)


def _changed_observation(fault: PlantedFault, observation: Observation) -> Observation:
    """Return the observation without targets in its pictures, for a fault of perception; else unchanged.

    Pictures get one colour, the mean of their own. Depth and classes stay, because bodies use them to avoid obstacles.
    The ground truth loses its boxes.
    """
    if fault.faculty != "perception":
        return observation
    pictures = tuple(picture if picture.camera == REFERENCE else _plain(picture) for picture in observation.pictures)
    known = observation.privileged
    return replace(observation, pictures=pictures, privileged=None if known is None else _without_boxes(known))


def _plain(picture: Picture) -> Picture:
    colour = picture.rgb.reshape(-1, 3).mean(axis=0).astype(np.uint8)
    return replace(picture, rgb=np.broadcast_to(colour, picture.rgb.shape).copy(), jpeg=b"")


def _without_boxes(known: Privileged) -> Privileged:
    def emptied(frame: FrameInfo) -> FrameInfo:
        return msgspec.structs.replace(frame, boxes=())

    return msgspec.structs.replace(known, frames=tuple(map(emptied, known.frames)))


def _changed_decision(fault: PlantedFault, brief: Brief, decision: Decision) -> Decision:
    """Return the decision with the fault's changes to its command or its messages."""
    command, messages = decision.command, decision.messages
    match fault.faculty:
        case "localisation":
            messages = tuple(_mislocated(fault, brief, message) for message in messages)
        case "waypoint" | "routing" if command is not None and _concerns(fault, brief, command):
            command = _rerouted(fault, brief, command)
        case "handoff":
            messages = tuple(kept for message in messages for kept in _handed(fault, brief, message))
        case "execution" if command is not None:
            command = _halted(brief, command) if fault.chosen == "halted" else None
    return msgspec.structs.replace(decision, command=command, messages=messages)


def _kind(brief: Brief, message: Outgoing) -> MessageSpec | None:
    return next((spec for spec in brief.messages if spec.kind == message.kind), None)


def _resource(brief: Brief, command: Action) -> Resource | None:
    """Return the resource of a command: the named one, or the agent's first."""
    return next((resource for resource in brief.resources if command.resource in (None, resource.id)), None)


def _sees(brief: Brief) -> bool:
    return any(resource.cameras for resource in brief.resources if resource.embodied)


def _mislocated(fault: PlantedFault, brief: Brief, message: Outgoing) -> Outgoing:
    """Return a report of the agent's own pictures with a displaced position; other messages unchanged."""
    kind, place = _kind(brief, message), message.body.get("position")
    if kind is None or kind.category != "report" or not _sees(brief) or not isinstance(place, tuple | list):
        return message
    numbers = [float(value) for value in place if isinstance(value, int | float)]
    wrong: Datum = (numbers[0] + fault.east_m, numbers[1] + fault.north_m, *numbers[2:])
    return msgspec.structs.replace(message, body={**message.body, "position": wrong})


def _concerns(fault: PlantedFault, brief: Brief, command: Action) -> bool:
    """Return whether the command belongs to the faulty faculty: motion in the air or at sea (waypoint), or on the
    ground.
    """
    resource = _resource(brief, command)
    if resource is None:
        return False
    motions = {verb.name: verb.motion for verb in resource.verbs}
    if ("straight" in motions.values()) != (fault.faculty == "waypoint"):
        return False
    due = ("turn",) if fault.chosen == "mirrored" else ("straight", "route")
    return motions.get(command.verb) in due


def _rerouted(fault: PlantedFault, brief: Brief, command: Action) -> Action:
    """Return the command with a displaced destination, or with the opposite turn."""
    if fault.chosen == "mirrored":
        resource = _resource(brief, command)
        turns = [verb.name for verb in resource.verbs if verb.motion == "turn"] if resource is not None else []
        opposite = next((verb for verb in turns if verb != command.verb), command.verb)
        return msgspec.structs.replace(command, verb=opposite)
    x, y = _number(command.arguments, "x") + fault.east_m, _number(command.arguments, "y") + fault.north_m
    return msgspec.structs.replace(command, arguments={**command.arguments, "x": x, "y": y})


def _number(arguments: Mapping[str, Datum], name: str) -> float:
    value = arguments.get(name)
    return float(value) if isinstance(value, int | float) else 0.0


def _handed(fault: PlantedFault, brief: Brief, message: Outgoing) -> list[Outgoing]:
    """Return what remains of a message that hands over a task. Reports of the agent's own pictures are not affected."""
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
    """Return `stop` in place of the command, or None for a body without this verb."""
    resource = _resource(brief, command)
    if resource is None or not has_verb(resource, STOP):
        return None
    return Action(verb=STOP, resource=resource.id)
