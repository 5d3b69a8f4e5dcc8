"""Destinations given to resources, however they were given: what `assigned(resource, target)` looks at."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from lingjing.kernel.registry import Assignment
from lingjing.mission.instance import AgentSpec
from lingjing.trace.records import Command, Envelope, Receipt


def from_commands(commands: Sequence[Command], receipts: Sequence[Receipt]) -> Iterator[Assignment]:
    """Commands that their engine accepted and that name a destination in the plane (`x`, `y`)."""
    accepted = {receipt.request for receipt in receipts if receipt.status == "accepted"}
    for command in commands:
        place = point((command.arguments.get("x"), command.arguments.get("y")))
        if command.id in accepted and place is not None:
            yield Assignment(command.resource, *place, command.tick)


def from_messages(envelopes: Sequence[Envelope], agents: Sequence[AgentSpec]) -> Iterator[Assignment]:
    """Admitted assignment messages with a position, for a resource or for all that an agent controls."""
    controls: Mapping[str, tuple[str, ...]] = {agent.id: agent.controls for agent in agents}
    once = {envelope.id: envelope for envelope in envelopes if envelope.category == "assignment"}
    for envelope in once.values():
        place, name = point(envelope.body.get("position")), str(envelope.body.get("assignee"))
        if place is not None:
            for resource in controls.get(name, (name,)):
                yield Assignment(resource, *place, envelope.tick)


def point(value: object) -> tuple[float, float] | None:
    """East and north of a value that is a place; None of anything else."""
    if not isinstance(value, tuple | list) or len(value) < 2:
        return None
    east, north = value[0], value[1]
    if isinstance(east, int | float) and isinstance(north, int | float):
        return float(east), float(north)
    return None
