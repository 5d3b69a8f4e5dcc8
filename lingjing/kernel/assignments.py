"""Destinations of resources, from commands or messages: the facts behind `assigned(resource, target)`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from lingjing.kernel.registry import Assignment
from lingjing.mission.instance import AgentSpec
from lingjing.trace.records import Command, Envelope, Receipt


def from_commands(commands: Sequence[Command], receipts: Sequence[Receipt]) -> Iterator[Assignment]:
    """Yield the destinations (`x`, `y`) of commands that their engine accepted."""
    accepted = {receipt.request for receipt in receipts if receipt.status == "accepted"}
    for command in commands:
        place = point((command.arguments.get("x"), command.arguments.get("y")))
        if command.id in accepted and place is not None:
            yield Assignment(command.resource, *place, command.tick)


def from_messages(envelopes: Sequence[Envelope], agents: Sequence[AgentSpec]) -> Iterator[Assignment]:
    """Yield the positions of admitted assignment messages, for the named resource or all resources of the named
    agent.
    """
    controls: Mapping[str, tuple[str, ...]] = {agent.id: agent.controls for agent in agents}
    once = {envelope.id: envelope for envelope in envelopes if envelope.category == "assignment"}
    for envelope in once.values():
        place, name = point(envelope.body.get("position")), str(envelope.body.get("assignee"))
        if place is not None:
            for resource in controls.get(name, (name,)):
                yield Assignment(resource, *place, envelope.tick)


def point(value: object) -> tuple[float, float] | None:
    """Return east and north of a value that is a position; None for any other value."""
    if not isinstance(value, tuple | list) or len(value) < 2:
        return None
    east, north = value[0], value[1]
    if isinstance(east, int | float) and isinstance(north, int | float):
        return float(east), float(north)
    return None
