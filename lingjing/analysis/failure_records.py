"""The failure family of a lost episode as a value, with the records that show it."""

from __future__ import annotations

from typing import Literal, get_args

import msgspec

FailureFamily = Literal[
    "perception_miss",
    "object_confusion",
    "localisation_error",
    "handoff_break",
    "coordination_deadlock",
    "context_drift",
    "unattributed",
]
FAMILIES: tuple[FailureFamily, ...] = get_args(FailureFamily)
"""All families, in the order that decides between equal ticks."""

DELAY = 10
"""Ticks after which a missing step counts as a breakdown. Chosen: a sixth of the budget of the paper's search
missions."""


class RecordLink(msgspec.Struct, frozen=True, kw_only=True):
    """One record of a chain of evidence."""

    kind: Literal["agent", "action", "message", "relation", "event", "picture"]
    tick: int
    record: str
    """The id of a frame, a message, a command or an agent; "" if the record has none."""
    text: str
    """The evidence in words."""


class Attribution(msgspec.Struct, frozen=True, kw_only=True):
    """The failure family of a lost episode."""

    family: FailureFamily
    target: str = ""
    """The lost target; "" for `unattributed`."""
    tick: int | None = None
    """The tick at which the breakdown began. None for `unattributed`."""
    chain: tuple[RecordLink, ...] = ()


__all__ = ["DELAY", "FAMILIES", "Attribution", "FailureFamily", "RecordLink"]
