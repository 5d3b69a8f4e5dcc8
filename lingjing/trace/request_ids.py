"""Ids of requests. The first letter of an id is the kind of the request.

Examples for tick 5: `c5-2` is the second command of agents in the order of admission, `m5-1` the first message, `k5-1`
the first command of the kernel itself. `p5-uav` is the substituted answer of the agent `uav`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal

RequestKind = Literal["command", "message", "kernel command", "policy answer"]

_LETTERS: Mapping[RequestKind, str] = {"command": "c", "message": "m", "kernel command": "k", "policy answer": "p"}


def request_id(kind: RequestKind, tick: int, part: int | str) -> str:
    """Return the id of a request. `part` is its number among those of its kind and tick, or an agent for an answer."""
    return f"{_LETTERS[kind]}{tick}-{part}"


def is_request_of(kind: RequestKind, request: str, tick: int | None = None) -> bool:
    """Return whether an id belongs to a request of this kind, and of this tick unless it is None."""
    return request.startswith(_LETTERS[kind] if tick is None else f"{_LETTERS[kind]}{tick}-")
