"""The text of the state at a boundary: the observation and the inbox as one line of JSON.

Numbers are metres, seconds and compass degrees, by names that say so. Fields without a value are left out.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from lingjing.plugins.policy import (
    Action,
    Brief,
    EntityView,
    Inbox,
    Observation,
    Picture,
    Receipt,
    is_request_of,
)
from lingjing.plugins.scaffold import ImageFile
from lingjing_agents.react.facts import compact, tenths, weather
from lingjing_agents.react.pictures import WHOLE, in_words


class RequestLedger:
    """The agent's commands by the boundary at which they were admitted: receipts are described with the command that
    they answer."""

    def __init__(self, commands: Mapping[int, Action] | None = None) -> None:
        self._commands = commands or {}

    def in_words(self, agent: str, receipts: Sequence[Receipt]) -> list[dict[str, object]]:
        """Return the receipts with the verb or the kind of message that each answers, without accepted messages."""
        return [
            self._receipt_in_words(agent, receipt)
            for receipt in receipts
            if not (receipt.by == "bus" and receipt.status == "accepted")
        ]

    def _receipt_in_words(self, agent: str, receipt: Receipt) -> dict[str, object]:
        """Return the fields of a receipt, with the command that it answers."""
        own = receipt.sender == agent and is_request_of("command", receipt.request)
        command = self._commands.get(receipt.tick) if own else None
        fields: dict[str, object] = {
            "request": receipt.request,
            "from": receipt.sender if receipt.sender != agent else "you",
            "message" if receipt.by == "bus" else "resource": receipt.resource,
            "verb": command.verb if command else "",
            "arguments": command.arguments if command else {},
            "status": receipt.status,
            "reason": receipt.reason,
            "detail": receipt.detail,
            "progress": receipt.progress,
        }
        return {key: value for key, value in fields.items() if value not in (None, "", {})}


def observation_text(
    observation: Observation,
    inbox: Inbox,
    brief: Brief,
    pictures: Sequence[Picture] = (),
    sent: Sequence[ImageFile] = (),
    ledger: RequestLedger | None = None,
    more: Mapping[str, object] | None = None,
) -> str:
    """Return one boundary as JSON. `pictures` are those of the request, `sent` their images in order; the members of
    `more` are added as they are."""
    requests = ledger or RequestLedger()
    state: dict[str, object] = {
        "tick": observation.tick,
        "of": brief.ticks,
        "time_s": observation.time_s,
        "weather": weather(observation.weather) if observation.weather != brief.weather else None,
        "entities": [_entity(view) for view in observation.entities],
        **_cells(observation),
        "events": [
            {"kind": event.kind, "entities": event.entities, "tick": event.tick} for event in observation.events
        ],
        "received": [
            # a message is admitted at the boundary after the decision that sends it
            {"from": note.sender, "kind": note.kind, "body": note.body, "sent_at_tick": note.tick - 1}
            for note in inbox.messages
        ],
        "receipts": requests.in_words(observation.agent, inbox.receipts),
        "pictures": [{**in_words(picture, brief), **_parts(picture, sent)} for picture in pictures],
        "absent_pictures": [
            {"camera": f"{absent.entity}/{absent.camera}", "reason": absent.reason} for absent in observation.absent
        ],
        **(more or {}),
    }
    return compact({key: value for key, value in state.items() if value not in (None, [], (), {}, "")})


def _entity(view: EntityView) -> dict[str, object]:
    velocity = tenths(view.velocity or ())
    fields: dict[str, object] = {
        "id": view.id,
        "type": view.type,
        "position": tenths(view.position) if view.position is not None else None,
        "velocity_east_north_up_mps": velocity if any(velocity) else None,
        "heading_deg": round(view.heading_deg, 1) if view.heading_deg is not None else None,
        "status": view.status,
        "busy": view.busy,
        "resources": {key: round(value, 3) for key, value in (view.resources or {}).items()} or None,
        "route": _route(view),
        "assignment": tenths(view.assignment) if view.assignment is not None else None,
    }
    return {key: value for key, value in fields.items() if value not in (None, "")}


def _route(view: EntityView) -> list[dict[str, object]] | None:
    """Return the waypoints in order, with the numbers that messages use."""
    if view.route is None:
        return None
    return [{"waypoint": number, "position": tenths(point)} for number, point in enumerate(view.route, 1)]


def _cells(observation: Observation) -> dict[str, object]:
    searched = {
        cell.name: {"tick": cell.visited_tick, "by": cell.visited_by}
        for cell in observation.cells
        if cell.visited_tick is not None
    }
    unsearched = [cell.name for cell in observation.cells if cell.visited_tick is None]
    seen = {cell.name: round(cell.seen, 2) for cell in observation.cells if cell.seen is not None}
    return {"cells_searched": searched, "cells_unsearched": unsearched, "share_of_cells_seen": seen}


def _parts(picture: Picture, sent: Sequence[ImageFile]) -> dict[str, object]:
    """Return the parts of the picture that the images of the request show, by the number of the image; nothing for a
    single whole picture."""
    numbered = [(number, image) for number, image in enumerate(sent, 1) if image.frame == picture.frame]
    if not numbered or (len(sent) == 1 and numbered[0][1].part == WHOLE):
        return {}
    return {"images": [{"image": number, "shows": [round(edge, 4) for edge in file.part]} for number, file in numbered]}
