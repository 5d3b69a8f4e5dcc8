"""Decisions of agents in one line."""

from __future__ import annotations

from lingjing.mission.instance import Datum
from lingjing.trace.records import Action, Decision, Outgoing

Box = tuple[float, float, float, float]
"""Left, top, right and bottom of a rectangle in a picture, as shares of its width and height, 0 to 1."""

CENTRE_BOX: Box = (0.4, 0.4, 0.6, 0.6)
"""A box in the middle of a picture."""


def does(verb: str, resource: str | None = None, **arguments: Datum) -> Decision:
    """Return a decision with one command. Without a resource the agent's only body receives it."""
    return Decision(command=Action(verb=verb, arguments=arguments, resource=resource))


def says(kind: str, to: tuple[str, ...] = (), **body: Datum) -> Decision:
    """Return a decision with one message of a kind that the mission declares. `to` are agents; all recipients if
    empty.
    """
    return Decision(messages=(Outgoing(kind=kind, body=body, to=to),))


def reports(
    kind: str, frame: str, cls: str, position: tuple[float, ...], box: Box = CENTRE_BOX, **more: Datum
) -> Decision:
    """Return a decision with the report of a detection: a class in a box of a picture, at a place.

    `position` is metres east, north and perhaps up. The confidence is 0.9; `more` adds and replaces fields of the
    message.
    """
    body: dict[str, Datum] = {"frame": frame, "class": cls, "box": box, "position": position, "confidence": 0.9, **more}
    return Decision(messages=(Outgoing(kind=kind, body=body),))


def together(*decisions: Decision) -> Decision:
    """Return one decision with the first command and all messages of the decisions."""
    command = next((decision.command for decision in decisions if decision.command), None)
    return Decision(command=command, messages=tuple(message for decision in decisions for message in decision.messages))


__all__ = ["CENTRE_BOX", "Box", "does", "reports", "says", "together"]
