"""`shortened`: an earlier state as a later request repeats it: what had changed since the state before it.

A state repeats much of the one before: places that never move, cells that were searched long ago, the ground of
pictures that are not sent again. The last state of a request is whole, so a reader needs no earlier one for it.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from lingjing_agents.react.facts import compact

EARLIER_TURNS = """\
Earlier states are shortened: each has only what had changed since the state before it. The last state is whole."""
"""The sentence about it in a system text."""

_ALWAYS = ("tick",)
_NEVER = ("of", "cells_unsearched", "limits_left_at_most", "your_last_orders")
"""Members that every state has anew, and that say nothing which the last state does not say."""

_OF_A_PICTURE = ("frame", "camera", "reference", "camera_position", "heading_deg")
"""The members of a picture that stay. The table of the ground is of use only beside the picture itself."""


def shortened(state: str, before: str | None, kept: frozenset[str] = frozenset()) -> str:
    """Return the text of a state as a difference to the state before; as it is if it is no JSON object.

    `kept` are the ids of the pictures that are sent again; their descriptions stay whole.
    """
    now = _object(state)
    if now is None:
        return state
    earlier = _object(before) if before is not None else None
    return compact(_difference(now, earlier or {}, kept))


def _object(text: str) -> dict[str, Any] | None:
    try:
        value = json.loads(text)
    except (ValueError, RecursionError):
        return None
    return value if isinstance(value, dict) else None


def _difference(now: Mapping[str, Any], before: Mapping[str, Any], kept: frozenset[str]) -> dict[str, Any]:
    changed = {
        name: value
        for name, value in now.items()
        if name in _ALWAYS or (name not in _NEVER and value != before.get(name))
    }
    if "entities" in changed:
        changed["entities"] = _changed_entities(now["entities"], before.get("entities", []))
    if "cells_searched" in changed:
        searched = before.get("cells_searched", {})
        changed["cells_searched"] = {
            name: value for name, value in now["cells_searched"].items() if value != searched.get(name)
        }
    if "pictures" in changed:
        changed["pictures"] = [_picture(picture, kept) for picture in now["pictures"]]
    return {name: value for name, value in changed.items() if value not in ([], {})}


def _changed_entities(now: list[dict[str, Any]], before: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the entities that changed, each with its id and its changed members."""
    earlier = {entity.get("id"): entity for entity in before}
    result = []
    for entity in now:
        known = earlier.get(entity.get("id"), {})
        changed = {name: value for name, value in entity.items() if value != known.get(name)}
        if changed:
            result.append({"id": entity.get("id"), **changed})
    return result


def _picture(picture: dict[str, Any], kept: frozenset[str]) -> dict[str, Any]:
    if picture.get("frame") in kept:
        return picture
    return {name: picture[name] for name in _OF_A_PICTURE if name in picture}
